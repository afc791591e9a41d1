"""The table of the paths that rays share: states at the nodes of a grid on the screen, block by block."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["RECORD", "PathTable", "records_of"]

FloatArray = NDArray[np.float64]
Array = NDArray[np.floating[Any]]

RECORD: Final = 8  # numbers per state: offset, whether the cell behind the node is torn, deflection, 0


@final
@dataclass(frozen=True)
class PathTable:
    """States of the paths at the nodes of each block; B blocks.

    Attributes
    ----------
    records : (K * RECORD,) float
        Offset from the straight ray [m] and deflection of the direction [1] at the beginning of each
        segment and behind the last one, in the view's frame. The fourth number of a block's first records is
        1 where the cell to the lower right of the node is torn: its rays are marched one by one.
    base : (B,) uint32
        Index of a block's first record: ``base + (segment * rows + row) * columns + column``, each one
        more than the cells.
    cells : (B, 2) uint32
        Cells of its grid across and down; 0 where the paths are not smooth and each ray must be marched.
    error : (B,) float64, rad
        Estimated displacement that the sharing adds.
    steps : float
        Mean steps of the paths flown.
    flown : int
        Paths flown for the table.
    """

    records: Array
    base: NDArray[np.uint32]
    cells: NDArray[np.uint32]
    error: FloatArray
    steps: float
    flown: int

    @property
    def torn_share(self) -> float:
        """Fraction of the picture that lies in torn cells."""
        marks = np.flatnonzero(self.records.reshape(-1, RECORD)[:, 3])
        laid = np.flatnonzero(self.cells[:, 0])
        order = laid[np.argsort(self.base[laid], kind="stable")]
        block = order[np.searchsorted(self.base[order], marks, side="right") - 1]
        return float(np.sum(1.0 / self.cells[block].prod(axis=1))) / max(len(self.cells), 1)

    def torn_at(self, blocks: NDArray[np.intp], across: FloatArray) -> PathTable:
        """The table with torn cells at places across blocks (0 to 1), from top to bottom.

        The pictures of fluctuating air are torn from top to bottom more than from side to side: light that
        runs along a face between two cells is bent by the one or by the other.
        """
        columns, rows = self.cells[blocks].astype(np.int64).T
        column = np.minimum((across * columns).astype(np.int64), columns - 1)
        records = self.records.copy()
        marks = records.reshape(-1, RECORD)[:, 3]
        for row in range(int(rows.max(initial=0))):
            inside = row < rows
            marks[(self.base[blocks] + row * (columns + 1) + column)[inside]] = 1
        return replace(self, records=records)


def records_of(states: Array) -> Array:
    """States (rows, columns, stops, 6, blocks) as records, (blocks, stops, rows, columns, RECORD)."""
    rows, columns, stops, _, count = states.shape
    records = np.zeros((count, stops, rows, columns, RECORD), dtype=states.dtype)
    ordered = states.transpose(4, 2, 0, 1, 3)
    records[..., :3], records[..., 4:7] = ordered[..., :3], ordered[..., 3:]
    return records
