"""Progress bars with the time that is left, on stderr, and only where a person looks at it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, final

from nigemizu.progress import SILENT, ProgressMeter

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

__all__ = ["meter"]


@contextmanager
def meter(*, quiet: bool) -> Iterator[ProgressMeter]:
    """A meter that draws on the terminal, or the silent one in a pipe and when asked to be quiet."""
    if quiet or not sys.stderr.isatty():
        yield SILENT
        return
    drawing = _TerminalMeter()
    try:
        yield drawing
    finally:
        drawing.close()  # an interrupted bar would leave the cursor hidden


@final
class _TerminalMeter(ProgressMeter):
    """Bars that nest: a film's frames above the samples of the frame at hand."""

    def __init__(self) -> None:
        self._progress: Progress | None = None
        self._tasks: list[TaskID] = []

    def start(self, label: str, total: int) -> None:
        if self._progress is None:
            self._progress = _bars()
            self._progress.start()
        self._tasks.append(self._progress.add_task(label, total=total))

    def advance(self, amount: int = 1) -> None:
        if self._progress is not None and self._tasks:
            self._progress.advance(self._tasks[-1], amount)

    def finish(self) -> None:
        if self._progress is None or not self._tasks:
            return
        self._progress.remove_task(self._tasks.pop())
        if not self._tasks:
            self.close()

    def close(self) -> None:
        """Take the bars away, finished or not."""
        if self._progress is not None:
            self._progress.stop()
        self._progress = None
        self._tasks.clear()


def _bars() -> Progress:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
