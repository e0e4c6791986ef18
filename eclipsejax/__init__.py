"""Differentiable simulation of lunar eclipses: `import eclipsejax as ej`.

Public names are loaded when first used: the import itself takes milliseconds, and a script that only reads
the almanac never waits for JAX.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eclipsejax.air import Air as Air
    from eclipsejax.almanac import Eclipse as Eclipse
    from eclipsejax.almanac import eclipses as eclipses
    from eclipsejax.almanac import nearest_eclipse as nearest_eclipse
    from eclipsejax.aspect import Aspect as Aspect
    from eclipsejax.aspect import aspect as aspect
    from eclipsejax.atmosphere import Atmosphere as Atmosphere
    from eclipsejax.atmosphere import Clouds as Clouds
    from eclipsejax.atmosphere import Dust as Dust
    from eclipsejax.atmosphere import Haze as Haze
    from eclipsejax.atmosphere import Ozone as Ozone
    from eclipsejax.atmosphere import extinction as extinction
    from eclipsejax.atmosphere import refractivity as refractivity
    from eclipsejax.camera import Camera as Camera
    from eclipsejax.camera import Exposure as Exposure
    from eclipsejax.camera import ToneCurve as ToneCurve
    from eclipsejax.camera import expose as expose
    from eclipsejax.dust_of_brightness import DustPosterior as DustPosterior
    from eclipsejax.dust_of_brightness import dimmings as dimmings
    from eclipsejax.dust_of_brightness import dust_of_dimming as dust_of_dimming
    from eclipsejax.dust_of_brightness import uncertain_limbs as uncertain_limbs
    from eclipsejax.ephemeris import Geometry as Geometry
    from eclipsejax.ephemeris import geometry as geometry
    from eclipsejax.ephemeris import local_circumstances as local_circumstances
    from eclipsejax.errors import InputError as InputError
    from eclipsejax.limb import bending_angle as bending_angle
    from eclipsejax.limb import impact_parameter as impact_parameter
    from eclipsejax.limb import optical_depth as optical_depth
    from eclipsejax.limb_sectors import along_limb as along_limb
    from eclipsejax.limb_shape import LimbShape as LimbShape
    from eclipsejax.limb_table import grazing_rays as grazing_rays
    from eclipsejax.march import march_ray as march_ray
    from eclipsejax.moon import Moon as Moon
    from eclipsejax.photometry import Brightness as Brightness
    from eclipsejax.photometry import danjon as danjon
    from eclipsejax.photometry import field_stops as field_stops
    from eclipsejax.photometry import photometer as photometer
    from eclipsejax.render import render as render
    from eclipsejax.render import renderer as renderer
    from eclipsejax.response import display as display
    from eclipsejax.scattered import scattered_irradiance as scattered_irradiance
    from eclipsejax.scatterers import Scatterers as Scatterers
    from eclipsejax.scene import Scene as Scene
    from eclipsejax.shadow import shadow_irradiance as shadow_irradiance
    from eclipsejax.shadow_operator import shadow_operator as shadow_operator
    from eclipsejax.sky import Sky as Sky
    from eclipsejax.sounding import Sounding as Sounding
    from eclipsejax.sun import Sun as Sun
    from eclipsejax.sun import limb_darkening as limb_darkening
    from eclipsejax.umbra import umbra_enlargement as umbra_enlargement
    from eclipsejax.umbra import umbra_radius as umbra_radius

_NAMES = {
    "air": ["Air"],
    "almanac": ["Eclipse", "eclipses", "nearest_eclipse"],
    "aspect": ["Aspect", "aspect"],
    "atmosphere": ["Atmosphere", "Clouds", "Dust", "Haze", "Ozone", "extinction", "refractivity"],
    "camera": ["Camera", "Exposure", "ToneCurve", "expose"],
    "dust_of_brightness": ["DustPosterior", "dimmings", "dust_of_dimming", "uncertain_limbs"],
    "ephemeris": ["Geometry", "geometry", "local_circumstances"],
    "errors": ["InputError"],
    "limb": ["bending_angle", "impact_parameter", "optical_depth"],
    "limb_sectors": ["along_limb"],
    "limb_shape": ["LimbShape"],
    "limb_table": ["grazing_rays"],
    "march": ["march_ray"],
    "moon": ["Moon"],
    "photometry": ["Brightness", "danjon", "field_stops", "photometer"],
    "render": ["render", "renderer"],
    "response": ["display"],
    "scattered": ["scattered_irradiance"],
    "scatterers": ["Scatterers"],
    "scene": ["Scene"],
    "shadow": ["shadow_irradiance"],
    "shadow_operator": ["shadow_operator"],
    "sky": ["Sky"],
    "sounding": ["Sounding"],
    "sun": ["Sun", "limb_darkening"],
    "umbra": ["umbra_enlargement", "umbra_radius"],
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}

if not TYPE_CHECKING:  # to a type checker every name would exist
    __all__ = sorted(_HOME)

    def __getattr__(name):
        if name not in _HOME:
            raise AttributeError(f"module 'eclipsejax' has no attribute {name!r}")
        value = getattr(import_module(f"eclipsejax.{_HOME[name]}"), name)
        globals()[name] = value
        return value

    def __dir__():
        return sorted({*globals(), *_HOME})


class _Package(ModuleType):
    """The package, in which the module `render` does not take the place of the function `render`.

    Importing a submodule sets it as an attribute of its package, whenever and by whomever that happens first.
    """

    def __setattr__(self, name: str, value) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
