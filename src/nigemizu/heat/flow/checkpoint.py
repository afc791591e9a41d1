"""Checkpoints of moving air, from which a run goes on to the same bits, and the instants it has passed."""

from __future__ import annotations

import math
import os
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np

from nigemizu.heat.stepping import State

if TYPE_CHECKING:
    from nigemizu.heat.flow.moving import MovingAir

__all__ = ["Checkpoints"]

_KEPT: Final = 3  # a film may still lack frames from before the last one or two
_BROKEN: Final = (OSError, KeyError, ValueError, zipfile.BadZipFile)


@final
class Checkpoints:
    """Keeps the last sound states of a flow in a folder.

    Parameters
    ----------
    folder : path
        Made when the first is written.
    identity : str
        Of the run; another one's checkpoints are not taken up.
    every : float, s
        Simulated time between two checkpoints.

    Attributes
    ----------
    last : float or None, s
        Time of the last state in the folder.
    """

    def __init__(self, folder: Path, identity: str, every: float) -> None:
        self.folder, self._identity, self._every = folder, identity, every
        self.last: float | None = None
        self._next = every

    def due(self, time: float) -> bool:
        """Whether another checkpoint is to be written."""
        return time >= self._next

    def write(self, air: MovingAir) -> None:
        """Keep the state of the air, and drop the oldest."""
        u, v, w = air.velocity
        numbers = {"time": air.time, "zero": air.zero, "top_warmth": air.top_warmth}
        self._save(f"state_{air.time:017.9f}.npz", u=u, v=v, w=w, warmth=air.warmth, **numbers)
        for old in self._states()[:-_KEPT]:
            old.unlink(missing_ok=True)
        self._passed(air.time)

    def take_up(self, air: MovingAir, latest: float) -> bool:
        """Put the last state into the air that is not later than `latest` [s], if this run has one."""
        for path in reversed(self._states()):
            try:
                with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
                    if str(kept["identity"]) != self._identity or float(kept["time"]) > latest:
                        continue
                    air.restore(
                        kept["warmth"],
                        (kept["u"], kept["v"], kept["w"]),
                        time=float(kept["time"]),
                        zero=float(kept["zero"]),
                        top_warmth=float(kept["top_warmth"]),
                    )
            except _BROKEN:
                continue
            self._passed(air.time)
            return True
        return False

    def keep(self, number: int, state: State) -> None:
        """Keep an instant that has been given out."""
        assert state.wind is not None
        u, v, w = state.wind
        arrays = {
            "temperature": state.temperature,
            "surface": state.surface_temperature,
            "u": u,
            "v": v,
            "w": w,
        }
        self._save(self._instant(number).name, time=state.time, **arrays)

    def instants(self) -> Iterator[State]:
        """The instants that were kept, from the first on, as far as they are whole."""
        number = 0
        while True:
            try:
                with self._instant(number).open("rb") as file, np.load(file, allow_pickle=False) as kept:
                    if str(kept["identity"]) != self._identity:
                        return
                    wind = kept["u"], kept["v"], kept["w"]
                    state = State(float(kept["time"]), kept["temperature"], kept["surface"], wind)
            except _BROKEN:
                return
            yield state
            number += 1

    def remove(self) -> None:
        """Delete the folder: the run is complete."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _instant(self, number: int) -> Path:
        return self.folder / f"instant_{number:06d}.npz"

    def _states(self) -> list[Path]:
        return sorted(self.folder.glob("state_*.npz"))

    def _passed(self, time: float) -> None:
        self.last = time
        self._next = (math.floor(time / self._every * (1 + 1e-12)) + 1) * self._every

    def _save(self, name: str, **arrays: Any) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        temporary = self.folder / f".{name}.{os.getpid()}.tmp"
        try:
            with temporary.open("wb") as file:
                np.savez(file, identity=np.array(self._identity), **arrays)
            temporary.replace(self.folder / name)
        finally:
            temporary.unlink(missing_ok=True)
