"""Draws pictures of the README: plates of the gallery, smaller. `make picture` runs it."""

from pathlib import Path

from eclipsejax import session
from eclipsejax.figures.gallery import plates

NAMES = ("exposures-2008", "dust")
MOON, DPI = 200, 84  # pixels of each Moon; dots per inch of the plate, which is 11 to 12.5 inches wide

session.start()
for name in NAMES:
    path = Path(__file__).with_name(f"{name}.png")
    path.write_bytes(plates(MOON)[name]().png(DPI))
    print(f"Wrote {path.name}: {path.stat().st_size / 1e3:.0f} kB.")
