"""What ``--stats`` tells: how the rays ended, how far they err, and how long it took."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from nigemizu.render.report import ErrorReport

__all__ = ["Stats"]


@final
class Stats:
    """An account of a picture or a film; the clock runs from when it is made."""

    def __init__(self) -> None:
        self._began = time.perf_counter()
        self._statuses: Mapping[str, int] = {}
        self._report: ErrorReport | None = None

    def take(self, statuses: Mapping[str, int], report: ErrorReport | None) -> None:
        """Take in the camera rays by status, and their errors (None: no light was bent)."""
        self._statuses, self._report = statuses, report

    def __str__(self) -> str:
        told = ", ".join(f"{count:,} {status}" for status, count in self._statuses.items())
        lines = [
            f"rays: {told or 'none, every frame was there already'}",
            *([] if self._report is None else [f"bending: {self._report}"]),
            f"time: {time.perf_counter() - self._began:.1f} s",
        ]
        return "\n".join(f"nigemizu: {line}" for line in lines)
