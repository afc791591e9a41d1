"""The levels of a sounding as they stand in a file: checked, and doubles merged."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.heat.reading.soundings import heights

__all__ = ["BELIEVABLE", "HUMIDITIES", "SWINGS", "Levels", "checked", "counted", "listed"]

FloatArray: TypeAlias = NDArray[np.float64]

HUMIDITIES: Final = (
    "vapour_fraction",
    "dew_point",
    "mixing_ratio",
    "specific_humidity",
    "relative_humidity",
)
"""What may tell the vapour; the first that a level has counts."""

BELIEVABLE: Final = {
    "pressure": (0.1, 1.2e5, "0.1 to 120000 Pa"),
    "height": (-500.0, 1e5, "−500 to 100000 m"),
    "temperature": (120.0, 400.0, "120 to 400 K"),
    "dew_point": (120.0, 400.0, "120 to 400 K"),
    "relative_humidity": (0.0, 1.05, "0 to 1, or 0 to 100 %"),
    "mixing_ratio": (0.0, 0.2, "0 to 0.2 kg/kg"),
    "specific_humidity": (-1e-3, 0.2, "0 to 0.2 kg/kg"),
    "vapour_fraction": (0.0, 0.3, "0 to 0.3"),
    "wind_speed": (0.0, 200.0, "0 to 200 m/s"),
    "wind_direction": (0.0, 360.0, "0 to 360 degrees"),
}
"""Range of the SI values, and the words for it."""

SWINGS: Final = 50.0
"""m; how far a balloon may sink for a moment, of `Levels.sinks`."""

_THINNEST: Final = 2000.0  # Pa, of the lowest level
_FEWEST: Final = 3
_STEEPEST: Final = 20.0
"""Most that the pressure falls from a level to the next, as a factor; beyond, units are mixed."""
_MISFIT: Final = 0.1
_ROUNDED: Final = 10.0  # Pa, of two pressures given to 0.1 hPa
_APART: Final = 3.0  # K, of two reports of one level
_CHECKED_OVER: Final = 500.0  # m; thinner layers are dominated by rounding


@dataclass(frozen=True, eq=False)
class Levels:
    """The levels of one sounding as they stand in the file, in SI; NaN where a value is missing.

    Attributes
    ----------
    rows : sequence of str
        Where each level stands, as ``"line 12"``.
    values : dict of str to ndarray
        Keys of `BELIEVABLE`; at least temperature, and pressure or height.
    shown : dict of str to sequence of str
        The texts of the file, for errors.
    geopotential : bool
        Heights are geopotential metres.
    from_ground : bool
        Heights count from the ground of the station.
    sinks : float, m
        How far a balloon may sink; such rows are left out.
    """

    rows: Sequence[str]
    values: dict[str, FloatArray]
    shown: Mapping[str, Sequence[str]] = field(default_factory=dict)
    geopotential: bool = True
    from_ground: bool = False
    sinks: float = 0.0
    station_height: float | None = None
    time: datetime | None = None
    place: tuple[float, float] | None = None
    station: str | None = None
    source: str = ""
    notes: tuple[str, ...] = ()

    def kept(self, mask: NDArray[np.bool_], note: str = "") -> Levels:
        """Only the levels of the mask; the note counts the others and says where they stand."""
        if mask.all():
            return self
        where = [row for row, keep in zip(self.rows, mask, strict=True) if not keep]
        notes = (
            (*self.notes, f"{note}: {counted(len(where), 'level')} ({listed(where)})") if note else self.notes
        )
        return self.taken(np.flatnonzero(mask), notes)

    def taken(self, order: NDArray[np.intp], notes: tuple[str, ...]) -> Levels:
        """The levels in another order, or some of them."""
        return replace(
            self,
            rows=[self.rows[index] for index in order],
            values={name: along[order] for name, along in self.values.items()},
            shown={name: [texts[index] for index in order] for name, texts in self.shown.items()},
            notes=notes,
        )

    def text(self, name: str, index: int) -> str:
        """A value as the file has it."""
        return self.shown[name][index] if name in self.shown else f"{self.values[name][index]:g}"


def counted(number: int, word: str) -> str:
    """A number of things, in words."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def listed(items: Sequence[str], most: int = 5) -> str:
    """The items with commas, cut short."""
    more = len(items) - most
    return ", ".join(items[:most]) + (f" and {more} more" if more > 0 else "")


