"""The heat equation in moving air: from the initial temperature to that at every wanted instant."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import numpy as np

from nigemizu.errors import InputError
from nigemizu.heat.boundary import ExchangeGround, FluxGround, GroundBoundary, HeldGround, Sides, Top
from nigemizu.heat.grid import Grid, available_memory, require_memory
from nigemizu.heat.horizontal import HorizontalMotion
from nigemizu.heat.kernels import move_levels, spread_columns
from nigemizu.heat.quantity import Quantity
from nigemizu.heat.transport import Diffusivity, Wind
from nigemizu.heat.vertical import BOUNDARY_ROWS, VerticalDiffusion
from nigemizu.progress import SILENT, ProgressMeter

if TYPE_CHECKING:
    import xarray

__all__ = ["State", "choose_time_step", "evolve", "solve"]

COURANT: Final = 2.0
"""Cells that the wind crosses in an automatic step: bounds the error of splitting, not stability."""

SPREADING: Final = 4.0
"""Horizontal diffusivity × step / cell² of an automatic step, where the diffusivity varies with height."""


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
    """

    time: float
    temperature: np.ndarray
    surface_temperature: np.ndarray


def evolve(
    grid: Grid,
    temperature: np.ndarray,
    *,
    ground: GroundBoundary,
    times: Sequence[float],
    sides: Sides | None = None,
    top: Top | None = None,
    diffusivity: Diffusivity | None = None,
    wind: Wind | None = None,
    start: float = 0.0,
    time_step: float | None = None,
    progress: ProgressMeter = SILENT,
    available: Callable[[], int | None] = available_memory,
) -> Iterator[State]:
    r"""Advance the temperature and give it at the wanted times, one after another.

    Parameters
    ----------
    grid : Grid
    temperature : (nz, ny, nx) float64, K
        At `start`; not changed.
    ground, sides, top, diffusivity, wind
        Values of this package; periodic sides, a held top, molecular diffusivity and calm air unless given.
    times : sequence of float, s
        Increasing, not before `start`; met exactly.
    start : float, s
        Time of the initial temperature.
    time_step : float, s, optional
        Longest step. Left out, it is the interval between the wanted times, shortened so that the wind
        crosses at most two cells per step, diffusivities that vary with height spread over at most four
        cells squared, and the course of the ground's quantity is followed.
    progress : ProgressMeter
        Told every step.
    available : callable
        Bytes of memory at hand, or None if unknown.

    Yields
    ------
    State
        With arrays of its own.

    Raises
    ------
    InputError
        For a temperature that does not fit the grid or is not above zero kelvin, times that do not
        increase, a volume beyond the memory, cells of unequal width along x or y, and air that a negative
        flux has cooled below zero.

    Notes
    -----
    .. math:: \partial_t T + u \partial_x T + v \partial_y T = \partial_x (K_x \partial_x T)
              + \partial_y (K_y \partial_y T) + \partial_z (K_z \partial_z T)

    with winds and diffusivities that depend on height. Finite volumes; Strang's splitting into the horizontal
    motion of every level and the vertical diffusion of every column, each of them without further error
    in time:

    - vertical diffusion by the exponential of its matrix (`nigemizu.heat.vertical`),
    - horizontal diffusion by the discrete heat kernel (`nigemizu.heat.horizontal`),
    - transport by whole cells and a limited fifth-order flux for the rest (`nigemizu.heat.kernels`).

    Every part is a mean with non-negative weights, or limited so that no new extrema arise: for any step,
    each value lies between those in the air and at its walls (a flux excepted). Heat is conserved to
    round-off between insulated or periodic walls; a flux adds exactly its integral, taken linear in each
    step. Second order in step and cell where the temperature is smooth; the transport alone has order 2.5 in
    the mean error (5 away from extrema, where nothing is clipped).

    Limits: no buoyancy, no radiation, no vertical wind. Schedules are linear within a step. A ground pattern
    is as sharp as the cells. The limiter flattens peaks narrower than about four cells.

    References
    ----------
    G. Strang, SIAM J. Numer. Anal. 5, 506-517 (1968), doi:10.1137/0705041.
    B. P. Leonard, Comput. Methods Appl. Mech. Eng. 88, 17-74 (1991), doi:10.1016/0045-7825(91)90232-U.
    """
    top, sides = top or Top(), sides or Sides()
    diffusivity, wind = diffusivity or Diffusivity(), wind or Wind()
    instants = _check_times(times, start)
    if time_step is not None and not (time_step > 0 and math.isfinite(time_step)):
        raise InputError("the time step must be above zero", key="time.step", value=time_step)
    require_memory(math.prod(grid.shape), available=available)
    initial = _check_temperature(grid, temperature)
    longest = time_step or choose_time_step(grid, ground, diffusivity, wind)
    column = VerticalDiffusion.build(grid, diffusivity, ground, top)
    stepper = _Stepper(grid, initial, column, _Ground(grid, ground), top, diffusivity, wind, sides)
    return _march(stepper, instants, start, longest, progress)


