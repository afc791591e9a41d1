"""Progress of long work. The library stays silent; the command line passes a meter that draws a bar."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Final, final

__all__ = ["SILENT", "ProgressMeter"]


class ProgressMeter(ABC):
    """Receives how far a piece of work has come.

    A meter may be used for several pieces of work, one after another: each begins with `start`
    and ends with `finish`.
    """

    @abstractmethod
    def start(self, label: str, total: int) -> None:
        """Begin a piece of work of `total` units, described by `label`."""

    @abstractmethod
    def advance(self, amount: int = 1) -> None:
        """Report that `amount` more units are done."""

    @abstractmethod
    def finish(self) -> None:
        """End the piece of work."""


@final
class _Silent(ProgressMeter):
    def start(self, label: str, total: int) -> None: ...

    def advance(self, amount: int = 1) -> None: ...

    def finish(self) -> None: ...


SILENT: Final[ProgressMeter] = _Silent()
