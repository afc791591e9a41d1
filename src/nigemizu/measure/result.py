"""What was measured in a film, as numbers, as a table and as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from nigemizu.measure.optics import Optics

__all__ = ["Measurement", "PerTile", "Quantity", "Separations", "Temporal"]

FloatArray: TypeAlias = NDArray[np.float64]


@final
@dataclass(frozen=True)
class Quantity:
    """One line of the table.

    Attributes
    ----------
    name, words, unit : str
        For machines, and for people.
    value, low, high : float
        With its 95 % interval; NaN where it could not be had.
    theory : float or None
        What the stated turbulence gives.
    """

    name: str
    words: str
    unit: str
    value: float
    low: float = math.nan
    high: float = math.nan
    theory: float | None = None

    @property
    def ratio(self) -> float | None:
        """Measured over theory."""
        return None if not self.theory else self.value / self.theory

    @property
    def agrees(self) -> bool | None:
        """Whether the theory lies within the interval."""
        return None if self.theory is None or math.isnan(self.low) else self.low <= self.theory <= self.high


@final
@dataclass(frozen=True)
class PerTile:
    """Results of each tile, (M,) or (M, 2) for x and y.

    Attributes
    ----------
    place : (M, 2) float64, pixels
        Column and row of the middle.
    kind : tuple of str
        ``xy``, ``x``, ``y``, ``oblique`` or ``none``; see `nigemizu.measure.tiles.Texture`.
    variance : (M, 2) float64, rad2
        Of the angle of arrival, noise taken off; NaN where the tile shows no motion along the axis.
    noise : (M, 2) float64, rad2
        What was taken off.
    lost : (M,) float64
        Share of the frames in which the tile was not found.
    radius : (M,) float64, pixels
        Of the disc whose second moment its texture has.
    """

    place: FloatArray
    kind: tuple[str, ...]
    variance: FloatArray
    noise: FloatArray
    lost: FloatArray
    radius: FloatArray


@final
@dataclass(frozen=True)
class Separations:
    """Structure function of the angle of arrival, binned.

    Attributes
    ----------
    angle : (B,) float64, rad
        Mean separation of the pairs of a bin.
    along, across : (B,) float64, rad2
        Mean squared difference of the angles along the line between two tiles, and across it.
    along_theory, across_theory : (B,) float64 or None, rad2
    """

    angle: FloatArray
    along: FloatArray
    across: FloatArray
    along_theory: FloatArray | None = None
    across_theory: FloatArray | None = None


@final
@dataclass(frozen=True)
class Temporal:
    """How the displacements change in time.

    Attributes
    ----------
    lag, correlation : (K,) float64, s (or frames), 1
    frequency, power : (F,) float64, Hz (or cycles per frame), rad2/Hz
        One-sided spectrum along one axis, mean of the tiles.
    white : float, rad2/Hz
        Level of the noise in it.
    unit : str
        ``"s"``, or ``"frames"`` where the time between frames is not known.
    """

    lag: FloatArray
    correlation: FloatArray
    frequency: FloatArray
    power: FloatArray
    white: float
    unit: str


@final
@dataclass(frozen=True)
class Measurement:
    """What a film tells.

    Attributes
    ----------
    film : Path
    frames : int
    shape : (int, int)
    interval : float or None, s
    tile, search : int, pixels
    optics : Optics
    quantities : tuple of Quantity
    tiles : PerTile
    separations : Separations
    temporal : Temporal
    independent : float
        Effective number of independent frames.
    noise_share : float
        Of the variance, before it was taken off.
    common : (float, float), pixels
        Root mean square of the motion that all tiles share, along x and y.
    shake_removed : bool
    remarks : tuple of str
        What a reader should know.
    picture : (height, width) float32
        Mean of the frames.
    """

    film: Path
    frames: int
    shape: tuple[int, int]
    interval: float | None
    tile: int
    search: int
    optics: Optics
    quantities: tuple[Quantity, ...]
    tiles: PerTile
    separations: Separations
    temporal: Temporal
    independent: float
    noise_share: float
    common: tuple[float, float]
    shake_removed: bool
    remarks: tuple[str, ...]
    picture: NDArray[np.float32] = field(repr=False)

    def __getitem__(self, name: str) -> Quantity:
        """The quantity of that name."""
        return next(one for one in self.quantities if one.name == name)

    def counts(self) -> Mapping[str, int]:
        """Number of tiles of each kind."""
        kinds = ("xy", "x", "y", "oblique", "none")
        return {kind: self.tiles.kind.count(kind) for kind in kinds}

    def as_dict(self) -> dict[str, Any]:
        """All but the picture, for JSON; what is not a number is None."""
        o, t = self.optics, self.tiles
        unit = self.temporal.unit
        return {
            "film": str(self.film),
            "frames": self.frames,
            "width": self.shape[1],
            "height": self.shape[0],
            "interval": self.interval,
            "tile": self.tile,
            "search": self.search,
            "optics": {key: getattr(o, key) for key in o.__dataclass_fields__ if key != "origin"},
            "origin": dict(o.origin),
            "quantities": {
                one.name: {
                    "unit": one.unit,
                    "value": _plain(one.value),
                    "low": _plain(one.low),
                    "high": _plain(one.high),
                    "theory": _plain(one.theory),
                    "ratio": _plain(one.ratio),
                    "within": one.agrees,
                }
                for one in self.quantities
            },
            "independent_frames": _plain(self.independent),
            "noise_share": _plain(self.noise_share),
            "common_motion_pixels": [_plain(one) for one in self.common],
            "shake_removed": self.shake_removed,
            "tile_kinds": self.counts(),
            "tiles": [
                {
                    "x": float(t.place[i, 0]),
                    "y": float(t.place[i, 1]),
                    "kind": t.kind[i],
                    "variance": [_plain(one) for one in t.variance[i]],
                    "noise": [_plain(one) for one in t.noise[i]],
                    "lost": float(t.lost[i]),
                }
                for i in range(len(t.kind))
            ],
            "differences": {
                key: _plain_list(getattr(self.separations, key))
                for key in self.separations.__dataclass_fields__
            },
            "temporal": {
                "unit": unit,
                "white": _plain(self.temporal.white),
                **{
                    key: _plain_list(getattr(self.temporal, key))
                    for key in ("lag", "correlation", "frequency", "power")
                },
            },
            "remarks": list(self.remarks),
        }

    def table(self) -> str:
        """What people read."""
        return "\n".join([*self._heading(), "", *_rows(self.quantities), *self._remarks()])

    def _heading(self) -> list[str]:
        o, kinds = self.optics, self.counts()
        time = "" if self.interval is None else f", one every {self.interval:.4g} s"
        shown = [
            f"{kinds['xy']} show motion in x and y",
            *(f"{kinds[k]} in {k} alone" for k in "xy" if kinds[k]),
            *([f"{kinds['oblique']} across a slanting edge"] if kinds["oblique"] else []),
            *([f"{kinds['none']} have no texture"] if kinds["none"] else []),
        ]
        lens = "pinhole" if o.aperture == 0 else f"aperture {1e3 * o.aperture:.4g} mm"
        scales = "" if o.inner_scale == 0 else f", inner scale {1e3 * o.inner_scale:.3g} mm"
        scales += "" if o.outer_scale is None else f", outer scale {o.outer_scale:.3g} m"
        scales += "" if o.largest is None else f", no eddies above {o.largest:.3g} m"
        prefix = "the scene's "
        sources = sorted({words.removeprefix(prefix) for words in o.origin.values() if words != "typed"})
        shake = "taken out" if self.shake_removed else "left in (--remove-shake takes it out)"
        x, y = self.common
        return [
            f"{self.film}: {self.frames} frames of {self.shape[1]}×{self.shape[0]} pixels{time}",
            f"tiles of {self.tile} pixels: {', '.join(shown)}",
            f"path {o.distance:.5g} m, {lens}, {1e6 * o.pixel_angle:.4g} µrad per pixel, "
            f"{1e9 * o.wavelength:.4g} nm, {o.wave} wave{scales}"
            + (f" (of {prefix}{', '.join(sources)})" if sources else ""),
            f"independent frames {self.independent:.0f}; noise {100 * self.noise_share:.2g} % of the "
            "variance, taken off",
            f"motion common to all tiles: {x:.3g} pixels in x, {y:.3g} in y (rms), {shake}",
        ]

    def _remarks(self) -> list[str]:
        return ["", *(f"note: {words}" for words in self.remarks)] if self.remarks else []


def _rows(quantities: tuple[Quantity, ...]) -> list[str]:
    with_theory = any(one.theory is not None for one in quantities)
    head = ["quantity", "unit", "measured", "95 % interval"]
    head += ["theory", "ratio", ""] if with_theory else []
    lines = [head]
    for one in quantities:
        line = [one.words, one.unit, _short(one.value), _range(one)]
        if with_theory:
            ratio = one.ratio
            verdict = {None: "", True: "within", False: "outside"}[one.agrees]
            line += [_short(one.theory), "" if ratio is None else f"{ratio:.3f}", verdict]
        lines.append(line)
    widths = [max(len(line[column]) for line in lines) for column in range(len(head))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
            for line in lines]  # fmt: skip


def _range(one: Quantity) -> str:
    if math.isnan(one.low) or math.isnan(one.high):
        return ""
    return f"{_short(one.low)} to {_short(one.high)}"


def _short(value: float | None) -> str:
    if value is None or math.isnan(value):
        return "" if value is None else "unknown"
    return f"{value:.4g}"


def _plain(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _plain_list(values: FloatArray | None) -> list[float | None] | None:
    return None if values is None else [_plain(float(one)) for one in values]
