"""Where the air stands in a Mitsuba scene, and the scene's surfaces as its rays see them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.trace import Surface

__all__ = ["Frame", "surface_query"]


@final
@dataclass(frozen=True)
class Frame:
    """Where the air stands in a Mitsuba scene: ``world = rotation · (scale · air) + origin``.

    Parameters
    ----------
    rotation : (3, 3) float64
        Proper rotation, air axes to scene axes.
    scale : float
        Scene units per metre.
    origin : (3,) float64
        The air's origin in scene units.
    """

    rotation: NDArray[np.float64]
    scale: float
    origin: NDArray[np.float64]

    @property
    def up(self) -> NDArray[np.float64]:
        """Unit vector of the air's vertical in the scene."""
        return self.rotation[:, 2]

    @property
    def is_identity(self) -> bool:
        """Whether air and scene share one frame."""
        return bool(
            np.array_equal(self.rotation, np.eye(3)) and self.scale == 1.0 and not np.any(self.origin)
        )

    @staticmethod
    def from_matrix(matrix: NDArray[np.float64]) -> Frame:
        """The frame of a 4×4 matrix made of a rotation, a uniform scale and a translation.

        Raises
        ------
        InputError
            If the matrix shears, mirrors or scales unevenly: optical paths would change their length
            with direction.
        """
        linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
        scale = float(np.cbrt(abs(np.linalg.det(linear))))
        rotation = linear / scale if scale > 0 else linear
        proper = scale > 0 and np.linalg.det(linear) > 0
        if not proper or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4):
            raise InputError(
                "the air can be rotated, moved and scaled evenly only",
                key="integrator nigemizu: to_world",
                value=np.asarray(matrix).tolist(),
            )
        return Frame(rotation, scale, np.asarray(matrix, dtype=np.float64)[:3, 3])

    def to_air(self, origin: Any, direction: Any) -> tuple[Any, Any]:
        """A point [scene units → m] and a direction in the air's axes."""
        if self.is_identity:
            return origin, direction
        inverse = mi.Matrix3f(self.rotation.T.tolist())
        shifted = (origin - mi.Point3f(self.origin.tolist())) / self.scale
        return mi.Point3f(inverse @ mi.Vector3f(shifted)), inverse @ direction

    def to_scene(self, origin: Any, direction: Any) -> tuple[Any, Any]:
        """A point [m → scene units] and a direction in the scene's axes."""
        origin, direction = mi.Point3f(origin), mi.Vector3f(direction)
        if self.is_identity:
            return origin, direction
        rotation = mi.Matrix3f(self.rotation.tolist())
        turned = rotation @ (mi.Vector3f(origin) * self.scale)
        return mi.Point3f(turned + mi.Vector3f(self.origin.tolist())), rotation @ direction

    def surface(self, scene: Any, *, coherent: bool = False) -> Surface:
        """The surfaces of a Mitsuba scene for rays in the air's axes, which mark what they meet."""
        return _Query(scene, self, coherent)

    def boxes(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Boxes (N, 2, 3) of the scene as boxes of the air [m], which contain them."""
        if self.is_identity or not len(boxes):
            return boxes
        middle, half = boxes.mean(axis=1) - self.origin, 0.5 * (boxes[:, 1] - boxes[:, 0])
        middle = middle @ self.rotation / self.scale
        half = half @ np.abs(self.rotation) / self.scale
        return np.stack([middle - half, middle + half], axis=1)


@final
class _Query:
    """A surface (`nigemizu.trace.Surface`) whose marks are Mitsuba's preliminary intersections."""

    def __init__(self, scene: Any, frame: Frame, coherent: bool) -> None:
        self._scene = scene
        self._frame = frame
        self._coherent = coherent
        nothing: Any = dr.zeros(mi.PreliminaryIntersection3f)
        nothing.t = mi.Float(dr.inf)
        self.blank = nothing

    def __call__(self, origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any, Any]:
        scene_origin, scene_direction = self._frame.to_scene(origin, direction)
        ray: Any = mi.Ray3f(scene_origin, scene_direction)
        ray.maxt = mi.Float(length * self._frame.scale)
        # Never as "coherent" rays near objects: Embree loses flat parts of meshes far from the origin in
        # packets of nearly parallel rays that begin close to them, a third of the hits in the worst case.
        met = self._scene.ray_intersect_preliminary(ray, self._coherent, mi.Bool(active))
        # In the array types of the caller.
        return dr.mask_t(length)(met.is_valid()), type(length)(met.t / self._frame.scale), met


def surface_query(scene: Any) -> Surface:
    """The surfaces of a Mitsuba scene as the callback that `nigemizu.trace` takes.

    Parameters
    ----------
    scene : mi.Scene
        The scene; its unit is the metre.

    Returns
    -------
    callable
        ``(origin, direction, length, active) -> (hit, distance)``; takes double precision as well, which
        is rounded to Mitsuba's single precision (0.06 mm at 1 km).
    """
    query = _Query(scene, Frame(np.eye(3), 1.0, np.zeros(3)), coherent=False)

    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        return query(origin, direction, length, active)[:2]

    return surface
