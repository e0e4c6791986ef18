"""The atmosphere read back from photographs of lunar eclipses. Public names are loaded when first used."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from inverse.fit import Fit as Fit
    from inverse.fit import fit_atmosphere as fit_atmosphere
    from inverse.photo import Photo as Photo
    from inverse.photo import read_photo as read_photo
    from inverse.registration import Registration as Registration
    from inverse.registration import register as register

_HOME = {
    "Fit": "fit",
    "Photo": "photo",
    "Registration": "registration",
    "fit_atmosphere": "fit",
    "read_photo": "photo",
    "register": "registration",
}

if not TYPE_CHECKING:  # to a type checker every name would exist
    __all__ = sorted(_HOME)

    def __getattr__(name):
        if name not in _HOME:
            raise AttributeError(f"module 'inverse' has no attribute {name!r}")
        value = getattr(import_module(f"inverse.{_HOME[name]}"), name)
        globals()[name] = value
        return value

    def __dir__():
        return sorted({*globals(), *_HOME})
