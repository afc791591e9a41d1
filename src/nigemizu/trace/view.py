"""Coordinates of the rays that leave one eye, in which neighbouring rays can share their paths."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Final, final

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from nigemizu.field import Types

__all__ = ["ElevationView", "View", "spread"]

FloatArray = NDArray[np.float64]

_PLASTIC: Final = 1.32471795724474602596  # the real root of x³ = x + 1


class View(ABC):
    """A map from directions to places (x, y), about one pixel of the picture apart.

    Parameters
    ----------
    eye : (3,) float64, m
        Where all the rays begin.
    size : (width, height) float, pixels
        The map covers [0, width] × [0, height].
    pixel_angle : float, rad
        Angle between rays one pixel apart.
    """

    def __init__(self, eye: FloatArray, size: tuple[float, float], pixel_angle: float) -> None:
        self.eye = np.asarray(eye, dtype=np.float64)
        self.size = size
        self.pixel_angle = pixel_angle

    @abstractmethod
    def directions(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Unit directions (N, 3) float64 of the places x, y (N,), which may lie a little outside."""

    @abstractmethod
    def locate(self, direction: Any) -> tuple[Any, Any]:
        """Place (Float, Float) of a direction (Array3f, unit length) on the device."""

    def rays(self, types: Types, x: FloatArray, y: FloatArray) -> tuple[Any, Any]:
        """The eye, as data of the kernel, and the directions of places x, y (N,), on the device (Array3f)."""
        eye = types.Array3f(*(dr.opaque(types.Float, float(place)) for place in self.eye))
        return eye, types.Array3f(np.ascontiguousarray(self.directions(x, y).T))

    def to_frame(self, direction: Any, vector: Any) -> Any:
        """A vector (Array3f) in the axes in which offsets of this ray are kept; by default the air's."""
        return vector

    def from_frame(self, direction: Any, vector: Any) -> Any:
        """The inverse of `to_frame`."""
        return vector

    def boxes(self, boxes: FloatArray) -> FloatArray:
        """Boxes (N, 2, 3) of the air's axes [m] as boxes about the eye in the frame of the offsets."""
        return boxes - self.eye


@final
class ElevationView(View):
    """Rays through air that varies with height alone: only their elevation matters, for every azimuth.

    Parameters
    ----------
    eye : (3,) float64, m
    elevations : (low, high) float, rad
        The range that is to be seen.
    pixel_angle : float, rad

    Notes
    -----
    y counts the elevation downwards from the highest, in pixels; x is 0. Offsets are kept along the ray's
    horizontal heading, to its left, and upwards. A ray straight up or down has no heading; any one serves.
    """

    def __init__(self, eye: FloatArray, elevations: tuple[float, float], pixel_angle: float) -> None:
        low, self._high = (float(elevation) for elevation in elevations)
        super().__init__(eye, (0.0, (self._high - low) / pixel_angle), pixel_angle)

    def directions(self, x: FloatArray, y: FloatArray) -> FloatArray:
        elevation = np.clip(self._high - y * self.pixel_angle, -0.5 * np.pi, 0.5 * np.pi)
        return np.stack([np.cos(elevation), np.zeros_like(elevation), np.sin(elevation)], axis=-1)

    def locate(self, direction: Any) -> tuple[Any, Any]:
        elevation = dr.atan2(
            direction.z, dr.sqrt(dr.fma(direction.x, direction.x, direction.y * direction.y))
        )
        Float = type(elevation)
        # Opaque: a camera that tilts does not compile the kernel again.
        high, per_pixel = dr.opaque(Float, self._high), dr.opaque(Float, 1 / self.pixel_angle)
        return Float(0), (high - elevation) * per_pixel

    def to_frame(self, direction: Any, vector: Any) -> Any:
        c, s = self._heading(direction)
        return type(vector)(c * vector.x + s * vector.y, c * vector.y - s * vector.x, vector.z)

    def from_frame(self, direction: Any, vector: Any) -> Any:
        c, s = self._heading(direction)
        return type(vector)(c * vector.x - s * vector.y, s * vector.x + c * vector.y, vector.z)

    def boxes(self, boxes: FloatArray) -> FloatArray:
        about = boxes - self.eye
        lower, upper = about[:, 0, :2], about[:, 1, :2]
        nearest = np.linalg.norm(np.clip(0.0, lower, upper), axis=1)
        farthest = np.linalg.norm(np.maximum(np.abs(lower), np.abs(upper)), axis=1)
        everywhere = np.full_like(nearest, np.inf)
        return np.stack(
            [
                np.stack([nearest, -everywhere, about[:, 0, 2]], axis=1),
                np.stack([farthest, everywhere, about[:, 1, 2]], axis=1),
            ],
            axis=1,
        )

    @staticmethod
    def _heading(direction: Any) -> tuple[Any, Any]:
        level = dr.sqrt(dr.fma(direction.x, direction.x, direction.y * direction.y))
        steep = level < 1e-12
        inverse = dr.rcp(dr.select(steep, 1, level))
        return dr.select(steep, 1, direction.x * inverse), dr.select(steep, 0, direction.y * inverse)


def spread(count: int) -> tuple[FloatArray, FloatArray]:
    """Places (count,), (count,) that fill the unit square evenly: the sequence R2.

    References
    ----------
    M. Roberts (2018), The unreasonable effectiveness of quasirandom sequences.
    """
    number = np.arange(1, count + 1)
    return (0.5 + number / _PLASTIC) % 1.0, (0.5 + number / _PLASTIC**2) % 1.0
