"""The tank of sugar water: a laser bent by a gradient of the refractive index, marched as in the paper.

Where n^2 falls linearly with height, d/dl(n dx/dl) = grad n becomes, with ds = dl / n, d^2x/ds^2 = (1/2) grad n^2: free
fall. Rays are exact parabolas, an oracle for the steps.
"""

import jax.numpy as jnp
import numpy as np

from eclipsejax.figures.page import FAINT, GOLD, GREEN, Plate, styled
from eclipsejax.figures.ray_path import ray_path

LENGTH, DEPTH = 0.60, 0.12  # m
BOTTOM, SURFACE = 1.44, 1.333  # refractive index of syrup with 60 % sugar, and of water
FALL = (BOTTOM**2 - SURFACE**2) / DEPTH  # of n^2 [1/m]
BEAMS = ((0.035, 14.0), (0.055, 9.0), (0.085, 5.0), (0.108, 0.0))  # height [m] and slope [degrees] at the glass
STEPS = (0.04, 0.02, 0.01, 0.005, 0.0025, 0.00125)  # m


def tank_index(position):
    """Refractive index at (x, height) [m]."""
    return jnp.sqrt(BOTTOM**2 - FALL * position[1])


def start(height: float, degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and momentum of a beam at the glass."""
    slope = np.radians(degrees)
    return np.array([0.0, height]), float(tank_index((0.0, height))) * np.array([np.cos(slope), np.sin(slope)])


def parabola(height: float, degrees: float, x):
    """Exact height [m] of a beam at x [m]."""
    _, (along, up) = start(height, degrees)
    s = np.asarray(x) / along
    return height + up * s - 0.25 * FALL * s**2


def marched(height: float, degrees: float, step: float) -> np.ndarray:
    """The beam by steps, (point, 2) [m], as far as it stays in the tank."""
    # As many steps as the smallest needs, so that one compilation serves: the longest lead out of the tank.
    path = ray_path(tank_index, *start(height, degrees), step, round(LENGTH / STEPS[-1]), 1e-3)
    inside = (path[:, 0] <= LENGTH) & (path[:, 1] > 0.0)
    return path[: np.argmin(inside)] if not inside.all() else path


def march_error(step: float) -> float:
    """Largest distance in height between the marched beams and the exact ones [m]."""
    paths = [(beam, marched(*beam, step)) for beam in BEAMS]
    return max(float(np.max(np.abs(path[:, 1] - parabola(*beam, path[:, 0])))) for beam, path in paths)


@styled
def tank_plate() -> Plate:
    """Four beams in the tank, exact and by steps of 2 cm, and the error against the step."""
    plate = Plate("A laser in sugar water", 11.0, 5.9)
    tank = plate.add_axes((0.06, 0.56, 0.92, 0.37))
    syrup = np.linspace(0.05, 0.55, 64)[:, None, None] * np.array([0.72, 0.42, 0.14])  # sugar: the more, the browner
    tank.imshow(syrup, extent=(0, 100 * LENGTH, 0, 100 * DEPTH), aspect="auto", interpolation="bilinear")
    x = np.linspace(0.0, LENGTH, 400)
    for beam in BEAMS:
        y = parabola(*beam, x)
        inside = y > 0
        for width, alpha in ((7.0, 0.12), (3.5, 0.25), (1.2, 1.0)):
            tank.plot(100 * x[inside], 100 * y[inside], color="#5dff8f", linewidth=width, alpha=alpha)
        path = marched(*beam, 0.02)
        tank.plot(*(100 * path.T), "o", color="white", markersize=3, markeredgewidth=0)
    tank.set(title="beams: exact parabolas;  dots: steps of 2 cm, as the paper marches them", ylabel="height  [cm]")
    tank.set(xlabel="[cm]", xlim=(0, 100 * LENGTH), ylim=(0, 100 * DEPTH))
    tank.grid(False)

    left = plate.add_axes((0.06, 0.095, 0.27, 0.32))
    height = np.linspace(0.0, DEPTH, 50)
    left.plot(tank_index((0.0, height)), 100 * height, color=GOLD)
    left.set(title="refractive index", xlabel="n", ylabel="height  [cm]", ylim=(0, 100 * DEPTH))

    right = plate.add_axes((0.43, 0.095, 0.55, 0.32))
    errors = np.array([march_error(step) for step in STEPS])
    steps = 1e3 * np.array(STEPS)
    right.loglog(steps, 1e3 * errors, "o-", color=GREEN, label="largest error of the four beams")
    right.loglog(steps, 1e3 * errors[-1] * steps / steps[-1], color=FAINT, linestyle=(0, (4, 3)), label="first order")
    right.set(title="error of the march", xlabel="step  [mm]", ylabel="error of height  [mm]")
    right.set_xticks(steps, [f"{step:g}" for step in steps])
    right.set_yticks([0.3, 1.0, 3.0], ["0.3", "1", "3"])
    right.tick_params(which="minor", length=0, labelbottom=False, labelleft=False)
    right.legend(loc="upper left")
    plate.caption = (
        f"Sugar settles, so n falls from {BOTTOM} at the bottom to {SURFACE} at the surface of a tank "
        f"{100 * LENGTH:g} cm long, and a laser sent in level, or upwards, falls back towards the denser syrup. With "
        f"n² linear in height the beam is an exact parabola. The march of the paper is off by {1e3 * errors[1]:.2f} "
        f"mm at most with steps of {steps[1]:g} mm and by {1e3 * errors[-1]:.3f} mm with {steps[-1]:g} mm: half the "
        "step, half the error."
    )
    return plate
