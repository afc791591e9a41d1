"""What a flow cannot do on its mesh, said before hours are spent on it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Final

import numpy as np

from nigemizu.errors import InputError, NigemizuWarning
from nigemizu.heat.boundary import ExchangeGround, FluxGround, GroundBoundary, HeldGround
from nigemizu.heat.flow.ground import FREE
from nigemizu.heat.flow.settings import Convection
from nigemizu.heat.flow.sources import SPECIFIC_HEAT, Source, air_density, require_inside
from nigemizu.heat.grid import Grid
from nigemizu.heat.transport import Wind

__all__ = ["require_resolved"]

_FEWEST: Final = 4  # cells across, of a flow that has three dimensions
_NARROW: Final = 2.0  # heights, that a box ought to be wide
_LAMINAR: Final = 200.0  # cell Reynolds number without a closure: beyond it the flow is noise
_THIN: Final = 0.5  # of the heat flux that free convection carries, which the lowest cell must conduct
_SPEED: Final = 4e6  # cell updates a second, on two cores
_LEAST: Final = 4e-3  # s, of a step however small the mesh
_HOURS: Final = 2.0


def require_resolved(
    grid: Grid,
    convection: Convection,
    ground: GroundBoundary,
    wind: Wind,
    temperature: np.ndarray,
    diffusivity: float,
    duration: float,
    sources: Sequence[Source] = (),
) -> None:
    r"""Refuse, or warn of, a flow that its mesh cannot hold.

    Parameters
    ----------
    grid : Grid
    convection, ground, wind
    temperature : (nz,) float64, K
        Horizontal mean at the beginning.
    diffusivity : float, m2 s-1
        Molecular, of heat.
    duration : float, s
    sources : sequence of Source

    Raises
    ------
    InputError
        For two or three cells across, a box that is narrower than high, cells too coarse for a flow without a
        closure, and sources that the mesh cannot hold.

    Warns
    -----
    NigemizuWarning
        For a box that is not twice as wide as high, a smooth ground below cells too thick to conduct its
        heat, and runs of many hours.

    Notes
    -----
    The speed of free fall :math:`U = \sqrt{g H \Delta T/T}`, or :math:`(g H F/T)^{1/3}` over a given flux F
    of temperature, and that of the wind, give the cell Reynolds number U Δ/ν and the length of the steps.
    So do sources of the width L: :math:`\sqrt{F/(\rho L^2)}` and :math:`(g P/(\rho c_p T L))^{1/3}`. Their
    plumes are a quarter as wide as they are high: without warm ground the width of the box is not looked at.
    """
    require_inside(grid, sources)
    _, ny, nx = grid.shape
    height = float(grid.z_edges[-1] - grid.z_edges[0])
    widths = {"x": (nx, grid.horizontal_step("x")), "y": (ny, grid.horizontal_step("y"))}
    mean = float(np.mean(temperature))
    excess = _excess(ground, temperature)
    flux = max(ground.heat_flux.bounds()[1], 0.0) if isinstance(ground, FluxGround) else 0.0
    fills = not sources or excess > 0 or flux > 0
    for axis, (count, width) in widths.items():
        _require_room(axis, count, count * width, height if fills else 0.0)
    lift = convection.gravity / mean
    if isinstance(ground, FluxGround):
        fall = (lift * height * flux / ground.heat_capacity) ** (1 / 3)
    else:
        fall = math.sqrt(lift * height * max(excess, 0.0))
    released = max((_speed(source, mean, lift) for source in sources), default=0.0)
    blowing = max(float(np.max(np.hypot(*wind.velocity(grid.z)))), released)
    speed = fall + blowing
    coarse = max(width for count, width in widths.values() if count > 1 or count == max(nx, ny))
    if convection.closure == "none":
        _require_laminar(speed, max(coarse, float(np.max(grid.z_widths))), convection.viscosity)
    if convection.ground == "smooth" and not isinstance(ground, FluxGround) and excess > 0:
        _warn_of_thick_cells(grid, convection, lift, excess, diffusivity)
    _warn_of_hours(grid, convection, speed, fall, duration)


def _require_room(axis: str, count: int, width: float, height: float) -> None:
    if 1 < count < _FEWEST:
        raise InputError(
            f"so few cells along {axis} hold no eddies",
            key="grid.cells",
            value=count,
            expected=f"1, for a flow in two dimensions, or {_FEWEST} and more",
        )
    if count == 1:
        return
    if width < height:
        raise InputError(
            "the box is too small for its eddies, which become as wide as it is high",
            key=f"grid.{axis}",
            value=f"{width:g} m",
            expected=f"{height:g} m (grid.height) at least, better twice that",
        )
    if width < _NARROW * height:
        warnings.warn(
            f"grid.{axis} is {width:g} m wide, and eddies become as wide as the box is high ({height:g} m); "
            f"{_NARROW * height:g} m leave them room",
            NigemizuWarning,
            stacklevel=5,
        )


def _excess(ground: GroundBoundary, temperature: np.ndarray) -> float:
    """By how much the ground is warmer than the air above it [K], at most."""
    if isinstance(ground, HeldGround | ExchangeGround):
        return float(ground.temperature.bounds()[1] - np.min(temperature))
    return 0.0


def _speed(source: Source, temperature: float, lift: float) -> float:
    """Of the air in a source, about [m/s]."""
    rho, width = air_density(temperature), math.prod(source.size) ** (1 / 3)
    rising = lift * abs(source.power) / (rho * SPECIFIC_HEAT * width)
    return math.sqrt(source.thrust / rho) / width + math.cbrt(rising)


def _require_laminar(speed: float, cell: float, viscosity: float) -> None:
    reynolds = math.inf if viscosity == 0 else speed * cell / viscosity
    if speed > 0 and reynolds > _LAMINAR:
        raise InputError(
            f"the cells are too coarse for a flow without a closure: cell Reynolds number {reynolds:.3g}",
            key="convection.closure",
            value="none",
            expected=f"{_LAMINAR:g} at most (speed {speed:.2g} m/s, cells of {cell:g} m)",
            remedy='choose closure = "vreman", or finer cells',
        )


def _warn_of_thick_cells(
    grid: Grid, convection: Convection, lift: float, excess: float, diffusivity: float
) -> None:
    carried = FREE * (lift * excess * diffusivity**2 / max(convection.viscosity, 1e-12)) ** (1 / 3)
    conducted = diffusivity / (0.5 * float(grid.z_widths[0]))
    if conducted < _THIN * carried:
        warnings.warn(
            f"the lowest cell, {grid.z_widths[0]:g} m high, conducts {conducted / carried:.0%} of the heat "
            f"that a smooth ground gives; make grid.first_cell {2 * diffusivity / carried:.2g} m, or "
            'choose convection.ground = "rough"',
            NigemizuWarning,
            stacklevel=5,
        )


def _warn_of_hours(grid: Grid, convection: Convection, speed: float, fall: float, duration: float) -> None:
    rate = speed * (1 / grid.horizontal_step("x") + (grid.shape[1] > 1) / grid.horizontal_step("y"))
    rate += fall / float(np.median(grid.z_widths))
    steps = duration * rate / convection.courant
    hours = steps * max(math.prod(grid.shape) / _SPEED, _LEAST) / 3600
    if hours > _HOURS:
        warnings.warn(
            f"this flow takes about {steps:,.0f} steps, {hours:.1f} hours on two cores; fewer cells "
            "(grid.cells) or a shorter time.duration take less",
            NigemizuWarning,
            stacklevel=5,
        )
