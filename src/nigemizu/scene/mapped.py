"""A scene's camera and objects on the flat map of a round Earth."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nigemizu.air import Earth
    from nigemizu.render import Camera, Object
    from nigemizu.scene.model import Scene

__all__ = ["mapped_camera", "mapped_objects"]


def mapped_camera(scene: Scene) -> Camera:
    """The camera in the map; a target is looked at in the direction that it has without air."""
    camera = scene.camera
    if scene.earth is None:
        return camera
    x, y, z = camera.eye
    changes: dict[str, object] = {"eye": (x, y, _conformal(scene.earth, z))}
    if camera.target is not None:
        heading, pitch = _towards(scene.earth, camera.eye, camera.target)
        changes |= {"target": None, "heading": heading, "pitch": pitch}
    return camera.model_copy(update=changes)


def mapped_objects(scene: Scene) -> tuple[Object, ...]:
    """The objects in the map: their places lie on conformal heights.

    Notes
    -----
    An object itself is not bent: over its own height H the map shrinks it by H/2R, 8 cm for a kilometre.
    Hills, which are high, are placed by foot and summit.
    """
    if scene.earth is None:
        return scene.objects
    return tuple(_mapped(entry, scene.earth) for entry in scene.objects)


def _mapped(entry: Object, earth: Earth) -> Object:
    from nigemizu.render import Ground, Hills, MitsubaFile

    match entry:
        case Ground():
            return entry.model_copy(update={"height": _conformal(earth, entry.height)})
        case Hills():
            foot, summit = (_conformal(earth, z) for z in (entry.base, entry.base + entry.height))
            return entry.model_copy(update={"base": foot, "height": summit - foot})
        case MitsubaFile():
            return entry
    x, y, z = entry.position
    return entry.model_copy(update={"position": (x, y, _conformal(earth, z))})


def _conformal(earth: Earth, height: float) -> float:
    return float(earth.conformal_height(np.float64(height)))


def _towards(
    earth: Earth, eye: tuple[float, float, float], target: tuple[float, float, float]
) -> tuple[float, float]:
    """Heading and elevation [degrees] of a point without air."""
    x, y = target[0] - eye[0], target[1] - eye[1]
    distance = math.hypot(x, y)
    up, ahead = target[2] - eye[2], distance
    if not earth.flat:
        angle = distance / earth.radius
        ahead = (earth.radius + target[2]) * math.sin(angle)
        up -= 2 * (earth.radius + target[2]) * math.sin(angle / 2) ** 2
    return math.degrees(math.atan2(y, x)), math.degrees(math.atan2(up, ahead))
