"""Small scenes and exact rays that several tests use."""

import math

import mitsuba as mi
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from nigemizu import field
from nigemizu.render.variant import current_backend


def types():
    return field.types(current_backend(), "single", differentiable=True)


def still_air(half=3.0):
    """A volume of n = 1 exactly around the origin."""
    axis = np.linspace(-half, half, 5)
    return field.TrilinearVolume(axis, axis, axis, np.zeros((5, 5, 5)), types())


def sensor(*, eye=(0, 0, 1.7), direction=(1, 0, 0), up=(0, 0, 1), fov=2.0, width=64, height=64, spp=16):
    target = np.asarray(eye, float) + np.asarray(direction, float)
    return {
        "type": "perspective",
        "fov": fov,
        "fov_axis": "x",
        "near_clip": 1e-2,
        "far_clip": 1e7,
        "to_world": mi.ScalarTransform4f().look_at(origin=list(eye), target=target.tolist(), up=list(up)),
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": "multijitter", "sample_count": spp},
    }


def bar(x, z, half_height, half_width=1e3, y=0.0):
    """A luminous upright rectangle of radiance 1 that faces the camera."""
    transform = mi.ScalarTransform4f
    return {
        "type": "rectangle",
        "to_world": transform().translate([x, y, z])
        @ transform().rotate([0, 1, 0], -90)
        @ transform().scale([half_height, half_width, 1]),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
    }


def row_of(elevation, fov, width, height):
    """Row (as a real number from the top edge) of an apparent elevation [rad] for a level camera."""
    focal = width / 2 / math.tan(math.radians(fov) / 2)
    return height / 2 - focal * math.tan(elevation)


def height_at(elevation, distance, eye_height, gradient_of_square):
    """Height at which a ray in a layered medium passes `distance`, by an adaptive integration in double.

    Rays obey d²r/dσ² = ½∇n² with |dr/dσ| = n; `gradient_of_square(z)` gives (n², d(n²)/dz).
    """
    n2, _ = gradient_of_square(eye_height)
    px, pz = math.sqrt(n2) * math.cos(elevation), math.sqrt(n2) * math.sin(elevation)

    def motion(_, state):
        return [state[1], 0.5 * gradient_of_square(state[0])[1]]

    result = solve_ivp(motion, (0, distance / px), [eye_height, pz], rtol=1e-11, atol=1e-12)
    return result.y[0, -1]


def apparent_elevation(z, lower, upper, distance, eye_height, gradient_of_square):
    """The elevation between `lower` and `upper` [rad] whose ray passes height z at `distance`."""
    return brentq(
        lambda angle: height_at(angle, distance, eye_height, gradient_of_square) - z,
        lower,
        upper,
        xtol=1e-12,
    )
