r"""What changes velocity and temperature, for every cell at once.

Momentum, heat and eddies as in `nigemizu.heat.flow.momentum` and `nigemizu.heat.flow.kernels`, which say
where they come from. There the three components are written out for the processor's caches; here one formula
serves them all. The momentum :math:`q` along the axis a is carried along the axis b by the velocity p,
through a face (a = b: through the middle of a cell):

.. math:: F_{ab} = \bar p^a\, \bar q^b - \bar\nu^{ab} (\delta_b q + \delta_a p)

with means of two neighbours (four, of ν) and differences over the distance.
"""

from __future__ import annotations

from typing import Any, NamedTuple, final

import drjit as dr

from nigemizu.heat.flow.device.lattice import Lattice, Offset, X, Y, Z, ahead, behind

__all__ = ["Air", "HeatLaw", "eddy_viscosity", "fastest", "heat_change", "momentum_change", "outflow"]

_AXES = (X, Y, Z)


@final
class Air(NamedTuple):
    """Padded fields: u, v, w [m/s], the warmth [K], and the viscosity [m2/s]."""

    velocity: tuple[Any, Any, Any]
    warmth: Any
    nu: Any


@final
class HeatLaw(NamedTuple):
    """Molecular diffusivity and viscosity [m2/s], 1 / turbulent Prandtl number, and whether what the air
    carries is limited."""

    kappa: float
    molecular: float
    rprt: float
    limited: bool


def momentum_change(
    cells: Lattice, air: Air, axis: int, low: Any, high: Any, lift: Any = 0.0, zero: Any = 0.0
) -> Any:
    """∂q/∂t of the velocity along an axis but for the pressure; `low`, `high`: fluxes through ground and top
    of every column. Of w: with buoyancy, and only above the ground."""
    total = cells.types.Float(0)
    for along in _AXES:
        if along == axis:
            there, here = (
                _through_middle(cells, air, axis, (0, 0, 0)),
                _through_middle(cells, air, axis, behind(axis)),
            )
            width = cells.between(axis)
        else:
            there, here = (_through_face(cells, air, axis, along, at) for at in (ahead(along), (0, 0, 0)))
            width = cells.across(along)
            if along == Z:
                there, here = _bounded(cells, there, here, low, high)
        total -= (there - here) * width
    if axis == Z:
        below, above = cells.shares()
        # linear between the centres: each counts as the other's cell is high
        warm = above * cells.at(air.warmth, behind(Z)) + below * cells.at(air.warmth)
        total += lift * (warm - zero)
    return total


def _through_face(cells: Lattice, air: Air, axis: int, along: int, at: Offset) -> Any:
    carrier, carried = air.velocity[along], air.velocity[axis]
    back = behind(axis, at)
    low, high = cells.shares() if axis == Z else (0.5, 0.5)
    speed = low * cells.at(carrier, back) + high * cells.at(carrier, at)
    before, after = cells.at(carried, behind(along, at)), cells.at(carried, at)
    nu = cells.at(air.nu, at) + cells.at(air.nu, back)
    nu += cells.at(air.nu, behind(along, at)) + cells.at(air.nu, behind(along, back))
    shear = (after - before) * cells.between(along, at)
    shear += (cells.at(carrier, at) - cells.at(carrier, back)) * cells.between(axis, at)
    return speed * 0.5 * (before + after) - 0.25 * nu * shear


def _through_middle(cells: Lattice, air: Air, axis: int, at: Offset) -> Any:
    before, after = cells.at(air.velocity[axis], at), cells.at(air.velocity[axis], ahead(axis, at))
    stretch = (after - before) * cells.across(axis, at)
    return 0.25 * dr.square(before + after) - 2.0 * cells.at(air.nu, at) * stretch


def _bounded(cells: Lattice, there: Any, here: Any, low: Any, high: Any) -> tuple[Any, Any]:
    """Fluxes upwards through a cell, those through ground and top as they are given."""
    Float = cells.types.Float
    through_top = dr.gather(Float, high, cells.column)
    through_ground = dr.gather(Float, low, cells.column)
    there = dr.select(cells.k == cells.shape[0] - 1, through_top, there)
    return there, dr.select(cells.k == 0, through_ground, here)


def heat_change(cells: Lattice, air: Air, law: HeatLaw, low: Any, high: Any) -> Any:
    """∂θ/∂t; `low`, `high`: fluxes through ground and top of every column [K m/s]."""
    total = cells.types.Float(0)
    for along in _AXES:
        there, here = (_heat_flux(cells, air, law, along, at) for at in (ahead(along), (0, 0, 0)))
        if along == Z:
            there, here = _bounded(cells, there, here, low, high)
        total -= (there - here) * cells.across(along)
    return total


