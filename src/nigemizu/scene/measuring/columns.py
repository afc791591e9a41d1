"""Tables of numbers: columns that know their units, as records, CSV, datasets, and text that people read."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray

__all__ = ["FIGURES", "SUFFIXES", "Column", "plain", "records", "text_table", "write_table"]

FIGURES: Final = (".png", ".svg", ".pdf")
SUFFIXES: Final = (".csv", ".nc", ".json", *FIGURES)

Cell: TypeAlias = float | int | str | None


@final
@dataclass(frozen=True)
class Column:
    """One column.

    Attributes
    ----------
    name : str
        As it stands in records and CSV files: with its unit, unless that is SI or 1.
    values : (N,) array
        Numbers, or texts.
    heading : str
        As it stands over the column that people read.
    digits : int
        Behind the point, there.
    """

    name: str
    values: NDArray[Any]
    heading: str = ""
    digits: int = 3

    def cells(self) -> list[Cell]:
        """The values as plain numbers and texts; None for what is not a number, and for the infinite."""
        return [plain(one) for one in self.values.tolist()]

    def shown(self, rows: Sequence[int]) -> list[str]:
        """Some of them for people."""
        kept = self.values[list(rows)].tolist()
        return [
            one if isinstance(one, str) else "–" if plain(one) is None else f"{one:z.{self.digits}f}"
            for one in kept
        ]


def plain(value: Any) -> Any:
    """A number for JSON: None unless it is finite."""
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


def records(columns: Sequence[Column]) -> list[dict[str, Any]]:
    """One JSON-ready record per row."""
    names = [column.name for column in columns]
    rows = zip(*(column.cells() for column in columns), strict=True)
    return [dict(zip(names, row, strict=True)) for row in rows]


def text_table(columns: Sequence[Column], rows: Sequence[int]) -> list[str]:
    """Lines with some of the rows under the headings, numbers to the right."""
    shown = [[column.heading or column.name, *column.shown(rows)] for column in columns]
    widths = [max(map(len, column)) for column in shown]
    return [
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in zip(*shown, strict=True)
    ]


def write_table(
    path: Path, columns: Sequence[Column], dataset: xarray.Dataset, about: dict[str, Any], command: str
) -> Path:
    """Write ``.csv``, ``.nc`` or ``.json``, whole or not at all."""
    from nigemizu.output import write_air
    from nigemizu.output.files import write_bytes

    suffix = path.suffix.lower()
    if suffix == ".nc":
        return write_air(dataset.assign_attrs(history=command) if command else dataset, path)
    if suffix == ".json":
        text = json.dumps(about, indent=1, allow_nan=False, ensure_ascii=False)
        return write_bytes(path, (text + "\n").encode("utf-8"))
    lines = io.StringIO()
    table = csv.writer(lines, lineterminator="\n")
    table.writerow([column.name for column in columns])
    for row in zip(*(column.cells() for column in columns), strict=True):
        table.writerow(["" if cell is None else cell for cell in row])
    return write_bytes(path, lines.getvalue().encode("utf-8"))