def checked(levels: Levels, file: str) -> Levels:
    """Check the levels, leave out what cannot be used, and merge doubles.

    Parameters
    ----------
    levels : Levels
    file : str
        Named in errors.

    Returns
    -------
    Levels
        From below upwards, at least 3, with the keys height and pressure.

    Raises
    ------
    InputError
        A value that no air has; a height that falls or a pressure that rises; heights that the pressures
        contradict; fewer than 3 levels with a temperature and a height or a pressure. Each names the row.

    Notes
    -----
    Levels without a temperature, or with neither height nor pressure, are left out; successive ones of the
    same height or the same pressure become their mean. It stands in the notes.
    """
    _require_believable(levels, file)
    levels = _with_height_or_pressure(_upwards(levels), file)
    _require_order(levels, file)
    _require_dense(levels, file)
    levels = _merged(levels, file)
    if len(levels.rows) < _FEWEST:
        raise InputError(
            f"only {counted(len(levels.rows), 'level')} can be used",
            file=file,
            expected=f"at least {_FEWEST} with a temperature and a height or a pressure",
            remedy="; ".join(levels.notes) or None,
        )
    return levels


def _require_believable(levels: Levels, file: str) -> None:
    for name, along in levels.values.items():
        low, high, words = BELIEVABLE[name]
        bad = (along < low) | (along > high)
        if bad.any():
            index = int(np.argmax(bad))
            raise InputError(
                "a value that no air has",
                file=file,
                key=f"{levels.rows[index]}, {name}",
                value=levels.text(name, index),
                expected=words,
                remedy="look at its unit; without one, values are SI"
                if name not in ("wind_speed", "wind_direction")
                else None,
            )


def _upwards(levels: Levels) -> Levels:
    """Turned round if the file goes downwards throughout."""
    downwards = []
    for name, sign in (("height", 1.0), ("pressure", -1.0)):
        along = levels.values.get(name, np.empty(0))
        steps = sign * np.diff(along[np.isfinite(along)])
        if steps.size:
            downwards.append(bool((steps <= 0.0).all() and (steps < 0.0).any()))
    if not downwards or not all(downwards):
        return levels
    return levels.taken(np.arange(len(levels.rows))[::-1], levels.notes)


def _with_height_or_pressure(levels: Levels, file: str) -> Levels:
    nothing = np.full(len(levels.rows), np.nan)
    values = {"pressure": nothing, "height": nothing, **levels.values}
    levels = replace(levels, values=values)
    levels = levels.kept(np.isfinite(values["temperature"]), "left out for want of a temperature")
    located = np.isfinite(levels.values["pressure"]) | np.isfinite(levels.values["height"])
    levels = levels.kept(located, "left out for want of a height and a pressure")
    if levels.rows and not np.isfinite(levels.values["pressure"]).any():
        raise InputError(
            "no pressure anywhere",
            file=file,
            expected="a pressure at one level at least",
            remedy="give surface_pressure, the pressure at height 0",
        )
    return _without_sinking(levels) if levels.sinks else levels


def _without_sinking(levels: Levels) -> Levels:
    """Leaves out what a balloon measured while it swung or sank a little."""
    height, pressure = levels.values["height"], levels.values["pressure"]
    highest = np.maximum.accumulate(np.where(np.isfinite(height), height, -np.inf))
    thinnest = np.minimum.accumulate(np.where(np.isfinite(pressure), pressure, np.inf))
    sunk = (height < highest) | (pressure > thinnest)
    near = (np.nan_to_num(highest - height) < levels.sinks) & (
        np.nan_to_num(np.log(pressure / thinnest)) * 8000.0 < levels.sinks
    )
    return levels.kept(~(sunk & near), "left out because the balloon sank for a moment")


def _require_order(levels: Levels, file: str) -> None:
    """Heights that do not fall, pressures that do not rise, and either as the other demands."""
    for name, sign, words in (
        ("height", 1.0, "the height falls"),
        ("pressure", -1.0, "the pressure rises with height"),
    ):
        known = np.flatnonzero(np.isfinite(levels.values[name]))
        along = levels.values[name][known]
        if name == "pressure":
            _require_one_unit(levels, known, file)
        bad = sign * np.diff(along) < 0.0
        if bad.any():
            here, before = known[int(np.argmax(bad)) + 1], known[int(np.argmax(bad))]
            raise InputError(
                words,
                file=file,
                key=f"{levels.rows[here]}, {name}",
                value=levels.text(name, here),
                expected=f"{'at least' if sign > 0 else 'at most'} {levels.text(name, before)}, as at "
                f"{levels.rows[before]} below it",
                remedy="sort the levels by height, or correct the one that is wrong",
            )
    _require_fit(levels, file)


