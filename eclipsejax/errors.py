"""The one exception that a command turns into a sentence and exit status 2."""


class InputError(ValueError):
    """Something given by the user cannot be used; the message is one sentence: what, where, what to do."""
