"""Roll."""
def orientation(*a): raise NotImplementedError
