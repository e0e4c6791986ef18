"""From the one knob, `tolerance`, to a measured setting."""

from collections.abc import Iterable

from eclipsejax.errors import InputError


def reached(settings: Iterable[float], tolerance: float) -> float:
    """The largest, so the cheapest, of the errors that settings were measured to reach and that meet a tolerance."""
    meeting = [error for error in settings if error <= tolerance * (1 + 1e-12)]
    if not meeting:
        raise InputError(f"`tolerance` must be at least {min(settings)}, not {tolerance}.")
    return max(meeting)
