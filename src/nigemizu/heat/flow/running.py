"""Moving air from instant to instant: its own steps, its beginning, and checkpoints."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from nigemizu.errors import InputError, NigemizuError
from nigemizu.heat.boundary import GroundBoundary, Sides, Top
from nigemizu.heat.flow.checkpoint import Checkpoints
from nigemizu.heat.flow.moving import MovingAir
from nigemizu.heat.flow.settings import VOLUMES, Convection
from nigemizu.heat.flow.sources import Source
from nigemizu.heat.grid import Grid, require_memory
from nigemizu.heat.solver import check_temperature, check_times
from nigemizu.heat.stepping import State
from nigemizu.heat.transport import Diffusivity, Wind
from nigemizu.memory import available_memory
from nigemizu.progress import SILENT, ProgressMeter

__all__ = ["DivergedError", "convect"]

_TICKS: Final = 1000
_SLOWEST: Final = 1e-3  # of the longest step that the beginning bears: less is a flow that blows up
_FASTEST: Final = 300.0  # m/s; the air is taken as incompressible


class DivergedError(NigemizuError):
    """The flow has blown up."""


def convect(
    grid: Grid,
    temperature: np.ndarray,
    *,
    ground: GroundBoundary,
    times: Sequence[float],
    convection: Convection | None = None,
    sides: Sides | None = None,
    top: Top | None = None,
    diffusivity: Diffusivity | None = None,
    wind: Wind | None = None,
    sources: Sequence[Source] = (),
    time_step: float | None = None,
    checkpoints: Checkpoints | None = None,
    first: int = 0,
    arrays: Any = None,
    progress: ProgressMeter = SILENT,
    available: Callable[[], int | None] = available_memory,
) -> Iterator[State]:
    """Let the air flow and give its temperature and wind at the wanted times, one after another.

    Parameters
    ----------
    grid : Grid
        Cells of equal width along x and y.
    temperature : (nz, ny, nx) float64, K
        At the beginning; not changed. The disturbance of `convection` is added.
    ground, sides, top
        Of the heat, as for `nigemizu.heat.evolve`; insulated sides are walls.
    times : sequence of float, s
        Increasing, from 0 on; met exactly.
    convection : Convection
    diffusivity : Diffusivity
        Its molecular part; eddies are the flow's own.
    wind : Wind
        At the beginning; its mean over the height is kept up.
    sources : sequence of Source
        What is heated or pushed inside the air.
    time_step : float, s, optional
        Longest step; shorter ones follow from the flow.
    checkpoints : Checkpoints, optional
        Where the flow is kept from time to time, and taken up from.
    first : int
        Number of the first of the times that is given out; those before it are passed.
    arrays : nigemizu.field.Types, optional
        Double-precision array types of a device that moves the air; by default the processor does.
    progress : ProgressMeter
        Told of the simulated time.
    available : callable
        Bytes of memory at hand, or None.

    Yields
    ------
    State
        With `wind`, the velocity at the centres.

    Raises
    ------
    InputError
        For what cannot be simulated.
    DivergedError
        When velocities are no longer finite, or need steps that lead nowhere; it names the last checkpoint.
    """
    convection, sides, top = convection or Convection(), sides or Sides(), top or Top()
    diffusivity, wind = diffusivity or Diffusivity(), wind or Wind()
    if diffusivity.kind != "molecular":
        raise InputError(
            "moving air makes its own eddies",
            key="diffusivity.kind",
            value=diffusivity.kind,
            expected="molecular",
            remedy='choose the eddies that cells cannot hold by convection.closure, or process = "diffusion"',
        )
    instants = check_times(times, 0.0)
    require_memory(math.prod(grid.shape), available=available, volumes=VOLUMES)
    initial = check_temperature(grid, temperature)
    air = MovingAir(
        grid, convection, ground, sides, top, diffusivity.molecular, sources=sources, arrays=arrays
    )
    mean_wind = _mean_wind(grid, wind, air.walls)
    with air:
        if checkpoints is None or not checkpoints.take_up(air, instants[first]):
            _begin(air, initial, wind)
        run = _Run(air, mean_wind, time_step or math.inf, checkpoints)
        yield from _march(run, instants, first, progress)


@final
@dataclass
class _Run:
    """What marches: the air, what keeps its wind up, and who keeps checkpoints."""

    air: MovingAir
    mean_wind: tuple[float | None, float | None]
    longest: float
    keeper: Checkpoints | None


def _march(run: _Run, instants: list[float], first: int, progress: ProgressMeter) -> Iterator[State]:
    air, end = run.air, instants[-1]
    start = air.time
    progress.start("convection", _TICKS)
    told = 0
    try:
        for number, instant in enumerate(instants):
            if instant < start:  # before the checkpoint that was taken up
                continue
            for _ in _steps_to(run, instant):
                done = int(_TICKS * (air.time - start) / max(end - start, 1e-300))
                progress.advance(done - told)
                told = done
            air.time = instant
            if number >= first:
                yield State(instant, air.temperature, air.skin_at(instant), air.wind)
        progress.advance(_TICKS - told)
    finally:
        progress.finish()


def _steps_to(run: _Run, instant: float) -> Iterator[None]:
    air = run.air
    first = 0.0
    while air.time < instant * (1 - 1e-12):
        bearable = air.longest_step()
        first = first or min(bearable, instant, air.first_step())
        if not bearable > _SLOWEST * min(first, run.longest) or math.isnan(bearable):
            raise _diverged(run)
        left = instant - air.time
        step = min(bearable, run.longest)
        # the last steps before an instant are of equal length
        step = left / math.ceil(left / step * (1 - 1e-12))
        air.advance(step, run.mean_wind)
        if run.keeper is not None and run.keeper.due(air.time):
            if not _is_sound(air):
                raise _diverged(run)
            run.keeper.write(air)
        yield
    if not _is_sound(air):
        raise _diverged(run)


def _is_sound(air: MovingAir) -> bool:
    *velocity, warmth = air.cells.fields
    fastest = max(float(np.max(np.abs(field))) for field in velocity)
    return fastest < _FASTEST and bool(np.isfinite(np.max(np.abs(warmth))))


def _diverged(run: _Run) -> DivergedError:
    left = ""
    if run.keeper is not None and run.keeper.last is not None:
        left = f"; its last sound state, at {run.keeper.last:g} s, is kept in {run.keeper.folder}"
    return DivergedError(
        f"the flow has blown up at {run.air.time:g} s{left}; make convection.courant or time.step smaller, "
        'or the cells, or use convection.closure = "vreman"'
    )


def _mean_wind(grid: Grid, wind: Wind, walls: tuple[bool, bool]) -> tuple[float | None, float | None]:
    """Means over the height that are kept up; None where walls stand in the way."""
    if wind.is_calm:
        return None, None
    means = [float(speed @ grid.z_widths / np.sum(grid.z_widths)) for speed in wind.velocity(grid.z)]
    for axis, mean, wall in zip("xy", means, walls, strict=True):
        if wall and abs(mean) > 1e-12:
            raise InputError(
                "no wind blows through a wall",
                key=f"sides.{axis}",
                value="insulated",
                expected="periodic, with this wind",
            )
    x, y = (None if wall else mean for mean, wall in zip(means, walls, strict=True))
    return x, y


def _begin(air: MovingAir, initial: np.ndarray, wind: Wind) -> None:
    random = np.random.default_rng(np.random.SeedSequence([air.flow.seed, 0xC0]))
    disturbed = initial + air.flow.noise * random.standard_normal(initial.shape)
    u, v = (np.broadcast_to(speed[:, None, None], air.grid.shape) for speed in wind.velocity(air.grid.z))
    air.set(disturbed, (u, v, np.zeros(air.grid.shape)))