def _march(
    stepper: _Stepper, instants: list[float], start: float, longest: float, progress: ProgressMeter
) -> Iterator[State]:
    intervals = np.diff([start, *instants])
    counts = [_steps(float(interval), longest) for interval in intervals]
    progress.start("heat", sum(counts))
    time = start
    try:
        with stepper:
            for instant, count in zip(instants, counts, strict=True):
                step = (instant - time) / max(count, 1)
                for number in range(count):
                    final = number + 1 == count
                    begin, end = time + number * step, instant if final else time + (number + 1) * step
                    stepper.advance(begin, end, opens=number == 0, closes=final)
                    progress.advance()
                time = instant
                yield stepper.state(time)
    finally:
        progress.finish()


def choose_time_step(grid: Grid, ground: GroundBoundary, diffusivity: Diffusivity, wind: Wind) -> float:
    """The longest step [s] that keeps the errors of splitting and of the ground's course small.

    Infinite when nothing but the wanted times limits it.
    """
    heights = grid.z - grid.z_edges[0]
    limit = _numbers(ground).finest()
    speeds, spreads = wind.velocity(heights), diffusivity.sideways(heights)
    for axis, count, speed, spread in zip("xy", grid.shape[:0:-1], speeds, spreads, strict=True):
        if count == 1:
            continue
        step, fastest = grid.horizontal_step(axis), float(np.max(np.abs(speed)))
        if fastest > 0:
            limit = min(limit, COURANT * step / fastest)
        if np.ptp(spread) > 0:
            limit = min(limit, SPREADING * step**2 / float(np.max(spread)))
    return limit


def solve(
    grid: Grid,
    temperature: np.ndarray,
    *,
    ground: GroundBoundary,
    times: Sequence[float],
    sides: Sides | None = None,
    top: Top | None = None,
    diffusivity: Diffusivity | None = None,
    wind: Wind | None = None,
    start: float = 0.0,
    time_step: float | None = None,
    progress: ProgressMeter = SILENT,
    available: Callable[[], int | None] = available_memory,
) -> xarray.Dataset:
    """The temperature at the wanted times as one dataset; see `evolve` for the parameters.

    Returns
    -------
    xarray.Dataset
        `air_temperature` (time, z, y, x) and `surface_temperature` (time, y, x), K, as
        `nigemizu.heat.to_dataset` makes it of the states.
    """
    from nigemizu.heat.dataset import to_dataset

    require_memory(math.prod(grid.shape) * (1 + len(times)), available=available, volumes=3)
    states = evolve(
        grid,
        temperature,
        ground=ground,
        times=times,
        sides=sides,
        top=top,
        diffusivity=diffusivity,
        wind=wind,
        start=start,
        time_step=time_step,
        progress=progress,
        available=available,
    )
    return to_dataset(grid, states)


class _Ground:
    """The ground's number over the cells, split into what varies in time and what varies in place."""

    def __init__(self, grid: Grid, ground: GroundBoundary) -> None:
        self.quantity = _numbers(ground)
        self.factor, self.summand = self.quantity.planes(grid)

    def fill(self, plane: np.ndarray, time: float) -> None:
        """Write the numbers at `time` into a plane of ny × nx cells in a row."""
        np.multiply(self.factor.ravel(), self.quantity.at_time(time), out=plane)
        plane += self.summand.ravel()


