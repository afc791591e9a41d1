"""From checked levels to a sounding: gaps filled, vapour in one measure, heights from the lowest level."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nigemizu.air import moist
from nigemizu.errors import InputError
from nigemizu.heat.reading.soundings import heights, humidity
from nigemizu.heat.reading.soundings.levels import HUMIDITIES, Levels, checked, counted
from nigemizu.heat.reading.soundings.sounding import Sounding

__all__ = ["finish"]

FloatArray: TypeAlias = NDArray[np.float64]

_DEW_ABOVE: Final = 0.5  # K; of rounding, and of sensors that disagree
_TOO_WET: Final = 1.5
"""Vapour over that of saturation, as a factor, from which it is a wrong unit and no cloud."""
_REFINEMENTS: Final = 3


def finish(levels: Levels, file: str) -> Sounding:
    """Check the levels, fill their gaps, and count the heights from the lowest.

    Parameters
    ----------
    levels : Levels
    file : str
        Named in errors.

    Returns
    -------
    Sounding

    Raises
    ------
    InputError
        As `levels.checked`; a dew point above the temperature, or other vapour that no air holds; a level
        known only by its height that does not fit between its neighbours.

    Notes
    -----
    Missing heights and pressures follow from the weight of the air (`heights`). Where a level has no
    humidity, the relative humidity over water is interpolated in ln p; beyond the measured levels that of the
    nearest one holds, but upwards the mole fraction does not rise any more. Air without any is dry. All of
    it stands in the notes.
    """
    levels = _at_ground(checked(levels, file))
    latitude = levels.place[0] if levels.place else None
    temperature = levels.values["temperature"]
    tall, weight = levels.values["height"], levels.values["pressure"]
    if not levels.geopotential:
        tall = heights.geopotential(tall, latitude)
    told = bool(np.isfinite(tall).any())
    lacking = tuple(
        f"computed from the weight of the air: {counted(int(np.isnan(along).sum()), name)}"
        for name, along in (("height", tall), ("pressure", weight))
        if np.isnan(along).any()
    )
    fraction = np.zeros(temperature.size)
    vapour_notes: tuple[str, ...] = ()
    for _ in range(_REFINEMENTS if lacking else 1):  # the vapour makes the air light: a fixed point
        virtual = temperature * moist.virtual_factor(fraction)
        high = heights.fill_heights(tall, weight, virtual)
        _require_rising(high, levels, file)
        pressure = heights.fill_pressures(weight, high, virtual)
        fraction, vapour_notes = _vapour(levels, pressure, file)
    above_sea = heights.geometric(high, latitude)
    zero, station = _zero(levels, float(above_sea[0]), told)
    return Sounding(
        height=above_sea - zero,
        pressure=pressure,
        temperature=temperature,
        vapour_fraction=fraction,
        wind_speed=_if_any(levels, "wind_speed"),
        wind_direction=_if_any(levels, "wind_direction"),
        station_height=station,
        time=levels.time,
        place=levels.place,
        station=levels.station,
        source=levels.source,
        notes=(*levels.notes, *lacking, *vapour_notes),
    )


def _zero(levels: Levels, lowest: float, told: bool) -> tuple[float, float | None]:
    """Height above the sea from which heights count, and that of the station if known."""
    if levels.from_ground and told:
        return levels.station_height or 0.0, levels.station_height
    if levels.station_height is not None or not told:
        return lowest, levels.station_height
    return lowest, lowest


def _if_any(levels: Levels, name: str) -> FloatArray | None:
    along = levels.values.get(name)
    return along if along is not None and np.isfinite(along).any() else None


def _require_rising(height: FloatArray, levels: Levels, file: str) -> None:
    wrong = np.diff(height) <= 0.0
    if wrong.any():
        index = int(np.argmax(wrong)) + 1
        raise InputError(
            f"this level lies at {height[index]:.0f} m and the one before it at {height[index - 1]:.0f} m, "
            "where the weight of the air puts whichever has no height",
            file=file,
            key=levels.rows[index],
            expected="heights that increase",
            remedy="sort the levels, or give each its pressure",
        )


def _vapour(levels: Levels, pressure: FloatArray, file: str) -> tuple[FloatArray, tuple[str, ...]]:
    """Mole fraction of vapour at every level, and what was done to it."""
    temperature = levels.values["temperature"]
    most = humidity.saturated(temperature, pressure)
    fraction = np.full(temperature.size, np.nan)
    for name in HUMIDITIES:
        if name in levels.values:
            told = _fraction(name, levels, pressure, most, file)
            fraction = np.where(np.isnan(fraction), told, fraction)
            _require_possible(fraction, most, name, levels, file)
    known = np.isfinite(fraction)
    if not known.any():
        return np.zeros(temperature.size), ("no humidity anywhere: taken as dry",)
    notes = []
    wet = fraction > most * (1.0 + 1e-9)
    if wet.any():
        notes.append(
            f"set to saturation, a little beyond which they were: {counted(int(wet.sum()), 'level')}"
        )
    fraction = np.clip(fraction, 0.0, most)
    if not known.all():
        fraction = _bridged(fraction, known, most, pressure)
        top = int(np.flatnonzero(known)[-1])
        above = known.size - 1 - top
        notes.append(
            f"relative humidity interpolated or held: {counted(int((~known).sum()), 'level')} without any, "
            f"{above} of them above the last that has one"
        )
    return fraction, tuple(notes)


def _fraction(name: str, levels: Levels, pressure: FloatArray, most: FloatArray, file: str) -> FloatArray:
    along = levels.values[name]
    if name == "dew_point":
        temperature = levels.values["temperature"]
        bad = along > temperature + _DEW_ABOVE
        if bad.any():
            index = int(np.argmax(bad))
            raise InputError(
                "the dew point is above the temperature",
                file=file,
                key=f"{levels.rows[index]}, dew point",
                value=levels.text("dew_point", index),
                expected=f"at most {levels.text('temperature', index)}, the temperature there",
            )
        return humidity.from_dew_point(np.minimum(along, temperature), pressure)
    if name == "relative_humidity":
        return along * most
    if name == "mixing_ratio":
        return humidity.from_mixing_ratio(along)
    return humidity.from_mass_fraction(np.maximum(along, 0.0)) if name == "specific_humidity" else along


def _require_possible(fraction: FloatArray, most: FloatArray, name: str, levels: Levels, file: str) -> None:
    bad = (fraction > _TOO_WET * most) & (fraction > 1e-4)  # below, models and rounding may exceed it
    if bad.any():
        index = int(np.argmax(bad))
        raise InputError(
            f"{fraction[index] / most[index]:.1f} times the vapour that saturates this air",
            file=file,
            key=f"{levels.rows[index]}, {name.replace('_', ' ')}",
            value=levels.text(name, index),
            expected="at most saturation over water",
            remedy="look at its unit (kg/kg or g/kg, 1 or %)",
        )


def _bridged(
    fraction: FloatArray, known: NDArray[np.bool_], most: FloatArray, pressure: FloatArray
) -> FloatArray:
    depth = -np.log(pressure)
    relative = np.interp(depth, depth[known], fraction[known] / most[known])
    filled = np.where(known, fraction, relative * most)
    top = int(np.flatnonzero(known)[-1])
    filled[top:] = np.minimum.accumulate(filled[top:])
    return filled


def _at_ground(levels: Levels) -> Levels:
    """Heights above the sea of levels whose heights count from the ground of a station of known height."""
    if not levels.from_ground or levels.station_height is None or "height" not in levels.values:
        return levels
    return replace(
        levels, values={**levels.values, "height": levels.values["height"] + levels.station_height}
    )
