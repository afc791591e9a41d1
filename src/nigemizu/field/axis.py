"""Finding the cell of a coordinate on a uniform or an arbitrarily spaced axis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Final, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.field.types import Types

__all__ = ["Axis", "BucketAxis", "UniformAxis", "make_axis"]

UNIFORM_TOLERANCE: Final = 1e-6  # of the spacing: below what single precision can tell from uniform
MOST_BUCKETS: Final = 1 << 20
FEW_CORRECTIONS: Final = 1  # nodes allowed inside one bucket before the buckets are made finer


class Axis(ABC):
    """Nodes x₀ < x₁ < … of one axis; cell i spans [xᵢ, xᵢ₊₁), the last cell is closed."""

    def __init__(self, nodes: NDArray[np.float64], types: Types) -> None:
        self._types = types
        self._first = float(nodes[0])
        self._last = float(nodes[-1])
        self._cells = len(nodes) - 1

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self._cells

    @abstractmethod
    def locate(self, coordinate: Any, active: Any = True) -> tuple[Any, Any, Any]:
        """Cell of a coordinate, which is first clamped to the axis.

        Returns
        -------
        index : UInt32 — cell i
        fraction : Float — (x − xᵢ)/(xᵢ₊₁ − xᵢ), in [0, 1]
        inverse_width : Float or float — 1/(xᵢ₊₁ − xᵢ)
        """


@final
class UniformAxis(Axis):
    """Equally spaced nodes: the cell is floor((x − x₀)/Δx)."""

    def __init__(self, nodes: NDArray[np.float64], types: Types) -> None:
        super().__init__(nodes, types)
        self._inverse_width = self._cells / (self._last - self._first)

    def locate(self, coordinate: Any, active: Any = True) -> tuple[Any, Any, Any]:
        scaled = (coordinate - self._first) * self._inverse_width
        scaled = dr.clip(scaled, 0, float(self._cells))
        index = dr.minimum(self._types.UInt32(scaled), self._cells - 1)
        return index, scaled - self._types.Float(index), self._inverse_width


@final
class BucketAxis(Axis):
    """Nodes with any spacing: a table over equal buckets gives a cell, comparisons make it exact.

    The table holds, per bucket, the last node at or before its lower edge. A coordinate in the bucket
    then passes at most `corrections` further nodes, each found by one comparison.
    """

    def __init__(self, nodes: NDArray[np.float64], types: Types) -> None:
        super().__init__(nodes, types)
        dtype = np.float32 if types.precision == "single" else np.float64
        # Compared in the precision of the coordinates, so that the cell is the one searchsorted finds.
        stored = nodes.astype(dtype)
        if not np.all(np.diff(stored) > 0):
            raise InputError(
                "the axis has cells too thin for single precision", remedy="use double precision"
            )
        self._buckets, table, self.corrections = _bucket_table(stored)
        self._scale = self._buckets / (self._last - self._first)
        self._table = types.UInt32(table)
        self._nodes = types.Float(stored)
        self._inverse_widths = types.Float((1.0 / np.diff(nodes)).astype(dtype))

    def locate(self, coordinate: Any, active: Any = True) -> tuple[Any, Any, Any]:
        types = self._types
        x = dr.clip(coordinate, self._first, self._last)
        bucket = types.UInt32(dr.maximum((x - self._first) * self._scale, 0))
        index = dr.gather(types.UInt32, self._table, dr.minimum(bucket, self._buckets - 1), active)
        for _ in range(self.corrections):
            above = dr.gather(types.Float, self._nodes, index + 1, active)
            index = dr.select((x >= above) & (index < self._cells - 1), index + 1, index)
        inverse_width = dr.gather(types.Float, self._inverse_widths, index, active)
        below = dr.gather(types.Float, self._nodes, index, active)
        return index, dr.clip((x - below) * inverse_width, 0, 1), inverse_width


def make_axis(nodes: ArrayLike, types: Types, *, key: str) -> Axis:
    """The axis with these nodes (m): uniform if they are equally spaced, else with a bucket table."""
    values = np.asarray(nodes, dtype=np.float64)
    if values.ndim != 1 or len(values) < 2:
        raise InputError("an axis needs at least two nodes", key=key, value=values.shape)
    spacing = np.diff(values)
    if not np.all(np.isfinite(values)) or not np.all(spacing > 0):
        raise InputError("the axis does not increase", key=key, expected="finite, strictly increasing nodes")
    even = np.linspace(values[0], values[-1], len(values))
    if np.max(np.abs(values - even)) <= UNIFORM_TOLERANCE * spacing.min():
        return UniformAxis(values, types)
    return BucketAxis(values, types)


def _bucket_table(nodes: NDArray[Any]) -> tuple[int, NDArray[np.uint32], int]:
    """Number of buckets, cell at the lower edge of each, and the most nodes that one bucket can pass."""
    first, last = float(nodes[0]), float(nodes[-1])
    cells = len(nodes) - 1
    buckets = 1 << max(6, int(np.ceil(np.log2(2 * cells))))
    while True:
        edges = first + (last - first) * np.arange(buckets + 1) / buckets
        # Round-off may put a coordinate one bucket off: look one bucket's slack to either side.
        slack = 4 * np.finfo(nodes.dtype).eps * max(abs(first), abs(last), last - first)
        start = np.clip(np.searchsorted(nodes, edges[:-1] - slack, side="right") - 1, 0, cells - 1)
        end = np.clip(np.searchsorted(nodes, edges[1:] + slack, side="right") - 1, 0, cells - 1)
        corrections = int(np.max(end - start))
        if corrections <= FEW_CORRECTIONS or 2 * buckets > MOST_BUCKETS:
            return buckets, start.astype(np.uint32), corrections
        buckets *= 2
