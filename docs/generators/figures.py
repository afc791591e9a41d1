"""What the figures of the validation pages share."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from nigemizu.output.files import write_bytes

__all__ = ["BLUE", "INK", "RED", "SAND", "panels", "plain"]

INK: Final = "#22303a"
RED: Final = "#c8442b"
BLUE: Final = "#2a6f97"
SAND: Final = "#b08d57"
WIDTH: Final = 9.5  # inches


@contextmanager
def panels(path: Path, columns: int, rows: int = 1, *, height: float = 3.6) -> Iterator[list[Any]]:
    """Panels row by row, written when they have been drawn; left alone where nothing changed."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style = {"font.size": 9.5, "text.color": INK, "axes.labelcolor": INK, "axes.edgecolor": INK}
    with rc_context({**style, "axes.linewidth": 0.8, "svg.hashsalt": "nigemizu"}):
        figure = Figure(figsize=(WIDTH, rows * height), layout="constrained")
        drawn = list(figure.subplots(rows, columns, squeeze=False).ravel())
        yield drawn
        for panel in drawn:
            panel.spines[["top", "right"]].set_visible(False)
        buffer = io.BytesIO()
        figure.savefig(
            buffer, format=path.suffix[1:], metadata={"Date": None} if path.suffix == ".svg" else {}
        )
    if not path.is_file() or path.read_bytes() != buffer.getvalue():
        write_bytes(path, buffer.getvalue())


def plain(*axes: Any) -> None:
    """Numbers 1, 2 and 5 of each decade on logarithmic axes that span few of them."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in axes:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
