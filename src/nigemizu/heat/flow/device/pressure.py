"""Incompressibility on a device: the same pressure as `nigemizu.heat.flow.pressure`."""

from __future__ import annotations

from typing import Any, final

import drjit as dr
import numpy as np

from nigemizu.heat.flow.device.columns import solve_columns
from nigemizu.heat.flow.device.lattice import Lattice
from nigemizu.heat.flow.device.stencils import outflow
from nigemizu.heat.flow.device.transforms import Waves, wave_basis
from nigemizu.heat.flow.pressure import pivots
from nigemizu.heat.grid import Grid

__all__ = ["DevicePoisson"]


@final
class DevicePoisson:
    """Takes the gradient of φ from a velocity, where ∇²φ is its divergence.

    Parameters
    ----------
    grid : Grid
    walls : (bool, bool)
        Whether the sides along x and y are walls; else periodic.
    cells : Lattice

    Notes
    -----
    Within, values stand as (x, y, z), the levels of a column side by side and padded to fours: what a
    product of matrices and the elimination read at once.
    """

    def __init__(self, grid: Grid, walls: tuple[bool, bool], cells: Lattice) -> None:
        self._cells = cells
        types = cells.types
        nz, ny, nx = grid.shape
        self._rows = 4 * -(-nz // 4)
        (along_x, of_x), (along_y, of_y) = (
            wave_basis(count, wall) for count, wall in zip((nx, ny), walls, strict=True)
        )
        steps = (grid.horizontal_step("x"), grid.horizontal_step("y"))
        self._x = Waves(types, along_x, 1, ny * self._rows)
        self._y = Waves(types, along_y, nx, self._rows)
        lower, upper, inverse = pivots(grid, np.add.outer(of_x / steps[0] ** 2, of_y / steps[1] ** 2))
        self._lower, self._upper = types.Float(lower), types.Float(upper)
        whole = np.zeros((nx, ny, self._rows))
        whole[:, :, :nz] = np.moveaxis(inverse, 0, 2)
        self._inverse = types.Float(whole.ravel())

    def corrected(self, velocity: tuple[Any, Any, Any]) -> list[Any]:
        """The velocity at the cells without its divergence; what lies on walls is left to the padding."""
        cells, rows = self._cells, self._rows
        nz, ny, nx = cells.shape
        given = dr.zeros(cells.types.Float, nx * ny * rows)
        dr.scatter(given, outflow(cells, velocity), self._place(cells.i, cells.j, cells.k))
        modes = self._y.there(self._x.there(given))
        modes = solve_columns(cells.types, modes, nz, rows, self._inverse, self._lower, self._upper)
        phi = self._x.back(self._y.back(modes))
        west = dr.select(cells.i == 0, nx - 1, cells.i - 1)
        south = dr.select(cells.j == 0, ny - 1, cells.j - 1)
        below = dr.select(cells.k == 0, 0, cells.k - 1)
        neighbours = (
            self._place(west, cells.j, cells.k),
            self._place(cells.i, south, cells.k),
            self._place(cells.i, cells.j, below),
        )
        Float = cells.types.Float
        here = dr.gather(Float, phi, self._place(cells.i, cells.j, cells.k))
        return [
            cells.at(velocity[axis]) - (here - dr.gather(Float, phi, place)) * cells.between(axis)
            for axis, place in enumerate(neighbours)
        ]

    def _place(self, i: Any, j: Any, k: Any) -> Any:
        return (i * self._cells.shape[1] + j) * self._rows + k
