"""The table of astronomical refraction: by how much a scene's air lifts the stars."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.scene.measuring.columns import FIGURES, SUFFIXES, Column, records, text_table, write_table
from nigemizu.scene.measuring.index import SceneIndex

if TYPE_CHECKING:
    import xarray

    from nigemizu.scene.model import Scene

__all__ = ["RefractionTable", "refraction_table"]

FloatArray: TypeAlias = NDArray[np.float64]

_TENTHS: Final = 901  # of degrees, from the horizon to the zenith
_SHOWN: Final = (0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0)
_TOLERANCE: Final = 1e-10  # rad
_JUST_ABOVE: Final = 1 - 1e-9  # of the dip
_SECONDS: Final = 3600 * 180 / math.pi


@final
@dataclass(frozen=True)
class RefractionTable:
    """Astronomical refraction of N elevations at K wavelengths.

    Attributes
    ----------
    elevation : (N,) float64, degrees
        Apparent, at the eye.
    wavelength : (K,) float64, m
    refraction : (N, K) float64, rad
        Apparent less true elevation; NaN where the ray does not leave the air.
    status : (N, K) intp
        `nigemizu.trace.RefractionStatus`.
    eye : float, m
        Height of the eye.
    scene : Scene
    """

    elevation: FloatArray
    wavelength: FloatArray
    refraction: FloatArray
    status: NDArray[np.intp]
    eye: float
    scene: Scene

    @property
    def true_elevation(self) -> FloatArray:
        """(N, K), degrees — where the star would be seen without air."""
        return np.asarray(self.elevation[:, None] - np.degrees(self.refraction))

    def as_records(self) -> list[dict[str, Any]]:
        """One JSON-ready record per elevation and wavelength, as ``nigemizu trace --table`` prints them."""
        return records(self._columns())

    def as_dict(self) -> dict[str, Any]:
        """All of it, JSON-ready."""
        return {"eye_height": self.eye, "refraction": self.as_records()}

    def to_dataset(self) -> xarray.Dataset:
        """Refraction and true elevation over ``(elevation, wavelength)``."""
        import xarray

        over = ("elevation", "wavelength")
        words = " ".join(status.name.lower() for status in _statuses())
        codes = np.array([int(status) for status in _statuses()], dtype=np.int8)
        variables: dict[str, Any] = {
            "refraction": (over, self.refraction, {"units": "rad", "long_name": "astronomical refraction"}),
            "true_elevation": (over, self.true_elevation, {"units": "degree"}),
            "status": (over, self.status.astype(np.int8), {"flag_values": codes, "flag_meanings": words}),
        }
        coordinates: dict[str, Any] = {
            "elevation": (
                "elevation",
                self.elevation,
                {"units": "degree", "long_name": "apparent elevation"},
            ),
            "wavelength": ("wavelength", self.wavelength, {"units": "m", "long_name": "vacuum wavelength"}),
        }
        attributes = {
            "title": self.scene.title,
            "eye_height": self.eye,
            "nigemizu_scene": self.scene.to_toml(),
        }
        return xarray.Dataset(variables, coordinates, attributes)

    def table(self) -> str:
        """What people read: refraction in seconds of arc, and the true elevation of the first wavelength."""
        asked = np.array(_SHOWN)
        rows = list(range(len(self.elevation)))
        if len(self.elevation) > 2 * len(asked):
            below = self.elevation < 0.0
            near = np.abs(self.elevation[:, None] - asked).min(axis=1) < 1e-6
            edge = np.flatnonzero(below & np.isfinite(self.refraction[:, 0]))[:1]
            rows = sorted({*np.flatnonzero(near).tolist(), *edge.tolist()})
        columns = [Column("apparent", self.elevation, "apparent [°]", 3)]
        columns += [
            Column("refraction", _SECONDS * self.refraction[:, k], f"{1e9 * length:.4g} nm [″]", 3)
            for k, length in enumerate(self.wavelength)
        ]
        colour = f"true, {1e9 * self.wavelength[0]:.4g} nm [°]" if len(self.wavelength) > 1 else "true [°]"
        columns.append(Column("true", self.true_elevation[:, 0], colour, 6))
        if np.any(self.status[rows] != 0):
            words = [_statuses()[code].name.lower() for code in self.status[:, 0]]
            columns.append(Column("status", np.array(words, dtype=object), "ray"))
        title = f"{self.scene.title}: " if self.scene.title else ""
        heading = f"{title}astronomical refraction, eye at {self.eye:g} m"
        return "\n".join([heading, "", *text_table(columns, rows)])

    def save(self, path: str | os.PathLike[str], *, command: str = "") -> Path:
        """Write ``.csv``, ``.nc``, ``.json``, or the figure (``.svg``, ``.png``, ``.pdf``)."""
        from nigemizu.output import Provenance, ready_to_write

        target = ready_to_write(path, SUFFIXES)
        if target.suffix.lower() not in FIGURES:
            return write_table(target, self._columns(), self.to_dataset(), self.as_dict(), command)
        from nigemizu.output.curves import RefractionFigure, refraction_figure

        order = np.argsort(self.elevation, kind="stable")
        shown = RefractionFigure(
            np.radians(self.elevation[order]), self.wavelength, self.refraction[order], self.scene.title
        )
        about = Provenance(scene=self.scene.to_toml(), command=command)
        return refraction_figure(target, shown, provenance=about)

    def _columns(self) -> list[Column]:
        count = len(self.wavelength)
        names = [status.name.lower() for status in _statuses()]
        return [
            Column("wavelength", np.tile(self.wavelength, len(self.elevation))),
            Column("apparent_elevation_deg", np.repeat(self.elevation, count)),
            Column("true_elevation_deg", self.true_elevation.ravel()),
            Column("refraction_arcsec", _SECONDS * self.refraction.ravel()),
            Column("refraction_deg", np.degrees(self.refraction).ravel()),
            Column("status", np.array([names[code] for code in self.status.ravel()], dtype=object)),
        ]


def refraction_table(
    scene: Scene,
    elevations: Iterable[float] | None = None,
    wavelengths: Iterable[float] | None = None,
) -> RefractionTable:
    """Astronomical refraction through the layers of a scene, seen by its camera's eye.

    Parameters
    ----------
    scene : Scene
        With a section ``[profile]`` and a round ``[earth]``.
    elevations : iterable of float, degrees, optional
        Apparent. Every tenth of a degree from 0° to 90° unless given, and below 0° every hundredth down to
        the horizon of an eye that stands high.
    wavelengths : iterable of float, m, optional
        In vacuum; that of ``air.wavelength`` unless given.

    Returns
    -------
    RefractionTable

    Raises
    ------
    InputError
        The scene has no profile or a flat Earth, or an elevation or a wavelength is out of range.

    Notes
    -----
    By the integral of `nigemizu.trace.astronomical_refraction` over the profile's own layers. Air that is
    heated on a mesh is left out, and so is what differs along the line of sight. Rays end on the ground of
    the scene, or where the profile begins; what is left of the air at the top of the profile bends them
    once more.

    Examples
    --------
    >>> from nigemizu.scene import Scene
    >>> scene = Scene.from_toml('earth = {}\\nprofile = { kind = "us1976" }')
    >>> table = refraction_table(scene, [0.0, 45.0], [550e-9])
    >>> (np.degrees(table.refraction) * 3600).round(2).ravel().tolist()  # seconds of arc
    [1980.24, 57.16]
    """
    from nigemizu.trace import refracted_rays

    index = SceneIndex.of(scene, wavelengths)
    eye = scene.camera.eye[2]
    apparent = _elevations(index, eye, elevations)
    rays = refracted_rays(
        index,
        np.radians(apparent),
        **index.limits(),
        observer_height=eye,
        into_vacuum=True,
        tolerance=_TOLERANCE,
    )
    return RefractionTable(apparent, index.wavelengths, rays.refraction, rays.status, eye, scene)


def _elevations(index: SceneIndex, eye: float, asked: Iterable[float] | None) -> FloatArray:
    if asked is None:
        from nigemizu.trace import horizon

        dips = horizon(index, eye, **index.limits()).dip if eye > index.ground else np.zeros(1)
        dip = math.degrees(float(np.nanmax(dips, initial=0.0)))
        below = [-dip * _JUST_ABOVE, *(-np.arange(1, int(dip * 100) + 1) / 100)] if dip > 0.0 else []
        return np.unique(np.concatenate([below, np.linspace(0.0, 90.0, _TENTHS)]))
    values = np.array(list(asked), dtype=np.float64)
    if not values.size or not np.all(np.abs(values) <= 90.0):
        wrong = None if not values.size else float(values[np.argmax(~(np.abs(values) <= 90.0))])
        raise InputError("no elevation", key="elevation", value=wrong, expected="degrees from -90 to 90")
    return values


def _statuses() -> list[Any]:
    from nigemizu.trace import RefractionStatus

    return list(RefractionStatus)