def _heat_flux(cells: Lattice, air: Air, law: HeatLaw, along: int, at: Offset) -> Any:
    back = behind(along, at)
    places = (behind(along, back), back, at, ahead(along, at))
    s2, s1, s0, sm = (cells.at(air.warmth, place) for place in places)
    speed = cells.at(air.velocity[along], at)
    rising = speed > 0
    up2, up, down = dr.select(rising, s2, sm), dr.select(rising, s1, s0), dr.select(rising, s0, s1)
    nu = 0.5 * (cells.at(air.nu, back) + cells.at(air.nu, at))
    conductance = (law.kappa + (nu - law.molecular) * law.rprt) * cells.between(along, at)
    return speed * _carried(up2, up, down, law.limited) - conductance * (s0 - s1)


def _carried(up2: Any, up: Any, down: Any, limited: bool) -> Any:
    forward, backward = down - up, up - up2
    if not limited:
        return up + 0.5 * forward
    p, q = dr.abs(forward), dr.abs(backward)
    step = dr.minimum(2.0 * p, dr.minimum((q + 2.0 * p) / 3.0, 2.0 * q))
    return up + dr.select(forward * backward <= 0, 0.0, dr.copysign(0.5 * step, forward))


def outflow(cells: Lattice, velocity: tuple[Any, Any, Any]) -> Any:
    """Divergence of the velocity [1/s]."""
    return sum(
        (cells.at(velocity[axis], ahead(axis)) - cells.at(velocity[axis])) * cells.across(axis)
        for axis in _AXES
    )


def eddy_viscosity(cells: Lattice, velocity: tuple[Any, Any, Any], molecular: float, constant: float) -> Any:
    """Viscosity at the centres with the eddies of Vreman."""
    a = [[_gradient(cells, velocity[of], of, along) for of in _AXES] for along in _AXES]
    squares = (1 / cells.metric.rdx**2, 1 / cells.metric.rdy**2, dr.square(cells.of_level(cells.dz)))
    b = [[sum(squares[m] * a[m][i] * a[m][j] for m in _AXES) for j in _AXES] for i in _AXES]
    minors = sum(b[i][i] * b[j][j] - dr.square(b[i][j]) for i, j in ((X, Y), (X, Z), (Y, Z)))
    size = sum(dr.square(a[i][j]) for i in _AXES for j in _AXES)
    moves = (minors > 0) & (size > 1e-30)
    return molecular + dr.select(moves, constant * dr.sqrt(minors / dr.select(moves, size, 1.0)), 0.0)


def _gradient(cells: Lattice, field: Any, of: int, along: int) -> Any:
    """∂u_of/∂x_along at the centre."""
    if of == along:
        return (cells.at(field, ahead(of)) - cells.at(field)) * cells.across(of)
    step = 0.25 * cells.across(along) if along != Z else _over_three(cells)
    up, down = ahead(along), behind(along)
    after = cells.at(field, up) + cells.at(field, ahead(of, up))
    return step * (after - cells.at(field, down) - cells.at(field, ahead(of, down)))


def _over_three(cells: Lattice) -> Any:
    """Half of 1 / distance between the centres of the cells below and above."""
    below, here, above = (cells.of_level(cells.dz, offset) for offset in (-1, 0, 1))
    return 0.5 / (0.5 * below + here + 0.5 * above)


def fastest(cells: Lattice, air: Air, largest: float, upwards: bool) -> tuple[Any, Any, Any]:
    """Rates of crossing cells and of diffusion across them [1/s], and |∂θ/∂z| [K/m], of every cell; arguments
    as of `nigemizu.heat.flow.kernels.fastest`."""
    crossing = sum(
        dr.maximum(dr.abs(cells.at(field)), dr.abs(cells.at(field, ahead(axis)))) * cells.across(axis)
        for axis, field in enumerate(air.velocity)
    )
    room = 4.0 * (cells.metric.rdx**2 + cells.metric.rdy**2) * largest
    if upwards:
        closest = dr.maximum(cells.between(Z), cells.between(Z, ahead(Z)))
        room += 4.0 * largest * closest * cells.across(Z)
    rise = dr.abs(cells.at(air.warmth) - cells.at(air.warmth, behind(Z))) * cells.between(Z)
    return crossing, cells.at(air.nu) * room, rise
