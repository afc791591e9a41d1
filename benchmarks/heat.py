"""Speed and memory of the heat stage: wind and diffusion along all three axes on 256 × 128 × 96 cells.

One cell-update is one full step of everything on one cell. The speed of a plain copy of the same volume,
measured in the same run, makes the number comparable between machines and between quiet and busy ones.

    python benchmarks/heat.py [--json] [--cells NX NY NZ] [--steps N]
"""

from __future__ import annotations

import argparse
import json
import math
import time
import tracemalloc

import numpy as np

from nigemizu.cli.bench.heat import copying, hot_ground_in_wind
from nigemizu.cli.bench.timing import OFTEN, alternate
from nigemizu.heat import GridSpec


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print a JSON object instead of the table")
    parser.add_argument("--cells", type=int, nargs=3, default=(256, 128, 96), metavar=("NX", "NY", "NZ"))
    parser.add_argument("--steps", type=int, default=20, help="time steps that are measured")
    arguments = parser.parse_args()
    figures = measure(tuple(arguments.cells), arguments.steps)
    if arguments.json:
        print(json.dumps(figures, indent=2))
        return
    for name, value in figures.items():
        print(f"{name:<34}{value:>14,.3f}" if isinstance(value, float) else f"{name:<34}{value!s:>14}")


def measure(cells: tuple[int, int, int], steps: int) -> dict[str, object]:
    """All figures, by name."""
    started = time.perf_counter()
    from nigemizu.heat.solver import evolve

    imported = time.perf_counter() - started
    grid = GridSpec(x=(0, 64), y=(0, 32), height=4, cells=cells, first_cell=0.002).build()
    tiny = GridSpec(x=(0, 8), y=(0, 8), height=4, cells=(8, 8, 8)).build()
    setting = hot_ground_in_wind()
    # the first call compiles the loops, or loads them when they were compiled before
    started = time.perf_counter()
    for _ in evolve(tiny, np.full(tiny.shape, 300.0), times=[1.0], **setting):
        pass
    first_call = time.perf_counter() - started

    initial = np.random.default_rng(1).normal(300.0, 1.0, grid.shape)
    step = 0.1
    tracemalloc.start()
    volume_bytes = initial.nbytes
    tracemalloc.reset_peak()
    times = np.array([step, step * 2, step * (2 + steps)])
    states = evolve(grid, initial, times=times, time_step=step, **setting)
    next(states), next(states)
    started = time.perf_counter()
    next(states)
    elapsed = time.perf_counter() - started
    # what was allocated while it ran, and the initial volume of the caller
    peak = tracemalloc.get_traced_memory()[1] / volume_bytes + 1
    tracemalloc.stop()

    copied = alternate({"copy": copying(initial)}, OFTEN)["copy"]
    updates = math.prod(cells) * steps / elapsed
    return {
        "cells (nx, ny, nz)": tuple(cells),
        "steps": steps,
        "cell-updates per second, million": updates / 1e6,
        "seconds per step": elapsed / steps,
        "memory copy, million cells per s": math.prod(cells) / copied / 1e6,
        "step in memory copies": elapsed / steps / copied,
        "peak memory, volumes": peak,
        "import of the solver, s": imported,
        "first call (compiles or loads), s": first_call,
    }


if __name__ == "__main__":
    main()
