"""The one exception that a command turns into a sentence and exit status 2."""

LONGEST = 1000  # letters of a message


class InputError(ValueError):
    """Something given by the user cannot be used; the message is one sentence: what, where, what to do.

    File names and catalogues come from anywhere: what cannot be printed on one line (line ends, control sequences of
    terminals, bytes that are no text) is shown as its escape, and of what is too long the middle is left out.
    """

    def __init__(self, message: object = ""):
        text = printable(str(message))
        super().__init__(text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} … {text[-LONGEST // 3 :]}")


def printable(text: str) -> str:
    """The text with escapes for whatever does not print on a line."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)
