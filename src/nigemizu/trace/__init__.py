"""The bent ray: marching through a refractive-index field, with surfaces as a callback."""

from nigemizu.trace.astronomical import (
    RefractedRays,
    RefractionStatus,
    astronomical_refraction,
    column,
    refracted_rays,
)
from nigemizu.trace.ends import ESCAPED, HIT, NOT_TRACED, OUT_OF_STEPS, STOPPED, RayEnd, RayStatus
from nigemizu.trace.horizon import Horizon, horizon, refraction_coefficient
from nigemizu.trace.layered import cross_layers, straight
from nigemizu.trace.march import march
from nigemizu.trace.paths import record_paths
from nigemizu.trace.shared import SharedPaths, SharingReport
from nigemizu.trace.sharing import grounded, share_paths
from nigemizu.trace.shells import RadialIndex
from nigemizu.trace.steppers import EULER, LEAPFROG, STEPPERS, SUZUKI4, YOSHIDA4, Stepper, stepper_named
from nigemizu.trace.surfaces import Surface, combine, ground_plane
from nigemizu.trace.tracer import Tracer
from nigemizu.trace.view import ElevationView, View, spread

__all__ = [
    "ESCAPED",
    "EULER",
    "HIT",
    "LEAPFROG",
    "NOT_TRACED",
    "OUT_OF_STEPS",
    "STEPPERS",
    "STOPPED",
    "SUZUKI4",
    "YOSHIDA4",
    "ElevationView",
    "Horizon",
    "RadialIndex",
    "RayEnd",
    "RayStatus",
    "RefractedRays",
    "RefractionStatus",
    "SharedPaths",
    "SharingReport",
    "Stepper",
    "Surface",
    "Tracer",
    "View",
    "astronomical_refraction",
    "column",
    "combine",
    "cross_layers",
    "ground_plane",
    "grounded",
    "horizon",
    "march",
    "record_paths",
    "refracted_rays",
    "refraction_coefficient",
    "share_paths",
    "spread",
    "stepper_named",
    "straight",
]
