"""Refusing rows of heights, temperatures, pressures and humidities that no column of air has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nigemizu.air.standards import STANDARD_TOP, standard_atmosphere
from nigemizu.errors import InputError

__all__ = ["COLDEST", "HOTTEST", "Rows", "refuse_other_pressures"]

FloatArray: TypeAlias = NDArray[np.float64]

COLDEST, HOTTEST = 120.0, 400.0  # K: beyond these a temperature is in another unit
_CELSIUS: Final = 70.0  # numbers up to this may be degrees Celsius
_LOWEST: Final = -5000.0  # m
_TOP: Final = STANDARD_TOP["us1976"]
_ODD: Final = 8.0  # times the standard atmosphere's pressure, or an eighth of it: nowhere, under 86 km
_LEAST: Final = 2  # rows
_DIFFERENCE: Final = 0.05  # of the pressure


class Rows(NamedTuple):
    """Rows of a table of air, under the names that the person gave them."""

    heights: Sequence[float] | FloatArray
    temperatures: Sequence[float] | FloatArray
    pressures: Sequence[float] | FloatArray = ()
    humidities: Sequence[float] | FloatArray = ()
    names: tuple[str, str, str, str] = (
        "profile.heights",
        "profile.temperatures",
        "profile.pressures",
        "profile.relative_humidities",
    )
    file: str | None = None

    def refuse(self) -> None:
        """Raise `InputError`, naming row and value, if this is no column of air."""
        if len(self.heights) < _LEAST:
            raise self._error("a table needs two rows at least", 0, value=list(self.heights))
        columns = (self.heights, self.temperatures, self.pressures, self.humidities)
        for which, numbers in enumerate(columns):
            if len(numbers) != len(self.heights) and (len(numbers) or which == 1):
                problem = f"{len(numbers)} rows beside {len(self.heights)} heights"
                raise self._error(problem, which, expected="one for each height")
        for which, numbers in enumerate(columns):
            gaps = ~np.isfinite(np.asarray(numbers, dtype=np.float64))
            if np.any(gaps):
                row = int(np.argmax(gaps))
                remedy = "leave the whole row out"
                raise self._error(f"row {row + 1} has no number", which, numbers[row], remedy=remedy)
        self._refuse_heights()
        self._refuse_temperatures()
        self._refuse_pressures()
        self._refuse_humidities()

    def _refuse_heights(self) -> None:
        for row, height in enumerate(self.heights, start=1):
            if not _LOWEST <= height < _TOP:
                expected = f"metres from {_LOWEST:g} to {_TOP:g}"
                raise self._error(f"row {row} lies where no air is", 0, height, expected=expected)
        for row, (below, above) in enumerate(zip(self.heights[:-1], self.heights[1:], strict=True), start=2):
            if above <= below:
                problem = f"row {row} does not lie above row {row - 1}"
                raise self._error(problem, 0, above, expected=f"metres above {below:g}")

    def _refuse_temperatures(self) -> None:
        fitting = [COLDEST < value < HOTTEST for value in self.temperatures]
        if all(fitting):
            return
        row = fitting.index(False)
        value = float(self.temperatures[row])
        raise self._error(
            f"row {row + 1} is no temperature of air in K"
            + ("; the other rows are kelvins" if fitting.count(False) == 1 else "")
            + ("; some rows are kelvins" if any(fitting) and fitting.count(False) > 1 else ""),
            1,
            value,
            expected=f"kelvins from {COLDEST:g} to {HOTTEST:g}",
            remedy=f"is it {value:g} °C? that is {value + 273.15:g} K" if abs(value) < _CELSIUS else None,
        )

    def _refuse_pressures(self) -> None:
        if not len(self.pressures):
            return
        usual = standard_atmosphere(np.asarray(self.heights, dtype=np.float64))[1]
        low, high = usual / _ODD, usual * _ODD
        hundredth = [bool(a < 100 * p < b) for a, p, b in zip(low, self.pressures, high, strict=True)]
        for row, (pressure, least, most) in enumerate(zip(self.pressures, low, high, strict=True), start=1):
            if not least < pressure < most:
                mixed = "" if all(hundredth) else "; other rows are not"
                raise self._error(
                    f"row {row} is in hectopascals{mixed}"
                    if hundredth[row - 1]
                    else f"row {row} is no pressure of air at {self.heights[row - 1]:g} m",
                    2,
                    float(pressure),
                    expected=f"pascals from {least:.3g} to {most:.3g}",
                    remedy=f"{pressure:g} hPa are {100 * pressure:g} Pa" if hundredth[row - 1] else None,
                )
        pairs = zip(self.pressures[:-1], self.pressures[1:], strict=True)
        for row, (below, above) in enumerate(pairs, start=2):
            if above >= below:
                problem = f"row {row} has no less pressure than row {row - 1} below it"
                raise self._error(problem, 2, float(above), expected=f"pascals under {below:g}")

    def _refuse_humidities(self) -> None:
        kind = "mole fraction" if self.names[3] == "vapour_fraction" else "relative humidity"
        for row, humidity in enumerate(self.humidities, start=1):
            if not 0 <= humidity <= 1:
                percent = 1 < humidity <= 100
                raise self._error(
                    f"row {row} is no {kind}",
                    3,
                    float(humidity),
                    expected="from 0 to 1",
                    remedy=f"if it is in per cent, write {humidity / 100:g}" if percent else None,
                )

    def _error(
        self,
        problem: str,
        which: int,
        value: object = None,
        *,
        expected: str | None = None,
        remedy: str | None = None,
    ) -> InputError:
        shown = float(value) if isinstance(value, np.floating) else value
        key = self.names[which]
        return InputError(problem, key=key, value=shown, expected=expected, remedy=remedy, file=self.file)


def refuse_other_pressures(given: FloatArray, at_rest: FloatArray) -> None:
    """Raise `InputError` if a pressure differs from that of air at rest by more than 5 %."""
    off = np.abs(given / at_rest - 1)
    row = int(np.argmax(off))
    if off[row] > _DIFFERENCE:
        raise InputError(
            f"row {row + 1} is not what the weight of the air makes it, {at_rest[row]:.6g} Pa",
            key="profile.pressures",
            value=float(given[row]),
            expected="within 5 % of it",
            remedy="check heights and temperatures, or leave the pressures out",
        )
