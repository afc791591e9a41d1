"""Speed of the heat stage beside that of copying memory."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nigemizu.cli.bench.timing import SELDOM, alternate
from nigemizu.progress import SILENT, ProgressMeter

__all__ = ["BYTES_PER_UPDATE", "copying", "hot_ground_in_wind", "measure_convection", "measure_heat"]

BYTES_PER_UPDATE = 16
"""One update reads and writes the temperature of a cell, in double precision, once at the very least."""


def hot_ground_in_wind() -> dict[str, Any]:
    """Ground, diffusivity and wind that set every part of the heat stage to work, for `heat.evolve`."""
    from nigemizu.heat import Diffusivity, HeldGround, Wind

    return {
        "ground": HeldGround.model_validate({"temperature": 330.0}),
        "diffusivity": Diffusivity(kind="eddy", friction_velocity=0.1, cap_height=1.0),
        "wind": Wind(speed=2.0, direction=30.0, shear="log"),
    }


def copying(source: NDArray[Any]) -> Callable[[], object]:
    """The work of copying an array into one that is there already."""
    target = np.empty_like(source)
    return lambda: np.copyto(target, source)


def measure_heat(
    cells: tuple[int, int, int] = (256, 128, 96), steps: int = 4, *, progress: ProgressMeter = SILENT
) -> dict[str, Any]:
    """Cell-updates per second in a stretched grid with wind and eddy diffusivity.

    Parameters
    ----------
    cells : (int, int, int)
        Number of cells along x, y and z.
    steps : int
        Steps that are timed at once.
    progress : ProgressMeter

    Returns
    -------
    dict
        ``cell_updates_per_second`` [1/s], ``memory_copy_bytes_per_second`` [1/s] read and written, and
        ``share_of_memory_copy`` [1]: the least bytes that an update must move over what a copy of the same
        volume moves in the same time.
    """
    from nigemizu.heat import GridSpec, evolve

    grid = GridSpec(x=(0.0, 64.0), y=(0.0, 32.0), height=4.0, cells=cells, first_cell=0.002).build()
    # noise: equal values would be one page of the system's memory, read over and over
    temperature = np.random.default_rng(0).normal(300.0, 0.1, grid.shape)
    setting = hot_ground_in_wind()

    def heat() -> None:
        for _ in evolve(grid, temperature, times=[0.1 * steps], time_step=0.1, **setting):
            pass

    works = {"heat": heat, "copy": copying(temperature)}
    seconds = alternate(works, SELDOM, label="heat", progress=progress)
    updates = temperature.size * steps / seconds["heat"]
    copied = 2 * temperature.nbytes / seconds["copy"]
    return {
        "cells": list(cells),
        "cell_updates_per_second": updates,
        "memory_copy_bytes_per_second": copied,
        "share_of_memory_copy": updates * BYTES_PER_UPDATE / copied,
    }


def measure_convection(
    cells: tuple[int, int, int] = (128, 128, 64),
    steps: int = 3,
    *,
    card: Any = None,
    progress: ProgressMeter = SILENT,
) -> dict[str, Any]:
    """Cell-updates per second of air that moves by itself: eddies, rough ground, wind, stretched cells.

    Parameters
    ----------
    cells : (int, int, int)
        Number of cells along x, y and z.
    steps : int
        Steps that are timed at once, of three stages each.
    card : nigemizu.field.Types, optional
        Array types of a device that is measured in turns with the processor.
    progress : ProgressMeter

    Returns
    -------
    dict
        ``cell_updates_per_second`` [1/s], and ``volumes`` [1]: the most memory that was held by arrays, in
        volumes of float64; with a card ``card_updates_per_second`` too.
    """
    from nigemizu.heat import Convection, GridSpec, HeldGround, Quantity, Sides, Top
    from nigemizu.heat.flow.moving import MovingAir

    height = 6.0
    grid = GridSpec(x=(0.0, 16.0), y=(0.0, 16.0), height=height, cells=cells, first_cell=height / 400).build()
    random = np.random.default_rng(0)
    temperature = random.normal(300.0, 0.5, grid.shape)
    velocity = 0.2 * random.standard_normal((3, *grid.shape))
    ground = HeldGround(temperature=Quantity(value=330.0))

    def begin(arrays: Any = None) -> MovingAir:
        return MovingAir(grid, Convection(ground="rough"), ground, Sides(), Top(), 2.2e-5, arrays=arrays)

    def advance(air: MovingAir, count: int) -> None:
        for _ in range(count):
            air.advance(air.longest_step(), (1.0, None))

    devices = {"cell_updates_per_second": None} | ({} if card is None else {"card_updates_per_second": card})
    with ExitStack() as stack:
        works = {}
        for name, arrays in devices.items():
            air = stack.enter_context(begin(arrays))
            air.set(temperature, (velocity[0], velocity[1], velocity[2]))
            works[name] = partial(advance, air, steps)
        seconds = alternate(works, SELDOM, label="convection", progress=progress)
    del air, works
    tracemalloc.start()
    with begin() as air:
        air.set(temperature, (velocity[0], velocity[1], velocity[2]))
        advance(air, 1)
        held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    speeds = {name: temperature.size * steps / taken for name, taken in seconds.items()}
    return {"cells": list(cells), **speeds, "volumes": held / temperature.nbytes}
