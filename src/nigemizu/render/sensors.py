"""Mitsuba sensors of a camera: the pinhole, the thin lens, and pinholes on the aperture of the lens."""

from __future__ import annotations

import math
from typing import Any, Final

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from nigemizu.render.camera import Camera
from nigemizu.trace import spread

__all__ = ["lens_sensors", "pinhole_sensor", "sensor"]

_FAR: Final = 1e8  # m; as good as infinity


def sensor(camera: Camera) -> dict[str, Any]:
    """The Mitsuba sensor that a camera is: ``perspective``, or ``thinlens`` where it has an aperture.

    A sensor with an aperture starts each ray from its own point on it, so that rays do not share paths.
    """
    base = _perspective(camera, np.asarray(camera.eye))
    if camera.aperture_diameter == 0:
        return base
    return base | {
        "type": "thinlens",
        "aperture_radius": camera.aperture_diameter / 2,
        "focus_distance": min(camera.focus, _FAR),
    }


def pinhole_sensor(camera: Camera) -> Any:
    """The camera with a pinhole in the middle of its aperture."""
    return mi.load_dict(_perspective(camera, np.asarray(camera.eye)))


def lens_sensors(camera: Camera) -> list[Any]:
    """Pinholes at the points on the aperture that the samples share; their mean picture is the lens's.

    Returns
    -------
    list of mi.Sensor
        One per point (`camera.lens_points`, at most one a sample); empty where samples share none.

    Notes
    -----
    The points are the sequence R2 mapped to the disc with equal areas. A pinhole beside the middle by a (to
    the left) and b (up) looks in the same direction with its principal point shifted by a/s and b/s, so that
    the plane at the distance s stays where it is.
    """
    count = min(camera.lens_points, camera.samples)
    if camera.aperture_diameter == 0 or count == 0:
        return []
    left, up = _axes(camera)
    width = 2.0 * math.tan(math.radians(camera.angle_of_view) / 2.0)
    height = width * camera.height / camera.width
    sensors: list[Any] = []
    film: Any = None  # one for all: it holds a picture
    for a, b in _on_disc(count) * camera.aperture_diameter / 2:
        pinhole = _perspective(camera, np.asarray(camera.eye) + a * left + b * up)
        pinhole["principal_point_offset_x"] = float(a / camera.focus / width)
        pinhole["principal_point_offset_y"] = float(b / camera.focus / height)
        film = film or mi.load_dict(pinhole["film"])
        sensors.append(mi.load_dict(pinhole | {"film": film}))
    return sensors


def _on_disc(count: int) -> NDArray[np.float64]:
    """Points (count, 2) that fill the unit disc evenly; a single one is its middle."""
    if count == 1:
        return np.zeros((1, 2))
    u, v = spread(count)
    radius, angle = np.sqrt(u), 2 * np.pi * v
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _axes(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors to the left and upwards in the picture."""
    direction = np.asarray(camera.direction)
    left = np.cross(_up(direction), direction)
    left /= np.linalg.norm(left)
    return left, np.cross(direction, left)


def _up(direction: NDArray[np.float64]) -> list[float]:
    return [0.0, 0.0, 1.0] if math.hypot(direction[0], direction[1]) > 1e-6 else [1.0, 0.0, 0.0]


def _perspective(camera: Camera, eye: NDArray[np.float64]) -> dict[str, Any]:
    direction = np.asarray(camera.direction)
    return {
        "type": "perspective",
        "fov": camera.angle_of_view,
        "fov_axis": "x",
        "near_clip": 1e-2,
        "far_clip": 1e8,
        "to_world": mi.ScalarTransform4f().look_at(
            origin=eye.tolist(), target=(eye + direction).tolist(), up=_up(direction)
        ),
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "rfilter": {"type": camera.filter},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        # Stratified: which light a sample draws is spread evenly over the samples of a pixel.
        "sampler": {"type": "multijitter", "sample_count": min(camera.samples, 64)},
    }
