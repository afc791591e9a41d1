"""Straight rays through the very air of a film: what its pictures must show, chance included.

The index along each line of sight is interpolated by SciPy, and its slope across the line is summed: no bent
ray, no picture and no tracking has a part in it. To first order light from a panel crosses the air along a
straight line, and a slope turns it by so much more the nearer it is to the lens.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates

from nigemizu.scene.running import AirVolume

__all__ = ["Sights"]

GOLDEN = math.pi * (3 - math.sqrt(5))


class Sights:
    """Cones of light from the square tiles of a picture to the aperture, for a camera that looks along +x.

    Parameters
    ----------
    directions : (M,) float64, rad
        Of the middles of the tiles, to the left; all at the height of the eye.
    side : float, rad
        Of the tiles.
    eye, length, aperture : float, m
        Height of the camera, distance of the panel, diameter of the lens.
    across, points : int
        Directions within a tile along each side, and points on the aperture.
    """

    def __init__(
        self, directions: np.ndarray, side: float, eye: float, length: float, aperture: float,
        *, across: int = 2, points: int = 60,
    ) -> None:  # fmt: skip
        within = side * ((np.arange(across) + 0.5) / across - 0.5)
        left, up = (part.ravel() for part in np.meshgrid(within, within))
        number = np.arange(points)
        radius, angle = np.sqrt((number + 0.5) / points) * aperture / 2, GOLDEN * number
        # [left, up], tiles, directions within, points on the aperture
        self._directions = np.stack([directions[:, None] + left, 0 * directions[:, None] + up])[..., None]
        self._aperture = np.stack([radius * np.cos(angle), radius * np.sin(angle)])[:, None, None, :]
        self._eye, self._length = eye, length

    def angles(self, air: AirVolume) -> np.ndarray:
        """Angles of arrival of the tiles through air, (M, 2) float64, rad, to the left and up."""
        x, y, z, refractivity = air[:4]
        reach = self._length * np.abs(self._directions).max() + np.abs(self._aperture).max() + y[2] - y[0]
        near = np.flatnonzero(np.abs(y) < reach)
        y, refractivity = y[near], refractivity[:, near]
        seen = np.flatnonzero((x > 0) & (x < self._length))
        fine = np.linspace(z[0], z[-1], 2 * z.size - 1)
        index = CubicSpline(z, refractivity[:, :, seen], axis=0)(fine)
        up_step, left_step = fine[1] - fine[0], y[1] - y[0]
        distance = x[seen][:, None, None, None]
        w = 1 - distance / self._length
        left, up = (distance * d + w * a for d, a in zip(self._directions, self._aperture, strict=True))
        rows, columns = (up + self._eye - fine[0]) / up_step, (left - y[0]) / left_step
        planes = np.broadcast_to(np.arange(seen.size)[:, None, None, None], rows.shape)
        # differences between neighbours stand half-way between them
        slopes = (
            map_coordinates(np.diff(index, axis=1) / left_step, [rows, columns - 0.5, planes], order=1),
            map_coordinates(np.diff(index, axis=0) / up_step, [rows - 0.5, columns, planes], order=1),
        )
        return np.stack([(x[1] - x[0]) * np.sum(w * one, axis=0).mean(axis=(1, 2)) for one in slopes], axis=1)
