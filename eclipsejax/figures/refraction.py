"""Rays bent by the air: their paths, and bending and optical depth by quadrature and by the paper's steps."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.figures.limb_rays import columns, limb_rays
from eclipsejax.figures.page import COLOURS, FAINT, GOLD, GREEN, Plate, panels, styled
from eclipsejax.figures.ray_path import ray_path
from eclipsejax.march import march_ray

TANGENTS = (0.0, 2e3, 5e3, 10e3, 15e3, 20e3, 30e3)  # m, of the rays drawn
STEPS = (1000.0, 250.0)  # m
SCALE_HEIGHT = 8e3  # m, of the glow that stands for air


def index_at(atmosphere, wavelength, position):
    """Refractive index of the air at a position from the Earth's centre (2,) [m]."""
    altitude = jnp.sqrt(jnp.sum(position**2)) - EARTH_RADIUS
    return 1.0 + atmosphere.refractivity(altitude, wavelength)


def sunlit_path(atmosphere, tangent_height: float, wavelength: float, bending: float) -> np.ndarray:
    """Path of a ray that arrives level from the left, (point, 2) [m]: Earth's centre at (0, -EARTH_RADIUS)."""
    index = eqx.Partial(index_at, atmosphere, jnp.asarray(wavelength))
    start = np.array([0.0, EARTH_RADIUS + tangent_height])
    momentum = float(index(jnp.asarray(start))) * np.array([1.0, 0.0])
    half = ray_path(index, start, momentum, STEPS[0], 1000)
    path = np.concatenate([half[:0:-1] * [-1.0, 1.0], half])
    # The lowest point lies at the top of the circle; turned back by half the bending, the ray comes in level.
    sine, cosine = np.sin(0.5 * bending), np.cos(0.5 * bending)
    turned = path @ np.array([[cosine, -sine], [sine, cosine]])
    return turned - [0.0, EARTH_RADIUS]


@styled
def refraction_plate() -> Plate:
    """Paths of seven rays; bending and optical depth against tangent height; the error of steps."""
    atmosphere = Atmosphere()
    plate = Plate("Sunlight bent by the air", 11.0, 8.6)
    rays = limb_rays(atmosphere)
    shown = columns(COLOURS)
    stretch = _paths(plate.add_axes((0.06, 0.56, 0.84, 0.385)), atmosphere, rays)

    grid = plate.add_gridspec(1, 3, left=0.06, right=0.985, top=0.45, bottom=0.07, wspace=0.28)
    bent, dim, wrong = panels(grid)
    low = rays.height <= 50e3
    fine, bending, depth = rays.height[low], rays.bending[low][:, shown], rays.depth[low][:, shown]
    marched = np.linspace(0.0, 40e3, 17)
    at = rays.nearest(marched)
    exact_bending, exact_depth = bending[at], depth[at]
    wavelength = np.array(list(COLOURS))
    steps = {step: march_ray(atmosphere, marched[:, None], wavelength, step) for step in STEPS}
    for column, (nm, colour) in enumerate(COLOURS.items()):
        bent.semilogx(np.degrees(bending[:, column]) * 60, fine / 1e3, color=colour, label=f"{nm:.0f} nm")
        dim.semilogx(depth[:, column], fine / 1e3, color=colour)
        dots = {"color": colour, "markersize": 3.2, "linestyle": "", "marker": "o"}
        bent.plot(np.degrees(steps[STEPS[0]][0][:, column]) * 60, marched / 1e3, **dots)
        dim.plot(steps[STEPS[0]][1][:, column], marched / 1e3, **dots)
    bent.set(title="bending", xlabel="[arcmin]", ylabel="tangent height  [km]", ylim=(-1, 50), xlim=(0.04, 120))
    bent.legend(loc="upper right")
    dim.set(title="optical depth of clear air", xlabel="[–]", ylim=(-1, 50))

    for (step, (b, d)), dashes in zip(steps.items(), ("-", (0, (4, 2))), strict=True):
        for marches, exact, colour, name in ((b, exact_bending, GOLD, "bending"), (d, exact_depth, GREEN, "depth")):
            error = np.max(np.abs(marches / exact - 1.0), axis=1)
            wrong.semilogx(error, marched / 1e3, color=colour, linestyle=dashes, label=f"{name}, {step:g} m")
    wrong.set(title="steps of the paper: relative error", xlabel="[–]", ylim=(-1, 50), xlim=(1e-7, 2e-2))
    wrong.legend(loc="upper left", ncol=2, columnspacing=1.0)
    worst = {step: max(np.max(np.abs(b / exact_bending - 1.0)), np.max(np.abs(d / exact_depth - 1.0)))
             for step, (b, d) in steps.items()}  # fmt: skip
    plate.caption = (
        "Above: sunlight of 550 nm that comes in level from the left, tangent height and bending at its end, heights "
        f"stretched {stretch:.0f} times; the glow is the density of the air. A ray that touches the ground is bent by "
        f"{60 * np.degrees(bending[0, 1]):.1f}', one at 20 km by {60 * np.degrees(bending[80, 1]):.1f}'. Below: lines "
        "are the quadrature of this program, dots the steps of 1 km by which the paper integrates d/dl(n dx/dl) = "
        f"grad n. The steps are wrong by {worst[1000.0]:.1e} at most, those of 250 m by {worst[250.0]:.1e} (3 "
        "colours, 0 to 40 km)."
    )
    return plate


def _paths(panel, atmosphere, rays) -> float:
    """Draws them; returns by how much heights are stretched."""
    reach = 720e3
    x, y = np.linspace(-reach, reach, 361), np.linspace(-45e3, 45e3, 181)
    altitude = np.hypot(x, EARTH_RADIUS + y[:, None]) - EARTH_RADIUS
    air = np.exp(-np.maximum(altitude, 0.0) / SCALE_HEIGHT)[..., None]
    ground = np.clip(altitude / -1e3, 0.0, 1.0)[..., None]
    sky = np.array([0.035, 0.047, 0.063]) + air**0.7 * np.array([0.16, 0.36, 0.62])
    scene = (1 - ground) * sky + ground * np.array([0.07, 0.10, 0.09])
    edges = (-reach / 1e3, reach / 1e3, -45, 45)
    panel.imshow(np.clip(scene, 0, 1), extent=edges, origin="lower", aspect="auto", interpolation="bilinear")
    bending = rays.bending[rays.nearest(TANGENTS)][:, columns([550.0])[0]]
    for tangent, turn in zip(TANGENTS, bending, strict=True):
        path = sunlit_path(atmosphere, tangent, 550.0, float(turn)) / 1e3
        panel.plot(*path.T, color="#ffe2a0", linewidth=1.3)
        panel.plot([0, reach / 1e3], [path[0, 1]] * 2, color=FAINT, linewidth=0.7, linestyle=(0, (2, 4)))
        end = np.interp(reach / 1e3, *path.T)
        label = f"{tangent / 1e3:.0f} km, {60 * np.degrees(turn):.1f}'"
        panel.text(1.008 * reach / 1e3, end, label, color="#ffe2a0", fontsize=8.5, va="center")
    panel.set(xlim=edges[:2], ylim=(-32, 40), xlabel="[km]", ylabel="[km]")
    panel.set_title("rays of 550 nm, from the Sun on the left: tangent height, bending;  dotted: without air")
    panel.grid(False)
    box = panel.get_window_extent()
    return (box.height / 72) / (box.width / (2 * reach / 1e3))
