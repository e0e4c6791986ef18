"""Imports run one way, each host library has one home, and importing the package is cheap."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# From the bottom up: a module may import those above it in this list.
ORDER = """
constants errors session whole_file traced tolerance calendar spectra air sounding_levels sounding atmosphere limb march
sun
arc sunlight limb_table ring limb_shape limb_sectors shadow sky_cells sky_flux shadow_operator scatterers twilight
scattered moon sky response camera almanac ephemeris scene aspect shadow_table flattened_table lopsided_table
wavelengths render photometry umbra programs snapshot dust_of_brightness sequence movie movie_file texture figures
selftest cli
""".split()
# The same within the package of that name.
FIGURES = """
page colour limb_rays ray_path picture air tank refraction to_the_moon light surface worlds danjon series moonset
chart sun gallery
""".split()
HOMES = {
    "colour": {"eclipsejax/response.py"},
    "skimage": {f"inverse/{name}.py" for name in ("disc_search", "limb_fit", "orientation", "registration")},
    "emcee": {"inverse/ensemble.py"},
    "dask": {"inverse/archive/maker.py"},
    "distributed": {"inverse/archive/maker.py"},
}
DRAWERS = {"eclipsejax/figures/page.py"} | {
    f"inverse/{name}.py" for name in ("page", "comparison_plot", "corner_plot", "profile_plot", "archive/plot")
}
HEAVY = ("colour", "skimage", "matplotlib", "emcee", "skyfield", "dask", "scipy", "jax")


@cache
def imports(path: Path, lazy: bool = True) -> frozenset[str]:
    """Full names of all modules that a file imports, wherever in it; or, not `lazy`, when it is loaded itself."""
    found = set()
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree) if lazy else tree.body:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            package = path.parent.name if node.level else ""
            base = ".".join(part for part in (package, node.module) if part)
            found |= {base} | {f"{base}.{alias.name}" for alias in node.names}
    return frozenset(found)


def modules(package: str) -> dict[str, Path]:
    return {path.stem: path for path in sorted((ROOT / package).glob("*.py")) if path.stem != "__init__"}


def siblings(path: Path, lazy: bool = True) -> set[str]:
    """Modules of its own package that a file imports."""
    package = path.parent.relative_to(ROOT).as_posix()
    dotted = package.replace("/", ".") + "."
    named = {name.removeprefix(dotted).split(".")[0] for name in imports(path, lazy) if name.startswith(dotted)}
    return named & (set(modules(package)) | {"figures", "archive"})


@pytest.mark.parametrize("module", modules("eclipsejax"))
def test_imports_of_the_forward_model_run_one_way(module):
    assert module in ORDER, f"give {module} its place in the order of modules"
    above = set(ORDER[: ORDER.index(module)])
    assert siblings(modules("eclipsejax")[module]) <= above


@pytest.mark.parametrize("module", modules("eclipsejax/figures"))
def test_imports_of_the_figures_run_one_way(module):
    assert module in FIGURES, f"give {module} its place in the order of modules"
    path = modules("eclipsejax/figures")[module]
    assert siblings(path) <= set(FIGURES[: FIGURES.index(module)])
    named = {name.split(".")[1] for name in imports(path) if name.startswith("eclipsejax.")}
    assert named & set(ORDER) <= set(ORDER[: ORDER.index("figures") + 1])


def test_imports_of_the_inverse_run_in_no_circle():
    # But for what a function loads when it is called: a result that writes its own report.
    graph = {name: siblings(path, lazy=False) for name, path in modules("inverse").items()}
    within = {name: siblings(path, lazy=False) for name, path in modules("inverse/archive").items()}
    assert "archive" in graph["cli"] and "rows" in within["maker"]
    graph["archive"] = {
        name.split(".")[1]
        for path in modules("inverse/archive").values()
        for name in imports(path, lazy=False)
        if name.startswith("inverse.") and not name.startswith("inverse.archive")
    }
    for one in (graph, within):
        assert len(tuple(TopologicalSorter(one).static_order())) >= len(one)


def test_no_fit_knows_of_archives():
    for name, path in modules("inverse").items():
        assert name == "cli" or "archive" not in siblings(path), name


def test_forward_model_knows_nothing_of_the_inverse():
    for path in (ROOT / "eclipsejax").rglob("*.py"):
        assert not any(name.split(".")[0] == "inverse" for name in imports(path)), path.name


@pytest.mark.parametrize("library", HOMES)
def test_host_library_stays_in_its_home(library):
    for package in ("eclipsejax", "inverse"):
        for path in (ROOT / package).rglob("*.py"):
            users = {name.split(".")[0] for name in imports(path)}
            assert library not in users or path.relative_to(ROOT).as_posix() in HOMES[library], path.name


def test_matplotlib_stays_in_the_modules_that_draw():
    for package in ("eclipsejax", "inverse"):
        for path in (ROOT / package).rglob("*.py"):
            if any(name.split(".")[0] == "matplotlib" for name in imports(path)):
                assert path.relative_to(ROOT).as_posix() in DRAWERS, path.name


def test_importing_the_package_loads_no_heavy_library():
    program = f"import sys, eclipsejax; print([name for name in {HEAVY} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    assert result.stdout.strip() == "[]"


def test_public_names_exist_and_no_module_hides_a_function():
    program = (
        "import eclipsejax as ej, eclipsejax.render\n"
        "missing = [name for name in dir(ej) if not name.startswith('_') and not hasattr(ej, name)]\n"
        "print(missing, callable(ej.render), len(dir(ej)) > 20)"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    assert result.stdout.split() == ["[]", "True", "True"]
