"""What is free in a fit, and what is believed of it before the photograph is seen.

Every quantity is a smooth, increasing function of a standard normal z, so that bounds need no clipping, all
parameters have the same scale, and the prior is one residual, z itself.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import expit

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone


class Parameter(NamedTuple):
    """One free quantity and its prior.

    - `shape`: "normal" (centre + width z), "lognormal" (centre exp(width z)) or "logitnormal" (a fraction whose logit
      is normal).
    - `centre`: median.
    - `width`: standard deviation of the value, of its logarithm, of its logit.
    """

    name: str
    unit: str
    shape: str
    centre: float
    width: float
    reason: str

    def value(self, z, xp=jnp):
        """The quantity for a standard normal z.

        - `xp`: JAX's or plain NumPy.
        """
        if self.shape == "normal":
            return self.centre + self.width * z
        if self.shape == "lognormal":
            return self.centre * xp.exp(self.width * z)
        logit = np.log(self.centre / (1.0 - self.centre)) + self.width * z
        return expit(logit) if xp is np else jax.nn.sigmoid(logit)

    def slope(self, z, xp=jnp):
        """Derivative of `value` by z."""
        value = self.value(z, xp)
        return self.width * {"normal": 1.0, "lognormal": value, "logitnormal": value * (1.0 - value)}[self.shape]


CLOCK = 60.0  # s: a clock that somebody set
GAIN = 3.0  # ln: a sensitivity of which nothing is known

# The limb. Shared by all photographs of one eclipse.
ATMOSPHERE = (
    Parameter(
        "dust.extinction", "1/m", "lognormal", 7e-7, 1.5,
        "optical depth 0.007, 95 % within 0.0004-0.13: quiet stratosphere to Pinatubo",
    ),
    Parameter("air.surface_temperature", "K", "normal", 285.0, 12.0, "mean of the limb, winter pole to tropics"),
    Parameter("air.surface_pressure", "Pa", "normal", 101200.0, 800.0, "mean of a limb 40,000 km long"),
    Parameter("clouds.cover", "-", "logitnormal", 0.93, 1.2, "chance that 400 km near the ground are not clear"),
    Parameter("clouds.top", "m", "lognormal", 7e3, 0.35, "3.5-14 km: photometry of five eclipses asks for some 8"),
    Parameter("clouds.width", "m", "lognormal", 4e3, 0.4, "tops vary along the limb"),
    Parameter("haze.optical_depth", "-", "lognormal", 0.1, 0.6, "vertical, 550 nm; AERONET's usual range"),
    Parameter("ozone.column_du", "DU", "normal", 300.0, 35.0, "mean of the limb"),
    Parameter("scattered.amplitude", "-", "lognormal", 1.0, 0.4, "of the light that such a limb scatters"),
)  # fmt: skip

# What the camera, its pointing and the photographer's clock add. For each photograph; what a camera is known to keep
# from one photograph to the next is one for all of its photographs (`OF_CAMERA`), and so is its clock.
PHOTOGRAPH = (
    Parameter("gain", "ln", "normal", 0.0, GAIN, "sensitivity unknown; centred on the photographs themselves"),
    Parameter("exposure", "sd", "normal", 0.0, 1.0, "error of the stated exposure, in its own standard deviations"),
    Parameter("white_balance.red", "ln", "normal", 0.0, 0.3, "against green, from the light of the full Moon"),
    Parameter("white_balance.blue", "ln", "normal", 0.0, 0.3, "against green"),
    Parameter("tint.red", "sd", "normal", 0.0, 1.0, "against others of its camera, in its own standard deviations"),
    Parameter("tint.blue", "sd", "normal", 0.0, 1.0, "against others of its camera, in its own standard deviations"),
    Parameter("albedo.contrast", "-", "lognormal", 0.7, 0.2, "of the lunar map near opposition: 0.58-0.81 fitted"),
    Parameter("camera.glare", "-", "lognormal", 0.01, 1.0, "share of the light in wide wings"),
    Parameter("camera.veil", "of the disc's median", "lognormal", 0.01, 1.5, "sky glow, even over the frame"),
    Parameter("pointing.right", "radius", "normal", 0.0, 0.01, "error of the registration"),
    Parameter("pointing.up", "radius", "normal", 0.0, 0.01, "error of the registration"),
    Parameter("pointing.radius", "radius", "normal", 0.0, 0.003, "error of the registration: 0.3 % in one of 20"),
    Parameter("pointing.roll", "rad", "normal", 0.0, 0.02, "error of the registration"),
    Parameter("clock", "s", "normal", 0.0, CLOCK, "of the camera, or of who wrote the time down"),
)
TONE = (
    Parameter("tone.exponent", "-", "lognormal", 1.0, 0.3, "picture styles, against sRGB's curve: 0.7-1.8 fitted"),
    Parameter("tone.toe", "full scale", "lognormal", 0.01, 1.0, "darkening of shadows by contrast curves"),
    Parameter("tone.black", "full scale", "normal", 0.0, 0.001, "what the camera takes for black"),
    Parameter("tone.shoulder", "-", "lognormal", 0.3, 1.0, "compression of highlights"),
    Parameter("tone.saturation", "-", "normal", 0.8, 0.3, "share of the colour matrix that the camera applied"),
    *(
        Parameter(f"matrix.{name}", "-", "normal", 0.0, 0.12, "colour matrix against the one assumed")
        for name in ("red_green", "red_blue", "green_red", "green_blue", "blue_red", "blue_green")
    ),
)
OF_CAMERA = frozenset(
    ["gain", "white_balance.red", "white_balance.blue", "albedo.contrast", *(parameter.name for parameter in TONE)]
)

# What changes which points of the Moon a photograph shows, or how bright they are in sunlight: all else acts on light.
OF_THE_VIEW = frozenset(
    [
        "albedo.contrast",
        "pointing.right",
        "pointing.up",
        "pointing.radius",
        "pointing.roll",
        "pointing.offset",
        "clock",
    ]
)


def photograph_parameters(tone_curve: str, clock: float = CLOCK, gain: float = GAIN) -> tuple[Parameter, ...]:
    """The nuisances of one photograph: a linear one has no tone curve.

    - `clock`, `gain`: standard deviations of its clock's error [s] and of its camera's sensitivity [ln].
    """
    widths = {"clock": clock, "gain": gain}
    always = tuple(one._replace(width=widths.get(one.name, one.width)) for one in PHOTOGRAPH)
    return always if tone_curve == "linear" else always + TONE


PROFILE = (
    *(p for p in PHOTOGRAPH if p.name.split(".")[0] in ("gain", "exposure", "white_balance", "tint")),
    Parameter("camera.veil", "of the disc's median", "lognormal", 0.01, 1.5, "sky glow and wide glare together"),
    Parameter("pointing.offset", "rad", "normal", 0.0, 3e-4, "1': clock and registration together"),
)


def profile_parameters(tone_curve: str) -> tuple[Parameter, ...]:
    """The nuisances of a profile of brightness against offset."""
    return PROFILE if tone_curve == "linear" else PROFILE + TONE


def values(parameters: tuple[Parameter, ...], z: Float[Array, " parameter"]) -> dict[str, Float[Array, ""]]:
    """Physical values by name."""
    return {parameter.name: parameter.value(z[i]) for i, parameter in enumerate(parameters)}


def atmosphere(z: Float[Array, " parameter"]) -> Atmosphere:
    """The limb for standard normal parameters in the order of `ATMOSPHERE`."""
    value = values(ATMOSPHERE, z)
    return Atmosphere(
        air=Air(value["air.surface_temperature"], value["air.surface_pressure"]),
        ozone=Ozone(value["ozone.column_du"]),
        dust=Dust(value["dust.extinction"]),
        haze=Haze(value["haze.optical_depth"]),
        clouds=Clouds(value["clouds.top"], value["clouds.cover"], value["clouds.width"]),
    )
