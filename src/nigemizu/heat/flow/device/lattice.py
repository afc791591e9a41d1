"""Where the cells of a mesh and their neighbours stand in flat arrays."""

from __future__ import annotations

import itertools
from typing import Any, Final, final

import drjit as dr
import numpy as np

from nigemizu.heat.flow.cells import Metric
from nigemizu.heat.flow.padding import PAD

__all__ = ["Lattice", "X", "Y", "Z", "ahead", "behind"]

X, Y, Z = 0, 1, 2
Offset = tuple[int, int, int]
_HERE: Final[Offset] = (0, 0, 0)


def ahead(axis: int, of: Offset = _HERE) -> Offset:
    """The offset one cell further along an axis."""
    return _moved(of, axis, 1)


def behind(axis: int, of: Offset = _HERE) -> Offset:
    """The offset one cell back along an axis."""
    return _moved(of, axis, -1)


def _moved(of: Offset, axis: int, by: int) -> Offset:
    x, y, z = (count + (by if axis == number else 0) for number, count in enumerate(of))
    return x, y, z


@final
class Lattice:
    """Every cell at once, with what stands around it.

    Parameters
    ----------
    types : nigemizu.field.Types
        In double precision.
    shape : (nz, ny, nx)
        Without padding.
    metric : Metric

    Attributes
    ----------
    count, padded : int
        Cells, without padding and with it.
    column : UInt32 (nz · ny · nx,)
        Number of the cell's column, j · nx + i.
    i, j, k : UInt32 (nz · ny · nx,)
        Of the cell, from 0.
    """

    def __init__(self, types: Any, shape: tuple[int, int, int], metric: Metric) -> None:
        self.types, self.shape, self.metric = types, shape, metric
        nz, ny, nx = shape
        self.count = nz * ny * nx
        row, plane = nx + 2 * PAD, (nx + 2 * PAD) * (ny + 2 * PAD)
        self.strides = (1, row, plane)
        self.plane, self.padded = plane, plane * (nz + 2 * PAD)
        cell = dr.arange(types.UInt32, self.count)
        self.k = cell // (ny * nx)
        self.column = cell - self.k * (ny * nx)
        self.j = self.column // nx
        self.i = self.column - self.j * nx
        self.place = self.place_of(self.column) + self.k * plane
        self.dz, self.rdz, self.rdzf = (types.Float(part) for part in (metric.dz, metric.rdz, metric.rdzf))

    def place_of(self, column: Any) -> Any:
        """Place in a padded array of the lowest cell of a column."""
        nx = self.shape[2]
        j = column // nx
        return PAD * self.plane + (j + PAD) * self.strides[Y] + (column - j * nx) + PAD

    def at(self, field: Any, offset: Offset = _HERE) -> Any:
        """The value of a padded field at an offset (x, y, z) from every cell."""
        step = sum(stride * count for stride, count in zip(self.strides, offset, strict=True))
        # unsigned numbers wrap around: adding 2³² − 1 takes 1 away
        return dr.gather(self.types.Float, field, self.place + step % 2**32 if step else self.place)

    def of_level(self, numbers: Any, offset: int = 0) -> Any:
        """`dz`, `rdz` or `rdzf` of the level that lies `offset` above every cell."""
        return dr.gather(self.types.Float, numbers, self.k + (PAD + offset))

    def between(self, axis: int, offset: Offset = _HERE) -> Any:
        """1 / distance [1/m] between the centres beside the face at an offset."""
        return (self.metric.rdx, self.metric.rdy)[axis] if axis != Z else self.of_level(self.rdzf, offset[Z])

    def across(self, axis: int, offset: Offset = _HERE) -> Any:
        """1 / width [1/m] of the cell at an offset."""
        return (self.metric.rdx, self.metric.rdy)[axis] if axis != Z else self.of_level(self.rdz, offset[Z])

    def shares(self) -> tuple[Any, Any]:
        """Of the cell below and the one above, in the volume of the face between them."""
        half = 0.5 * self.of_level(self.rdzf)
        return half * self.of_level(self.dz, -1), half * self.of_level(self.dz)

    def host(self, field: Any) -> np.ndarray:
        """A padded field in the processor's memory."""
        shape = tuple(count + 2 * PAD for count in self.shape)
        return np.array(field, dtype=np.float64).reshape(shape)

    def flat(self, places: tuple[slice, slice, slice]) -> Any:
        """Numbers of the cells in a box of them (levels, rows, columns), one after another."""
        ranges = (range(*part.indices(count)) for part, count in zip(places, self.shape, strict=True))
        _, ny, nx = self.shape
        return self.types.UInt32([(k * ny + j) * nx + i for k, j, i in itertools.product(*ranges)])
