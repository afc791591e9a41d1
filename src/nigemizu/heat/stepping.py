"""One step of the heat equation after another: the air of two instants and the coefficients between them."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import final

import numpy as np

from nigemizu.errors import InputError
from nigemizu.heat.boundary import ExchangeGround, FluxGround, GroundBoundary, HeldGround, Sides, Top
from nigemizu.heat.columns import ColumnSteps
from nigemizu.heat.grid import Grid
from nigemizu.heat.horizontal import HorizontalMotion
from nigemizu.heat.kernels import move_levels
from nigemizu.heat.quantity import Quantity
from nigemizu.heat.transport import Diffusivity, Wind
from nigemizu.heat.vertical import BOUNDARY_ROWS, VerticalDiffusion

__all__ = ["GroundCourse", "State", "Stepper", "ground_quantity", "processors", "top_temperature"]


@final
@dataclass(frozen=True, eq=False)
class State:
    """The air at one instant.

    Attributes
    ----------
    time : float, s
    temperature : (nz, ny, nx) float64, K
        At the cell centres.
    surface_temperature : (ny, nx) float64, K
        Of the air's skin on the ground, at the lower face of the lowest cells.
    wind : tuple of (nz, ny, nx) float64, m s-1, optional
        Along x, y and upwards at the cell centres, where the air moves by itself.
    """

    time: float
    temperature: np.ndarray
    surface_temperature: np.ndarray
    wind: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None


class GroundCourse:
    """The ground's number over the cells, split into what varies in time and what varies in place."""

    def __init__(self, grid: Grid, ground: GroundBoundary) -> None:
        self.quantity = ground_quantity(ground)
        self.factor, self.summand = self.quantity.planes(grid)

    def fill(self, plane: np.ndarray, time: float) -> None:
        """Write the numbers at `time` into a plane of ny × nx cells in a row."""
        np.multiply(self.factor.ravel(), self.quantity.at_time(time), out=plane)
        plane += self.summand.ravel()


def ground_quantity(ground: GroundBoundary) -> Quantity:
    match ground:
        case HeldGround() | ExchangeGround():
            return ground.temperature
        case FluxGround():
            return ground.heat_flux


class Stepper:
    """The two volumes, and the coefficients of every step length that was needed so far."""

    def __init__(
        self,
        grid: Grid,
        initial: np.ndarray,
        ground: GroundBoundary,
        top: Top,
        diffusivity: Diffusivity,
        wind: Wind,
        sides: Sides,
    ) -> None:
        self.grid, self.ground = grid, GroundCourse(grid, ground)
        self.diffusivity, self.wind, self.sides = diffusivity, wind, sides
        self.levels = grid.shape[0]
        # the levels as rows, followed by the ground's number before and after the step and by the top's
        self.now = np.empty((self.levels + BOUNDARY_ROWS, math.prod(grid.shape[1:])))
        self.next = np.empty_like(self.now)
        self.now[: self.levels] = initial.reshape(self.levels, -1)
        held = top_temperature(grid, initial) if top.temperature is None else top.temperature
        self.now[-1] = self.next[-1] = held
        self.motions: dict[float, HorizontalMotion] = {}
        self.y_first = False
        self.workers = processors()
        column = VerticalDiffusion.build(grid, diffusivity, ground, top)
        self.columns = ColumnSteps(grid, column, ground, self.workers)
        self.pool: ThreadPoolExecutor | None = None

    def __enter__(self) -> None:
        self.pool = ThreadPoolExecutor(self.workers)

    def __exit__(self, *_: object) -> None:
        assert self.pool is not None
        self.pool.shutdown()

    def advance(self, time: float, end: float, *, opens: bool, closes: bool) -> None:
        """One step from `time` to `end` [s].

        The half steps of horizontal motion that meet between two steps of a run are made as one; the first
        step of a run opens with a half, the last one closes with a half.
        """
        step = _rounded(end - time)
        if opens:
            self._move(0.5 * step)
        self.ground.fill(self.now[self.levels], time)
        self.ground.fill(self.now[self.levels + 1], end)
        self._share(*self.columns.work(step, 0.5 * (time + end), self.now, self.next))
        self.now, self.next = self.next, self.now
        self._move(0.5 * step if closes else step)

    def _move(self, step: float) -> None:
        if step not in self.motions:
            self.motions[step] = HorizontalMotion.build(
                self.grid, self.diffusivity, self.wind, self.sides, step
            )
        motion = self.motions[step]
        if motion.is_still:
            return
        air = self.now[: self.levels].reshape(self.grid.shape)
        coefficients = (
            motion.shifts,
            motion.parts,
            motion.carry,
            motion.halves,
            motion.kernels,
            motion.periodic,
        )
        self._share(
            move_levels,
            [(air, worker, self.workers, self.y_first, *coefficients) for worker in range(self.workers)],
        )
        # the limiter makes the order of the axes matter a little: take turns
        self.y_first = not self.y_first

    def _share(self, work: Callable[..., None], portions: Sequence[tuple[object, ...]]) -> None:
        """Do the portions of a compiled loop side by side; they touch different parts of the air."""
        assert self.pool is not None
        for task in [self.pool.submit(work, *portion) for portion in portions]:
            task.result()

    def state(self, time: float) -> State:
        """A copy of the air at `time` [s]."""
        temperature = self.now[: self.levels].reshape(self.grid.shape).copy()
        lowest = float(np.min(temperature))
        if not lowest > 0:
            raise InputError(
                f"the air cools below 0 K before {time:g} s",
                key="ground.heat_flux",
                remedy="a lasting negative flux takes more heat than the air can give",
            )
        below = np.empty(temperature[0].size)
        self.ground.fill(below, time)
        skin = self.columns.skin(temperature[0].ravel(), below, time)
        return State(time, temperature, skin.reshape(self.grid.shape[1:]))


def processors() -> int:
    """Processors that this process may use."""
    # what this process may use, where the system tells
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _rounded(step: float) -> float:
    """The step without its last digits, so that equal steps share their coefficients."""
    return float(f"{step:.14g}")


def top_temperature(grid: Grid, initial: np.ndarray) -> float:
    """Mean temperature at the top of the box, on the line through the two highest levels."""
    highest = float(np.mean(initial[-1]))
    if grid.shape[0] == 1:
        return highest
    slope = (highest - float(np.mean(initial[-2]))) / (grid.z[-1] - grid.z[-2])
    return float(highest + slope * (grid.z_edges[-1] - grid.z[-1]))
