"""The table of the horizon: its dip and distance from eyes at several heights."""

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

__all__ = ["HorizonTable", "horizon_table"]

FloatArray: TypeAlias = NDArray[np.float64]

_MINUTES: Final = 60 * 180 / math.pi
_HEIGHTS: Final = (1.5, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)


@final
@dataclass(frozen=True)
class HorizonTable:
    """The horizon of the sea from N heights.

    Attributes
    ----------
    height : (N,) float64, m
        Of the eye, above the sea.
    dip : (N,) float64, rad
        Angle by which the horizon lies below the level of the eye; NaN where a duct hides it.
    distance : (N,) float64, m
        To it, along the surface.
    geometric_dip : (N,) float64, rad
        Dip without air.
    refraction_coefficient : (N,) float64, 1
        k = −(r/n) dn/dh at the eye: curvature of a level ray in units of the Earth's.
    effective_radius : (N,) float64, 1
        1/(1 − k): radius, in units of the Earth's, of the sphere over which that ray is straight; infinite
        or negative in a duct.
    wavelength : float, m
    scene : Scene
    """

    height: FloatArray
    dip: FloatArray
    distance: FloatArray
    geometric_dip: FloatArray
    refraction_coefficient: FloatArray
    effective_radius: FloatArray
    wavelength: float
    scene: Scene

    def as_records(self) -> list[dict[str, Any]]:
        """One JSON-ready record per height, as ``nigemizu trace --table horizon --json`` prints them."""
        return records(self._columns())

    def as_dict(self) -> dict[str, Any]:
        """All of it, JSON-ready."""
        return {"wavelength": self.wavelength, "horizon": self.as_records()}

    def to_dataset(self) -> xarray.Dataset:
        """The table over ``height``."""
        import xarray

        per = "height"
        variables: dict[str, Any] = {
            "dip": (per, self.dip, {"units": "rad", "long_name": "dip of the horizon"}),
            "distance": (per, self.distance, {"units": "m", "long_name": "distance of the horizon"}),
            "geometric_dip": (per, self.geometric_dip, {"units": "rad", "long_name": "dip without air"}),
            "refraction_coefficient": (per, self.refraction_coefficient, {"units": "1"}),
            "effective_radius": (per, self.effective_radius, {"units": "1"}),
        }
        coordinates = {per: (per, self.height, {"units": "m", "long_name": "height of the eye"})}
        attributes = {
            "title": self.scene.title,
            "wavelength": self.wavelength,
            "nigemizu_scene": self.scene.to_toml(),
        }
        return xarray.Dataset(variables, coordinates, attributes)

    def table(self) -> str:
        """What people read."""
        title = f"{self.scene.title}: " if self.scene.title else ""
        heading = f"{title}horizon of the sea, {1e9 * self.wavelength:.4g} nm"
        return "\n".join([heading, "", *text_table(self._columns(), range(len(self.height)))])

    def save(self, path: str | os.PathLike[str], *, command: str = "") -> Path:
        """Write ``.csv``, ``.nc`` or ``.json``."""
        from nigemizu.output import ready_to_write

        kinds = tuple(suffix for suffix in SUFFIXES if suffix not in FIGURES)
        target = ready_to_write(path, kinds)
        return write_table(target, self._columns(), self.to_dataset(), self.as_dict(), command)

    def _columns(self) -> list[Column]:
        return [
            Column("height", self.height, "eye [m]", 2),
            Column("dip_arcmin", _MINUTES * self.dip, "dip [′]", 4),
            Column("distance_km", self.distance / 1e3, "distance [km]", 4),
            Column("geometric_dip_arcmin", _MINUTES * self.geometric_dip, "without air [′]", 4),
            Column("refraction_coefficient", self.refraction_coefficient, "k", 4),
            Column("effective_radius", self.effective_radius, "R_eff/R", 4),
        ]


def horizon_table(scene: Scene, heights: Iterable[float] | None = None) -> HorizonTable:
    """Dip and distance of the horizon through the layers of a scene.

    Parameters
    ----------
    scene : Scene
        With a section ``[profile]`` and a round ``[earth]``.
    heights : iterable of float, m, optional
        Of the eye above the sea; 1.5 m to 1 km unless given.

    Returns
    -------
    HorizonTable

    Raises
    ------
    InputError
        The scene has no profile or a flat Earth, or a height is out of range.

    Notes
    -----
    Bouguer's invariant, n r cos θ, of the ray that grazes the surface (`nigemizu.trace.horizon`), which is
    the scene's ground, or where the profile begins; the geometric dip is arccos((R + ground)/(R + h)).

    Examples
    --------
    >>> from nigemizu.scene import Scene
    >>> scene = Scene.from_toml('earth = {}\\nprofile = { kind = "us1976" }')
    >>> table = horizon_table(scene, [10.0])
    >>> round(float(np.degrees(table.dip[0])) * 60, 3), round(float(table.distance[0]) / 1e3, 2)
    (5.55, 12.39)
    """
    from nigemizu.trace import horizon, refraction_coefficient

    index = SceneIndex.of(scene, None)
    values = np.array(_HEIGHTS if heights is None else list(heights), dtype=np.float64)
    if heights is None:
        values = values[(values > index.ground) & (values < index.top)]
    fits = (values >= index.ground) & (values < index.top)
    if not values.size or not np.all(fits):
        wrong = None if not values.size else float(values[np.argmax(~fits)])
        raise InputError(
            "no eye can be there",
            key="height",
            value=wrong,
            expected=f"metres from the ground at {index.ground:g} to below the top at {index.top:g}",
        )
    seen = horizon(index, values, **index.limits())
    coefficient = refraction_coefficient(index, values, radius=index.radius)
    with np.errstate(divide="ignore"):
        effective = 1.0 / (1.0 - coefficient[:, 0])
    # cos dip = (R + ground)/(R + h), by the tangent of half the angle, which keeps its digits
    rise = (values - index.ground) / (2 * (index.radius + index.ground) + values - index.ground)
    return HorizonTable(
        height=values,
        dip=seen.dip[:, 0],
        distance=seen.distance[:, 0],
        geometric_dip=2 * np.arctan(np.sqrt(rise)),
        refraction_coefficient=coefficient[:, 0],
        effective_radius=effective,
        wavelength=float(index.wavelengths[0]),
        scene=scene,
    )
