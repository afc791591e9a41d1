"""The bent ray: marching through a refractive-index field, with surfaces as a callback."""

from nigemizu.trace.ends import RayEnd, RayStatus
from nigemizu.trace.march import march
from nigemizu.trace.steppers import EULER, LEAPFROG, STEPPERS, SUZUKI4, YOSHIDA4, Stepper, stepper_named
from nigemizu.trace.surfaces import Surface, combine, ground_plane

__all__ = [
    "EULER",
    "LEAPFROG",
    "STEPPERS",
    "SUZUKI4",
    "YOSHIDA4",
    "RayEnd",
    "RayStatus",
    "Stepper",
    "Surface",
    "combine",
    "ground_plane",
    "march",
    "stepper_named",
]
