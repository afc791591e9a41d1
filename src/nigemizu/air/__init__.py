"""Air as an optical medium: refractivity, moist air, hydrostatic pressure. Arrays in, arrays out."""

from nigemizu.air.atmosphere import Atmosphere
from nigemizu.air.earth import Earth
from nigemizu.air.laws import MODELS, critical_angle, peck_reeder, refractivity
from nigemizu.air.moist import (
    compressibility,
    density,
    enhancement_factor,
    saturation_vapour_pressure,
    water_vapour_fraction,
)
from nigemizu.air.pressure import hydrostatic_pressure

__all__ = [
    "MODELS",
    "Atmosphere",
    "Earth",
    "compressibility",
    "critical_angle",
    "density",
    "enhancement_factor",
    "hydrostatic_pressure",
    "peck_reeder",
    "refractivity",
    "saturation_vapour_pressure",
    "water_vapour_fraction",
]
