"""Turbulence that no grid computes: random temperatures with the statistics of real air.

The names are imported when they are first used, so that describing an experiment needs no compiler.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from nigemizu.heat.turbulence.field import TurbulentField
    from nigemizu.heat.turbulence.settings import StructureTable, Turbulence
    from nigemizu.heat.turbulence.spectrum import structure_function, temperature_spectrum
    from nigemizu.heat.turbulence.theory import (
        angle_of_arrival_variance,
        aperture_scintillation,
        cn2_from_ct2,
        ct2_from_cn2,
        differential_angle_variance,
        fried_parameter,
        rytov_variance,
    )

_HOMES: Final = {
    "field": ("TurbulentField",),
    "settings": ("StructureTable", "Turbulence"),
    "spectrum": ("structure_function", "temperature_spectrum"),
    "theory": (
        "angle_of_arrival_variance",
        "aperture_scintillation",
        "cn2_from_ct2",
        "ct2_from_cn2",
        "differential_angle_variance",
        "fried_parameter",
        "rytov_variance",
    ),
}

__all__ = [
    "StructureTable",
    "Turbulence",
    "TurbulentField",
    "angle_of_arrival_variance",
    "aperture_scintillation",
    "cn2_from_ct2",
    "ct2_from_cn2",
    "differential_angle_variance",
    "fried_parameter",
    "rytov_variance",
    "structure_function",
    "temperature_spectrum",
]


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(f"nigemizu.heat.turbulence.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
