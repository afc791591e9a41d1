"""Systems of equations along columns, solved level by level, all columns at once.

Both are Thomas's elimination. What it leaves is kept in memory of the column's own; symbols as in
`nigemizu.heat.flow.softening` and `nigemizu.heat.flow.kernels.solve_columns`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, final

import drjit as dr

from nigemizu.heat.flow.device.lattice import Lattice
from nigemizu.heat.flow.padding import PAD

__all__ = ["Softness", "soften", "soften_faces", "solve_columns"]


@final
class Softness(NamedTuple):
    """The diffusivity `least` + (ν − `molecular`) · `over` [m2/s], and the conductance `wall` [m/s] of the
    ground for what it holds fast."""

    molecular: float
    over: float
    least: float
    wall: float


def soften(cells: Lattice, g: Any, b: Any, time: Any, nu: Any, softness: Softness) -> Any:
    """Increments b G of values at the height of the centres, softened; `time` is b Δt [s]."""
    Float, top = cells.types.Float, cells.shape[0] - 1
    molecular, over, least, wall = softness

    def conductances(k: Any, place: Any) -> tuple[Any, Any, Any]:
        below, here, above = (
            dr.gather(Float, nu, at) for at in (place - cells.plane, place, place + cells.plane)
        )
        over_height = time * dr.gather(Float, cells.rdz, k + PAD)
        down = dr.select(k == 0, 0, over_height * dr.gather(Float, cells.rdzf, k + PAD))
        up = dr.select(k == top, 0, over_height * dr.gather(Float, cells.rdzf, k + PAD + 1))
        lower = down * (least + (0.5 * (below + here) - molecular) * over)
        upper = up * (least + (0.5 * (here + above) - molecular) * over)
        return dr.select(k == 0, over_height * wall, 0), lower, upper

    return _softened(cells, g, b, 0, conductances)


def soften_faces(cells: Lattice, g: Any, b: Any, time: Any, nu: Any) -> Any:
    """The same of w, on lower faces: 2ν ∂w/∂z; the faces of ground and top do not move."""
    Float = cells.types.Float

    def conductances(k: Any, place: Any) -> tuple[Any, Any, Any]:
        between = 2 * time * dr.gather(Float, cells.rdzf, k + PAD)
        lower = between * dr.gather(Float, cells.rdz, k + PAD - 1) * dr.gather(Float, nu, place - cells.plane)
        upper = between * dr.gather(Float, cells.rdz, k + PAD) * dr.gather(Float, nu, place)
        return Float(0), lower, upper

    return _softened(cells, g, b, 1, conductances)


@dr.syntax
def _softened(
    cells: Lattice,
    g: Any,
    b: Any,
    lowest: int,
    conductances: Callable[[Any, Any], tuple[Any, Any, Any]],
) -> Any:
    """Solve for b G from the level `lowest` on, with the conductances of the ground, down and up."""
    Float, UInt32 = cells.types.Float, cells.types.UInt32
    nz, ny, nx = cells.shape
    softened = dr.zeros(Float, cells.count)
    column = dr.arange(UInt32, ny * nx)
    place = cells.place_of(column)
    c, d = dr.alloc_local(Float, nz), dr.alloc_local(Float, nz)
    # ---- up: eliminate what lies below
    k, last_c, last_d = UInt32(lowest), Float(0), Float(0)
    while dr.hint(k < nz, label="soften up", exclude=[softened]):
        bottom, lower, upper = conductances(k, place + k * cells.plane)
        pivot = dr.rcp(1 + bottom + lower + upper - lower * last_c)
        last_c = upper * pivot
        last_d = (b * dr.gather(Float, g, k * (ny * nx) + column) + lower * last_d) * pivot
        c[k] = last_c
        d[k] = last_d
        k += 1
    # ---- down: put in what is known above
    solved = Float(0)
    while dr.hint(k > lowest, label="soften down", exclude=[softened]):
        k -= 1
        solved = d[k] + c[k] * solved
        dr.scatter(softened, solved, k * (ny * nx) + column)
    return softened


@dr.syntax
def solve_columns(
    types: Any, modes: Any, levels: int, rows: int, inverse: Any, lower: Any, upper: Any
) -> Any:
    """φ (modes, rows) from the right-hand side `modes` (modes, rows), of whose rows the first `levels` count.

    `inverse` (modes, rows) holds the inverse pivots, `lower` and `upper` (levels,) the coefficients of the
    neighbours. The first mode is free by a constant.
    """
    Float, UInt32 = types.Float, types.UInt32
    count = len(modes) // rows
    solution = dr.zeros(Float, len(modes))
    mode = dr.arange(UInt32, count)
    kept = dr.alloc_local(Float, levels)
    # ---- up
    k, last = UInt32(0), Float(0)
    while dr.hint(k < levels, label="pressure up", exclude=[solution]):
        at = mode * rows + k
        value = dr.gather(Float, modes, at) - dr.gather(Float, lower, k) * last
        last = value * dr.gather(Float, inverse, at)
        kept[k] = last
        k += 1
    # ---- down
    solved = Float(0)
    while dr.hint(k > 0, label="pressure down", exclude=[solution]):
        k -= 1
        at = mode * rows + k
        pivot = dr.gather(Float, inverse, at) * dr.gather(Float, upper, k)
        solved = kept[k] - pivot * solved
        solved = dr.select((mode == 0) & (k == levels - 1), 0, solved)
        dr.scatter(solution, solved, at)
    return solution
