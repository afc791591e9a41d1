"""The transfer curve as a result: images, folds, rays, and the files that they go to."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.scene.far_air import natural
from nigemizu.scene.measuring.columns import FIGURES, SUFFIXES, Column, records, text_table, write_table
from nigemizu.scene.measuring.folds import Fold, ImageBand, image_count

if TYPE_CHECKING:
    import xarray

    from nigemizu.scene.model import Scene
    from nigemizu.scene.running import AirVolume

__all__ = ["TransferCurve"]

FloatArray: TypeAlias = NDArray[np.float64]

_SHOWN_ROWS: Final = 25
_ARCMIN: Final = 60 * 180 / math.pi


@final
@dataclass(frozen=True)
class TransferCurve:
    """What is seen of an object at a distance; N is the number of elevations.

    Attributes
    ----------
    distance : float, m
        Of the object from the eye, along the surface of the Earth.
    elevation : (N,) float64, degrees
        Apparent, at the eye.
    height : (N,) float64, m
        Above the sea, at the distance, of what is seen there; NaN where the ray met the ground before, or
        left the air.
    ground_distance : (N,) float64, m
        At which the ray met the ground; NaN if it did not.
    slope : (N,) float64, m/rad
        dh/de: 0 at folds, below 0 where the image is inverted.
    magnification : (N,) float64, 1
        Vertical angular size relative to that without air, de/dh × dh₀/de: above 1 stretched (towering),
        below 1 compressed (stooping), negative inverted; without bounds at folds.
    images : (N,) int64
        How many of the bands show this height; 0 where there is none.
    straight : (N,) float64, m
        Height that would be seen without air.
    folds : tuple of Fold
        Elevations [rad] where an erect image and an inverted one meet.
    bands : tuple of ImageBand
        Elevations [rad] over which one image is seen.
    fan : (3, M) float64, rad, m and m
        Elevations among which folds were sought, the heights that are seen, and those without air.
    scene : Scene, optional
    air : AirVolume, optional
        Through which air.

    Notes
    -----
    Limits: two folds closer together than three elevations of the fan, 1/2000 of its span, are not found;
    ducts can have any number of them. The images that are counted are those within the fan.
    """

    distance: float
    elevation: FloatArray
    height: FloatArray
    ground_distance: FloatArray
    slope: FloatArray
    magnification: FloatArray
    images: NDArray[np.int64]
    straight: FloatArray
    folds: tuple[Fold, ...]
    bands: tuple[ImageBand, ...]
    fan: FloatArray
    scene: Scene | None = None
    air: AirVolume | None = None

    def count(self, height: ArrayLike) -> NDArray[np.int64]:
        """How many images of each height [m] are seen."""
        return image_count(self.bands, height)

    def as_records(self) -> list[dict[str, Any]]:
        """One JSON-ready record per elevation."""
        return records(self._columns())

    def as_dict(self) -> dict[str, Any]:
        """All of it, JSON-ready, as ``nigemizu trace --table transfer --json`` prints it."""
        return {
            "distance": self.distance,
            "folds": [
                {"elevation": math.degrees(fold.elevation), "height": fold.height, "kind": fold.kind}
                for fold in self.folds
            ],
            "bands": [
                {
                    "low": math.degrees(band.low),
                    "high": math.degrees(band.high),
                    "low_height": band.low_height,
                    "high_height": band.high_height,
                    "erect": band.erect,
                }
                for band in self.bands
            ],
            "rays": self.as_records(),
        }

    def to_dataset(self) -> xarray.Dataset:
        """The curve over ``elevation``, with ``fold`` and ``band`` beside it."""
        import xarray

        per = "elevation"
        variables: dict[str, Any] = {
            "height": (per, self.height, {"units": "m", "long_name": "height that is seen at the distance"}),
            "ground_distance": (per, self.ground_distance, {"units": "m"}),
            "slope": (per, self.slope, {"units": "m rad-1"}),
            "magnification": (per, self.magnification, {"units": "1"}),
            "straight_height": (per, self.straight, {"units": "m", "long_name": "height without air"}),
            "images": (per, self.images, {"units": "1", "long_name": "number of images of this height"}),
            "fold_elevation": ("fold", np.degrees([f.elevation for f in self.folds]), {"units": "degree"}),
            "fold_height": ("fold", np.array([f.height for f in self.folds]), {"units": "m"}),
        }
        for name, unit in (("low", "degree"), ("high", "degree"), ("low_height", "m"), ("high_height", "m")):
            values = np.array([getattr(band, name) for band in self.bands])
            variables[f"band_{name}"] = (
                "band",
                np.degrees(values) if unit == "degree" else values,
                {"units": unit},
            )
        erect = np.array([band.erect for band in self.bands], dtype=np.int8)
        variables["band_erect"] = ("band", erect, {"flag_values": [0, 1], "flag_meanings": "inverted erect"})
        attributes: dict[str, Any] = {"distance": self.distance, "distance_units": "m"}
        if self.scene is not None:
            attributes |= {"title": self.scene.title, "nigemizu_scene": self.scene.to_toml()}
        coordinates = {per: (per, self.elevation, {"units": "degree", "long_name": "apparent elevation"})}
        return xarray.Dataset(variables, coordinates, attributes)

    def table(self, *, rays: bool = True) -> str:
        """What people read: the images, the folds, and the rays unless left out."""
        lines = [*self._heading(), "", *text_table(*self._band_table())]
        if rays:
            rows = np.unique(np.linspace(0, len(self.elevation) - 1, _SHOWN_ROWS).astype(int))
            lines += ["", *text_table(self._columns(), rows.tolist())]
        return "\n".join(lines)

    def save(self, path: str | os.PathLike[str], *, command: str = "") -> Path:
        """Write ``.csv``, ``.nc``, ``.json``, or the figure (``.svg``, ``.png``, ``.pdf``)."""
        from nigemizu.output import ready_to_write

        target = ready_to_write(path, SUFFIXES)
        if target.suffix.lower() in FIGURES:
            return self._draw(target, command)
        return write_table(target, self._columns(), self.to_dataset(), self.as_dict(), command)

    def _heading(self) -> list[str]:
        count = len(self.bands)
        words = f"{count} image{'s' * (count != 1)}, {len(self.folds)} fold{'s' * (len(self.folds) != 1)}"
        title = f"{self.scene.title}: " if self.scene is not None and self.scene.title else ""
        return [f"{title}object at {self.distance / 1e3:.6g} km: {words}"]

    def _band_table(self) -> tuple[list[Column], list[int]]:
        low, high = (
            np.array([getattr(b, n) for b in self.bands]) * _ARCMIN for n in ("low", "high")
        )  # fmt: skip
        columns = [
            Column("image", np.array(["erect" if b.erect else "inverted" for b in self.bands], dtype=object)),
            Column("from", low, "from [′]", 3),
            Column("to", high, "to [′]", 3),
            Column("seen_from", np.array([b.low_height for b in self.bands]), "heights from [m]", 3),
            Column("seen_to", np.array([b.high_height for b in self.bands]), "to [m]", 3),
        ]
        return columns, list(range(len(self.bands)))

    def _columns(self) -> list[Column]:
        return [
            Column("elevation_deg", self.elevation, "elevation [°]", 5),
            Column("height", self.height, "height [m]", 4),
            Column("straight_height", self.straight, "without air [m]", 4),
            Column("ground_distance", self.ground_distance, "ground at [m]", 2),
            Column("slope", self.slope, "dh/de [m/rad]", 1),
            Column("magnification", self.magnification, "magnification", 3),
            Column("images", self.images, "images", 0),
        ]

    def _draw(self, path: Path, command: str) -> Path:
        from nigemizu.output import Profile, Provenance
        from nigemizu.output.curves import TransferFigure, transfer_figure

        profile, eye, title, scene = None, None, "", ""
        if self.scene is not None and self.air is not None:
            heights, bare = natural(self.scene, self.air)
            profile = Profile(heights, bare.mean(axis=(1, 2)), self.air.temperature)
            eye, title, scene = self.scene.camera.eye[2], self.scene.title, self.scene.to_toml()
        figure = TransferFigure(
            distance=self.distance,
            elevation=self.fan[0],
            height=self.fan[1],
            straight=self.fan[2],
            folds=[(fold.elevation, fold.height, fold.kind == "lowest") for fold in self.folds],
            bands=[(band.low, band.high, band.erect) for band in self.bands],
            profile=profile,
            eye=eye,
            title=title,
        )
        return transfer_figure(path, figure, provenance=Provenance(scene=scene, command=command))
