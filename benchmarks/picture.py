"""The picture of time against error, from the results that the other scripts have written.

python -m benchmarks.picture      # writes docs/speed-against-error.png
"""

import json
from pathlib import Path

from benchmarks.measure import RESULTS

PICTURE = Path(__file__).parents[1] / "docs" / "speed-against-error.png"
COLOURS = ("#000000", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999")


def measurements(name: str) -> list[dict]:
    """What results/`name`.json holds."""
    return json.loads((RESULTS / f"{name}.json").read_text())["measurements"]


def curves(panel, rows: list[dict], title: str) -> None:
    """One line for each method, from its settings with a time and an error."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    for method, colour in zip(methods, [*COLOURS, *COLOURS], strict=False):
        points = sorted(
            (row["max_error"], row["warm_s"])
            for row in rows
            if row["method"] == method and row["max_error"]  # 0 is the reference itself
        )
        if points:
            ours = method.startswith(("eclipsejax", "operator", "shadow_irradiance", "picture"))
            panel.plot(
                *zip(*points, strict=True), "o-" if ours else "s--", color=colour, linewidth=2.2 if ours else 1.2,
                markersize=5, label=method,
            )  # fmt: skip
    panel.set(xscale="log", yscale="log", xlabel="largest relative error", ylabel="time, warm [s]", title=title)
    panel.invert_xaxis()
    panel.grid(True, color="#dddddd", linewidth=0.6)
    panel.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncol=2, frameon=False)


def main():
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 6.8), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    curves(left, measurements("rays"), "120 grazing rays at 81 wavelengths")
    shadow = [*measurements("shadow_peers"), *measurements("shadow_speed")]
    kept = [row for row in shadow if not row["method"].startswith("eclipsejax ")]
    curves(middle, kept, "shadow: 64 offsets at 24 wavelengths")
    curves(right, measurements("images"), "partial eclipse, 1,000 x 1,000 pixels")
    right.set(xlim=(2e-2, 2e-4), ylim=(0.03, 1.0))  # else less than a decade, whose labels run into each other
    figure.savefig(PICTURE, dpi=110)
    print(f"Wrote {PICTURE.parent.name}/{PICTURE.name}")


if __name__ == "__main__":
    main()
