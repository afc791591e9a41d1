"""The bent ray: marching through a refractive-index field, with surfaces as a callback."""

from nigemizu.trace.ends import ESCAPED, HIT, NOT_TRACED, OUT_OF_STEPS, STOPPED, RayEnd, RayStatus
from nigemizu.trace.layered import cross_layers, straight
from nigemizu.trace.march import march
from nigemizu.trace.paths import record_paths
from nigemizu.trace.steppers import EULER, LEAPFROG, STEPPERS, SUZUKI4, YOSHIDA4, Stepper, stepper_named
from nigemizu.trace.surfaces import Surface, combine, ground_plane
from nigemizu.trace.tracer import Tracer

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
    "RayEnd",
    "RayStatus",
    "Stepper",
    "Surface",
    "Tracer",
    "combine",
    "cross_layers",
    "ground_plane",
    "march",
    "record_paths",
    "stepper_named",
    "straight",
]
