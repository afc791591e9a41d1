"""The heat equation in moving air: from the initial temperature to that at every wanted instant."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from nigemizu.errors import InputError
from nigemizu.heat.boundary import ExchangeGround, GroundBoundary, Sides, Top
from nigemizu.heat.grid import Grid, require_memory
from nigemizu.heat.stepping import State, Stepper, ground_quantity
from nigemizu.heat.transport import Diffusivity, Wind
from nigemizu.memory import available_memory
from nigemizu.progress import SILENT, ProgressMeter

if TYPE_CHECKING:
    import xarray

__all__ = ["State", "check_temperature", "check_times", "choose_time_step", "evolve", "solve"]

COURANT: Final = 2.0
"""Cells that the wind crosses in an automatic step: bounds the error of splitting, not stability."""

SPREADING: Final = 4.0
"""Horizontal diffusivity × step / cell² of an automatic step, where the diffusivity varies with height."""

FOLLOWING: Final = 8
"""Automatic steps in the time that follows a coefficient of exchange, which a step takes as constant."""


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

    - vertical diffusion by the exponential of its matrix (`nigemizu.heat.vertical`), with a coefficient of
      exchange as at the middle of the step, by levels where it has many values (`nigemizu.heat.columns`),
    - horizontal diffusion by the discrete heat kernel (`nigemizu.heat.horizontal`),
    - transport by whole cells and a limited fifth-order flux for the rest (`nigemizu.heat.kernels`).

    Every part is a mean with non-negative weights, or limited so that no new extrema arise: for any step,
    each value lies between those in the air and at its walls (a flux excepted). Heat is conserved to
    round-off between insulated or periodic walls; a flux adds exactly its integral, taken linear in each
    step. Second order in step and cell where the temperature is smooth; the transport alone has order 2.5 in
    the mean error (5 away from extrema, where nothing is clipped).

    Limits: no buoyancy, no radiation, no vertical wind. Schedules are linear within a step; a coefficient of
    exchange is constant within it, so that cells next to the ground that relax faster than a step lag behind
    by half a step. A ground pattern is as sharp as the cells. The limiter flattens peaks narrower than about
    four cells.

    References
    ----------
    G. Strang, SIAM J. Numer. Anal. 5, 506-517 (1968), doi:10.1137/0705041.
    B. P. Leonard, Comput. Methods Appl. Mech. Eng. 88, 17-74 (1991), doi:10.1016/0045-7825(91)90232-U.
    """
    top, sides = top or Top(), sides or Sides()
    diffusivity, wind = diffusivity or Diffusivity(), wind or Wind()
    instants = check_times(times, start)
    if time_step is not None and not (time_step > 0 and math.isfinite(time_step)):
        raise InputError("the time step must be above zero", key="time.step", value=time_step)
    require_memory(math.prod(grid.shape), available=available)
    initial = check_temperature(grid, temperature)
    longest = time_step or choose_time_step(grid, ground, diffusivity, wind)
    stepper = Stepper(grid, initial, ground, top, diffusivity, wind, sides)
    return _march(stepper, instants, start, longest, progress)


def _march(
    stepper: Stepper, instants: list[float], start: float, longest: float, progress: ProgressMeter
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
    limit = ground_quantity(ground).finest()
    if isinstance(ground, ExchangeGround):
        limit = min(limit, ground.coefficient.finest() / FOLLOWING)
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


def _steps(interval: float, longest: float) -> int:
    """Number of equal steps in an interval; none in an empty one."""
    return 0 if interval == 0 else max(1, math.ceil(interval / longest * (1 - 1e-12)))


def check_times(times: Sequence[float], start: float) -> list[float]:
    """The wanted instants [s], refused unless they increase from `start` on."""
    instants = [float(time) for time in times]
    if not instants:
        raise InputError("no times are wanted", key="times")
    if not all(map(math.isfinite, [start, *instants])):
        raise InputError("times must be finite", key="times", value=instants)
    if instants[0] < start or any(b <= a for a, b in itertools.pairwise(instants)):
        raise InputError(f"times must increase from {start:g} s on", key="times", value=instants)
    return instants


def check_temperature(grid: Grid, temperature: np.ndarray) -> np.ndarray:
    """The temperature [K] as float64, refused unless it fits the grid and is above zero everywhere."""
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
