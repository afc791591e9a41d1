"""Heat in the air: the grid, the beginning, the boundaries, and the temperature as it evolves.

The names are imported when they are first used, so that describing an experiment needs neither the compiler
of the solver nor the readers of datasets.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from nigemizu.heat.boundary import (
        ExchangeGround,
        FluxGround,
        GroundBoundary,
        HeldGround,
        Sides,
        Top,
    )
    from nigemizu.heat.dataset import complete, mean_temperature_at, read_air, refractivity_at, to_dataset
    from nigemizu.heat.flow.checkpoint import Checkpoints
    from nigemizu.heat.flow.running import convect
    from nigemizu.heat.flow.settings import Convection
    from nigemizu.heat.flow.sources import Source
    from nigemizu.heat.grid import Grid, GridSpec, require_memory
    from nigemizu.heat.initial import Initial, ProfileTable, Unevenness
    from nigemizu.heat.quantity import (
        Daily,
        Disc,
        Image,
        Patches,
        Pattern,
        Quantity,
        Rectangle,
        Schedule,
        Stripes,
    )
    from nigemizu.heat.reading.soundings import Sounding, read_sounding
    from nigemizu.heat.solver import State, evolve, solve
    from nigemizu.heat.transport import Diffusivity, Wind
    from nigemizu.heat.turbulence.field import TurbulentField
    from nigemizu.heat.turbulence.settings import StructureTable, Turbulence

__all__ = [
    "Checkpoints",
    "Convection",
    "Daily",
    "Diffusivity",
    "Disc",
    "ExchangeGround",
    "FluxGround",
    "Grid",
    "GridSpec",
    "GroundBoundary",
    "HeldGround",
    "Image",
    "Initial",
    "Patches",
    "Pattern",
    "ProfileTable",
    "Quantity",
    "Rectangle",
    "Schedule",
    "Sides",
    "Sounding",
    "Source",
    "State",
    "Stripes",
    "StructureTable",
    "Top",
    "Turbulence",
    "TurbulentField",
    "Unevenness",
    "Wind",
    "complete",
    "convect",
    "evolve",
    "mean_temperature_at",
    "read_air",
    "read_sounding",
    "refractivity_at",
    "require_memory",
    "solve",
    "to_dataset",
]

_HOMES: Final = {
    "boundary": ("ExchangeGround", "FluxGround", "GroundBoundary", "HeldGround", "Sides", "Top"),
    "dataset": ("complete", "mean_temperature_at", "read_air", "refractivity_at", "to_dataset"),
    "flow.checkpoint": ("Checkpoints",),
    "flow.running": ("convect",),
    "flow.settings": ("Convection",),
    "flow.sources": ("Source",),
    "reading.soundings": ("Sounding", "read_sounding"),
    "solver": ("State", "evolve", "solve"),
    "grid": ("Grid", "GridSpec", "require_memory"),
    "initial": ("Initial", "ProfileTable", "Unevenness"),
    "quantity": (
        "Daily",
        "Disc",
        "Image",
        "Patches",
        "Pattern",
        "Quantity",
        "Rectangle",
        "Schedule",
        "Stripes",
    ),
    "transport": ("Diffusivity", "Wind"),
    "turbulence.field": ("TurbulentField",),
    "turbulence.settings": ("StructureTable", "Turbulence"),
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(f"nigemizu.heat.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
