"""Air as an optical medium: refractivity, moist air, hydrostatic pressure. Arrays in, arrays out."""

from nigemizu.air.atmosphere import Atmosphere
from nigemizu.air.earth import Earth
from nigemizu.air.extinction import Extinction
from nigemizu.air.hohenkerk_sinclair import HohenkerkSinclair
from nigemizu.air.laws import MODELS, critical_angle, peck_reeder, refractivity
from nigemizu.air.layers import ExponentialLayer, GaussianLayer, Inversion
from nigemizu.air.moist import (
    compressibility,
    density,
    enhancement_factor,
    saturation_vapour_pressure,
    water_vapour_fraction,
)
from nigemizu.air.pressure import hydrostatic_pressure
from nigemizu.air.profile import LayeredIndex, Profile
from nigemizu.air.profile_spec import MeasuredAir, ProfileSpec
from nigemizu.air.similarity import SurfaceFluxes, psi_heat, psi_momentum
from nigemizu.air.standards import standard_atmosphere
from nigemizu.air.surface_layer import SurfaceLayer

__all__ = [
    "MODELS",
    "Atmosphere",
    "Earth",
    "ExponentialLayer",
    "Extinction",
    "GaussianLayer",
    "HohenkerkSinclair",
    "Inversion",
    "LayeredIndex",
    "MeasuredAir",
    "Profile",
    "ProfileSpec",
    "SurfaceFluxes",
    "SurfaceLayer",
    "compressibility",
    "critical_angle",
    "density",
    "enhancement_factor",
    "hydrostatic_pressure",
    "peck_reeder",
    "psi_heat",
    "psi_momentum",
    "refractivity",
    "saturation_vapour_pressure",
    "standard_atmosphere",
    "water_vapour_fraction",
]