def _numbers(ground: GroundBoundary) -> Quantity:
    match ground:
        case HeldGround() | ExchangeGround():
            return ground.temperature
        case FluxGround():
            return ground.heat_flux


class _Stepper:
    """The two volumes, and the coefficients of every step length that was needed so far."""

    def __init__(
        self,
        grid: Grid,
        initial: np.ndarray,
        column: VerticalDiffusion,
        ground: _Ground,
        top: Top,
        diffusivity: Diffusivity,
        wind: Wind,
        sides: Sides,
    ) -> None:
        self.grid, self.column, self.ground = grid, column, ground
        self.diffusivity, self.wind, self.sides = diffusivity, wind, sides
        self.levels = grid.shape[0]
        # the levels as rows, followed by the ground's number before and after the step and by the top's
        self.now = np.empty((self.levels + BOUNDARY_ROWS, math.prod(grid.shape[1:])))
        self.next = np.empty_like(self.now)
        self.now[: self.levels] = initial.reshape(self.levels, -1)
        held = _top_temperature(grid, initial) if top.temperature is None else top.temperature
        self.now[-1] = self.next[-1] = held
        self.columns: dict[float, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self.motions: dict[float, HorizontalMotion] = {}
        self.y_first = False
        self.workers = _processors()
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
        if step not in self.columns:
            matrix = self.column.step(step)
            self.columns[step] = (matrix, *self.column.reach(matrix))
        self.ground.fill(self.now[self.levels], time)
        self.ground.fill(self.now[self.levels + 1], end)
        corners = np.linspace(0, self.now.shape[1], self.workers + 1).astype(np.int64)
        self._share(
            spread_columns,
            [
                (*self.columns[step], self.now, self.next, first, last)
                for first, last in itertools.pairwise(corners)
            ],
        )
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
        skin = np.empty(temperature[0].size)
        self.ground.fill(skin, time)
        skin *= self.column.skin_ground
        skin += self.column.skin_air * temperature[0].ravel()
        return State(time, temperature, skin.reshape(self.grid.shape[1:]))


def _processors() -> int:
    # what this process may use, where the system tells
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _steps(interval: float, longest: float) -> int:
    """Number of equal steps in an interval; none in an empty one."""
    return 0 if interval == 0 else max(1, math.ceil(interval / longest * (1 - 1e-12)))


def _rounded(step: float) -> float:
    """The step without its last digits, so that equal steps share their coefficients."""
    return float(f"{step:.14g}")


def _top_temperature(grid: Grid, initial: np.ndarray) -> float:
    """Mean temperature at the top of the box, on the line through the two highest levels."""
    highest = float(np.mean(initial[-1]))
    if grid.shape[0] == 1:
        return highest
    slope = (highest - float(np.mean(initial[-2]))) / (grid.z[-1] - grid.z[-2])
    return float(highest + slope * (grid.z_edges[-1] - grid.z[-1]))


def _check_times(times: Sequence[float], start: float) -> list[float]:
    instants = [float(time) for time in times]
    if not instants:
        raise InputError("no times are wanted", key="times")
    if not all(map(math.isfinite, [start, *instants])):
        raise InputError("times must be finite", key="times", value=instants)
    if instants[0] < start or any(b <= a for a, b in itertools.pairwise(instants)):
        raise InputError(f"times must increase from {start:g} s on", key="times", value=instants)
    return instants


def _check_temperature(grid: Grid, temperature: np.ndarray) -> np.ndarray:
    initial = np.asarray(temperature, dtype=np.float64)
    if initial.shape != grid.shape:
        raise InputError(
            "the temperature does not fit the grid",
            key="temperature",
            value=initial.shape,
            expected=f"the shape (nz, ny, nx) = {grid.shape}",
        )
    lowest = float(np.min(initial))  # NaN if any is
    if not lowest > 0 or not math.isfinite(float(np.max(initial))):
        raise InputError(
            "the temperature is not finite and above 0 K everywhere", key="temperature", value=lowest
        )
    return initial
