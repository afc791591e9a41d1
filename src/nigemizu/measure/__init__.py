"""What a film tells of the air: displacements of its texture, and the turbulence that they stand for.

The names are imported when they are first used, so that checking a command needs no decoder.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from nigemizu.measure.films import Film, open_film
    from nigemizu.measure.forms import TILT, coherence_length, difference_forms, unit_variance
    from nigemizu.measure.measuring import measure_film
    from nigemizu.measure.optics import Optics, optics_of
    from nigemizu.measure.result import Measurement, Quantity

__all__ = [
    "TILT",
    "Film",
    "Measurement",
    "Optics",
    "Quantity",
    "coherence_length",
    "difference_forms",
    "measure_film",
    "open_film",
    "optics_of",
    "unit_variance",
]

_HOMES: Final = {
    "films": ("Film", "open_film"),
    "forms": ("TILT", "coherence_length", "difference_forms", "unit_variance"),
    "measuring": ("measure_film",),
    "optics": ("Optics", "optics_of"),
    "result": ("Measurement", "Quantity"),
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(f"nigemizu.measure.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
