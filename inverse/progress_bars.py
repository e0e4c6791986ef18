"""Progress on a terminal: a bar for each stage of the work."""


class Bars:
    """One progress bar a stage, within a `with`; called with the stage, what is done, and of how much."""

    def __init__(self):
        self.bar, self.stage = None, ""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.close()

    def __call__(self, stage: str, done: int, total: int) -> None:
        from tqdm import tqdm

        if stage != self.stage:
            self.__exit__()
            self.stage, self.bar = stage, tqdm(total=total, desc=stage, unit="")
        assert self.bar is not None
        self.bar.total = total  # it may turn out to be more than was thought
        self.bar.update(done - self.bar.n)
