"""The shape of a passenger car, by lofting: right to the eye from 100 m, no nearer."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from nigemizu.render.meshes import Triangles, box, cylinder, ellipsoid, loft

__all__ = ["LENGTH", "car"]

LENGTH = 4.4  # m, from bumper to bumper of the car below

# x, half width, bottom, top of the body below the windows, from the tail to the nose (m)
_BODY = np.array([
    [-2.20, 0.74, 0.38, 0.82], [-2.16, 0.80, 0.28, 0.93],
    [-1.90, 0.86, 0.22, 0.98], [-1.20, 0.89, 0.20, 0.97],
    [0.00, 0.89, 0.19, 0.95], [0.90, 0.89, 0.20, 0.95], [1.40, 0.88, 0.21, 0.90], [1.85, 0.85, 0.22, 0.80],
    [2.08, 0.80, 0.24, 0.73], [2.20, 0.70, 0.30, 0.62],
])  # fmt: skip
# z, rear x, front x, half width of the cabin from the belt line to the roof (m)
_CABIN = np.array([
    [0.90, -1.95, 1.12, 0.80], [0.97, -1.86, 1.00, 0.79], [1.10, -1.70, 0.78, 0.745],
    [1.25, -1.50, 0.50, 0.69], [1.36, -1.30, 0.27, 0.64],
])  # fmt: skip
_ROOF = np.array([
    [1.36, -1.31, 0.28, 0.645], [1.41, -1.20, 0.16, 0.61], [1.445, -1.00, 0.00, 0.54],
    [1.46, -0.7, -0.25, 0.40],
])  # fmt: skip
# (x, y) of each pillar at the belt line and at the roof, a finger in front of the glass (m)
_PILLARS = (((1.06, 0.79), (0.26, 0.645)), ((-0.35, 0.80), (-0.42, 0.65)), ((-1.86, 0.78), (-1.28, 0.64)))


def car() -> dict[str, list[Triangles]]:
    """Meshes of the car by material: paint, glass, dark, rubber, metal, lamp, tail, plate.

    Its middle stands on the origin, its front looks along +x.
    """
    cabin = _plan_loops(_CABIN)
    roof = _plan_loops(_ROOF)
    parts: dict[str, list[Triangles]] = {
        "paint": [loft(_body_loops(), smooth=True), loft(roof, smooth=True)],
        "glass": [loft(cabin)],
        "dark": [
            box((0.03, 0.95, 0.13)).moved((2.19, 0.0, 0.40)),
            box((0.03, 0.80, 0.07)).moved((2.185, 0.0, 0.59)),
            box((0.03, 1.10, 0.12)).moved((-2.19, 0.0, 0.33)),
        ],
        "rubber": [],
        "metal": [],
        "lamp": [],
        "tail": [],
        "plate": [
            box((0.02, 0.52, 0.11)).moved((2.215, 0.0, 0.46)),
            box((0.02, 0.52, 0.11)).moved((-2.21, 0.0, 0.62)),
        ],
    }
    for side in (-1.0, 1.0):
        for x in (-1.33, 1.37):
            outer, inner = np.array([x, 0.87 * side, 0.32]), np.array([x, 0.64 * side, 0.32])
            parts["rubber"].append(cylinder(inner, outer, 0.32))
            parts["metal"].append(cylinder(outer, outer + np.array([0, 0.012 * side, 0]), 0.2))
            arch = np.array([x, 0.60 * side, 0.38]), np.array([x, 0.885 * side, 0.38])
            parts["dark"].append(cylinder(*arch, 0.37))
        parts["lamp"].append(ellipsoid((2.06, 0.62 * side, 0.66), (0.11, 0.17, 0.07)))
        parts["tail"].append(ellipsoid((-2.14, 0.66 * side, 0.82), (0.06, 0.14, 0.08)))
        parts["paint"].append(ellipsoid((0.72, 0.97 * side, 1.02), (0.07, 0.11, 0.075)))
        # Pillars stand a finger in front of the glass.
        for lower, upper in (
            ((1.06, 0.79), (0.26, 0.645)),
            ((-0.35, 0.80), (-0.42, 0.65)),
            ((-1.86, 0.78), (-1.28, 0.64)),
        ):
            start = np.array([lower[0], lower[1] * side, 0.93])
            end = np.array([upper[0], upper[1] * side, 1.37])
            parts["paint"].append(cylinder(start, end, 0.04, around=10))
    return parts


def _body_loops() -> NDArray[np.float64]:
    """Cross-sections of the body: rounded rectangles, wider at the belt than at the roof side."""
    angle = np.arange(40) * 2 * math.pi / 40
    across = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.42
    upwards = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.5
    x, half, bottom, top = (column[:, None] for column in _BODY.T)
    y = half * across * (1 - 0.05 * np.maximum(upwards, 0))
    z = (bottom + top) / 2 + (top - bottom) / 2 * upwards
    return np.stack([np.broadcast_to(x, y.shape), y, z], axis=-1)


def _plan_loops(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Horizontal sections: rounded rectangles from rear to front."""
    angle = np.arange(40) * 2 * math.pi / 40
    along = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.3
    across = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.3
    z, rear, front, half = (column[:, None] for column in table.T)
    x = (rear + front) / 2 + (front - rear) / 2 * along
    y = half * across * (1 - 0.06 * along)
    return np.stack([x, y, np.broadcast_to(z, y.shape)], axis=-1)