def _require_dense(levels: Levels, file: str) -> None:
    """Refuses hectopascals that are taken for pascals, which no ratio of pressures betrays."""
    known = np.flatnonzero(np.isfinite(levels.values["pressure"]))
    if known.size and levels.values["pressure"][known[0]] < _THINNEST:
        raise InputError(
            "too little for the lowest level",
            file=file,
            key=f"{levels.rows[known[0]]}, pressure",
            value=levels.text("pressure", int(known[0])),
            expected=f"at least {_THINNEST:g} Pa there",
            remedy="is it in hPa? then say so; without a unit, values are SI",
        )


def _require_one_unit(levels: Levels, known: NDArray[np.intp], file: str) -> None:
    along = levels.values["pressure"][known]
    factor = along[1:] / along[:-1]
    bad = (factor < 1.0 / _STEEPEST) | (factor > _STEEPEST)
    if bad.any():
        here = known[int(np.argmax(bad)) + 1]
        raise InputError(
            f"the pressure changes {max(factor[bad][0], 1.0 / factor[bad][0]):.0f}-fold from "
            f"{levels.rows[known[int(np.argmax(bad))]]} to here",
            file=file,
            key=f"{levels.rows[here]}, pressure",
            value=levels.text("pressure", here),
            expected=f"at most {_STEEPEST:.0f}-fold from a level to the next",
            remedy="is it in hPa among Pa?",
        )


def _require_fit(levels: Levels, file: str) -> None:
    """Refuses heights that the weight of the air contradicts, over layers of at least 500 m."""
    both = np.flatnonzero(np.isfinite(levels.values["height"]) & np.isfinite(levels.values["pressure"]))
    pressure = levels.values["pressure"][both]
    depth = -np.log(pressure)
    warm, tall = levels.values["temperature"][both], levels.values["height"][both]
    path = np.concatenate([[0.0], np.cumsum(0.5 * (warm[1:] + warm[:-1]) * np.diff(depth))]) * heights.SCALE
    base = 0
    for top in range(1, both.size):
        thick = max(path[top] - path[base], tall[top] - tall[base])
        if thick < _CHECKED_OVER:
            continue
        # Where the air is thin, the rounding of the pressure alone is a good part of a layer.
        rounding = _ROUNDED / pressure[top] * heights.SCALE * warm[top]
        if abs(path[top] - path[base] - (tall[top] - tall[base])) > _MISFIT * thick + rounding:
            raise InputError(
                f"height and pressure contradict each other: {tall[top] - tall[base]:.0f} m from "
                f"{levels.rows[both[base]]} to here, {path[top] - path[base]:.0f} m by the pressures",
                file=file,
                key=levels.rows[both[top]],
                value=f"{levels.text('height', both[top])}, {levels.text('pressure', both[top])}",
                expected="agreement within 10 %",
                remedy="look at the units of both (m or ft, Pa or hPa)",
            )
        base = top


def _merged(levels: Levels, file: str) -> Levels:
    """Successive levels of the same pressure or the same height become their mean."""
    pressure, height = levels.values["pressure"], levels.values["height"]
    groups: list[list[int]] = []
    for index in range(len(levels.rows)):
        if groups and (pressure[index] == pressure[groups[-1][0]] or height[index] == height[groups[-1][0]]):
            groups[-1].append(index)
        else:
            groups.append([index])
    doubled = [group for group in groups if len(group) > 1]
    if not doubled:
        return levels
    for group in doubled:
        _require_one_temperature(levels, group, file)
    spread = max(float(np.ptp(levels.values["temperature"][group])) for group in doubled)
    where = [levels.rows[index] for group in doubled for index in group[1:]]
    note = (
        f"merged with the one below, of the same height or pressure, up to {spread:.1f} K apart: "
        f"{counted(len(where), 'level')} ({listed(where)})"
    )
    first = levels.taken(np.array([group[0] for group in groups]), (*levels.notes, note))
    merged = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the mean of nothing is NaN, and means so
        for name, along in levels.values.items():
            take = _first_known if name == "wind_direction" else np.nanmean
            merged[name] = np.array([float(take(along[group])) for group in groups])
    return replace(first, values=merged)


def _first_known(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known[0]) if known.size else float("nan")


def _require_one_temperature(levels: Levels, group: list[int], file: str) -> None:
    """Refuses two temperatures at one height: which of them is that of the air, nobody can tell."""
    for before, here in pairwise(group):
        height, temperature = levels.values["height"], levels.values["temperature"]
        one_place = height[here] == height[before] or np.isnan(height[[here, before]]).any()
        if one_place and abs(temperature[here] - temperature[before]) > _APART:
            raise InputError(
                "two temperatures at one level",
                file=file,
                key=f"{levels.rows[here]}, temperature",
                value=levels.text("temperature", here),
                expected=f"about {levels.text('temperature', before)}, as at {levels.rows[before]}",
                remedy="leave one out, or give it a height of its own",
            )
