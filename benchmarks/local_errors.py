"""How far the light of one cell of a photograph differs from that of its neighbours, model taken away.

    python -m benchmarks.local_errors

Errors that neighbours share are not in it: a cell is compared with the median of those around. What is left is grey
(craters, the errors of the lunar map) or of one channel (the soil's colour, the noise of the pixels): what
`inverse.noise.RELIEF` and `TINT` stand for. Needs photographs of the catalogue; those that cannot be had are left out.
"""

import numpy as np

from eclipsejax import session

PHOTOGRAPHS = (
    ("2015-09-28-canon-t2i/IMG_8742.jpg", "2015-09-28T02:25:32Z", None),
    ("2015-09-28-canon-t2i/IMG_8672.jpg", "2015-09-28T02:10:43Z", None),
    ("2022-11-08-phone-binoculars/camera-19-33.jpg", "2022-11-08T11:33:00Z", (45.0, 127.0)),
)


def local_errors(path, time, site) -> tuple[int, np.ndarray, np.ndarray]:
    """Number of cells, robust standard deviation of their grey error, and of the error of each channel besides."""
    from inverse.assumed_camera import response
    from inverse.evidence import gather, prepare
    from inverse.noise_fit import local_misfit
    from inverse.optimum import roughly, starts

    evidence = gather([path], time=time, site=site, disc=None, progress=lambda *_: None)
    likelihood = prepare(evidence)
    optimum = roughly(likelihood, starts(likelihood)[0])
    cells, measured = evidence[0].cells, np.asarray(likelihood.observed[0].measured) > 0
    assert cells is not None
    misfit = local_misfit(likelihood.misfits(optimum.z)[0], measured, evidence[0].neighbours()).reshape(-1, 3)
    used = cells.on_disc & measured.reshape(-1, 3).all(axis=1)
    by_light = response(likelihood.models[0], cells.value)[used]
    light = np.linalg.solve(by_light, misfit[used][..., None])[..., 0]
    grey = light.mean(axis=1)
    return int(used.sum()), _spread(grey), _spread(light - grey[:, None])


def _spread(values: np.ndarray) -> np.ndarray:
    """Standard deviation of most of them: half the range of the middle 68 %."""
    return 0.5 * np.diff(np.quantile(values, [0.16, 0.84], axis=0), axis=0)[0]


def main() -> None:
    session.start()
    from eclipsejax.errors import InputError
    from inverse.catalogue import photograph

    for name, time, site in PHOTOGRAPHS:
        try:
            path = photograph(name)
        except InputError as error:
            print(error)
            continue
        count, grey, each = local_errors(path, time, site)
        channels = ", ".join(f"{100 * one:.1f}" for one in each)
        print(f"{name}: {count} cells, grey {100 * grey:.1f} %, red, green and blue besides {channels} %")


if __name__ == "__main__":
    main()
