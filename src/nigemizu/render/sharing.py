"""The picture's view of the air: which rays of a sensor can share their paths."""

from __future__ import annotations

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.render.frame import Frame
from nigemizu.render.pinhole import Pinhole
from nigemizu.trace import ElevationView, View

__all__ = ["FilmView", "view_of"]

FloatArray = NDArray[np.float64]


@final
class FilmView(View):
    """The film of a pinhole camera, in the air's axes.

    Parameters
    ----------
    pinhole : Pinhole
        The camera, in scene axes.
    frame : Frame
        Where the air stands in the scene.
    """

    def __init__(self, pinhole: Pinhole, frame: Frame) -> None:
        width, height = pinhole.size
        super().__init__(_eye(pinhole, frame), (float(width), float(height)), pinhole.pixel_angle)
        self._pinhole = pinhole
        self._frame = frame

    def directions(self, x: FloatArray, y: FloatArray) -> FloatArray:
        return self._pinhole.directions(x, y) @ self._frame.rotation

    def locate(self, direction: Any) -> tuple[Any, Any]:
        if not self._frame.is_identity:
            rows = [type(direction)(*row) for row in self._frame.rotation.tolist()]
            direction = type(direction)(*(_dot(row, direction) for row in rows))
        return self._pinhole.film_position(direction)


def view_of(pinhole: Pinhole, frame: Frame, *, stratified: bool) -> View:
    """The film, or elevations alone where the air is the same in all azimuths."""
    film = FilmView(pinhole, frame)
    if not stratified:
        return film
    width, height = film.size
    # The highest and lowest elevation lie on the edge, or where the film has the zenith in it.
    x, y = np.meshgrid(np.linspace(0, width, 65), np.linspace(0, height, 65))
    elevation = np.arcsin(np.clip(film.directions(x.ravel(), y.ravel())[:, 2], -1, 1))
    margin = 2 * film.pixel_angle + np.ptp(elevation) / 64
    low, high = elevation.min() - margin, elevation.max() + margin
    return ElevationView(film.eye, (max(low, -np.pi / 2), min(high, np.pi / 2)), film.pixel_angle)


def _eye(pinhole: Pinhole, frame: Frame) -> FloatArray:
    return np.asarray((pinhole.origin - frame.origin) @ frame.rotation / frame.scale)


def _dot(a: Any, b: Any) -> Any:
    return a.x * b.x + a.y * b.y + a.z * b.z
