"""The bent ray: marching through a refractive-index field, with surfaces as a callback."""

from nigemizu.trace.ends import ESCAPED, HIT, NOT_TRACED, OUT_OF_STEPS, STOPPED, RayEnd, RayStatus
from nigemizu.trace.layered import cross_layers, straight
from nigemizu.trace.march import march
from nigemizu.trace.paths import record_paths
from nigemizu.trace.shared import SharedPaths, SharingReport
from nigemizu.trace.sharing import grounded, share_paths
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
    "RayEnd",
    "RayStatus",
    "SharedPaths",
    "SharingReport",
    "Stepper",
    "Surface",
    "Tracer",
    "View",
    "combine",
    "cross_layers",
    "ground_plane",
    "grounded",
    "march",
    "record_paths",
    "share_paths",
    "spread",
    "stepper_named",
    "straight",
]
