"""What `eclipsejax render` costs before and beside the picture: imports, tracing, compilation.

    python -m benchmarks.cold_start      # half a minute; prints both runs, with an empty cache and again

Where it is compiled in two threads the parts add up to more than the whole.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

UTC, SITE = "2008-02-21T02:20:00Z", (42.73, -73.68)
PARTS = {
    "/jax/core/compile/jaxpr_trace_duration": "tracing",
    "/jax/core/compile/jaxpr_to_mlir_module_duration": "lowering",
    "/jax/core/compile/backend_compile_duration": "compiling",
}
# The parts of the process that runs this, on its last line.
PROGRAM = """
import json, sys, time
start = time.perf_counter()
from eclipsejax import cli, session
session.start(keep_compiled=False)
import eclipsejax.scene, eclipsejax.snapshot, jax.monitoring
spent = {"importing": time.perf_counter() - start}
def add(name, seconds, **_):
    spent[name] = spent.get(name, 0.0) + seconds
jax.monitoring.register_event_duration_secs_listener(add)
cli.main(sys.argv[1:])
print(json.dumps(spent))
"""


def command(folder: str) -> list[str]:
    """Arguments of the command that is measured, writing into a folder."""
    return ["render", UTC, "--site", f"{SITE[0]},{SITE[1]}", "-o", f"{folder}/eclipse.png"]


def parts(folder: str) -> dict[str, float]:
    """Seconds of the whole and of its parts, with what is kept in a folder; what is there no more takes no time."""
    start = time.perf_counter()
    run = [sys.executable, "-c", PROGRAM, *command(folder)]
    done = subprocess.run(run, check=True, capture_output=True, text=True, env=os.environ | {"XDG_CACHE_HOME": folder})
    whole = time.perf_counter() - start
    spent = json.loads(done.stdout.splitlines()[-1])
    named = {name: spent.get(event, 0.0) for event, name in PARTS.items()}
    return {"whole": whole, "importing": spent["importing"], **named}


def told(spent: dict[str, float]) -> str:
    """In a line."""
    return ", ".join(f"{name} {seconds:.1f} s" for name, seconds in spent.items())


def main():
    with tempfile.TemporaryDirectory() as folder:
        print("first:", told(parts(folder)))
        print("again:", told(parts(folder)))


if __name__ == "__main__":
    main()
