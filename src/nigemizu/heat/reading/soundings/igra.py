"""IGRA version 2: radiosondes of the whole world since 1905, in fixed columns."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from nigemizu.errors import InputError
from nigemizu.heat.reading.soundings.choosing import Label, Wanted, chosen
from nigemizu.heat.reading.soundings.levels import SWINGS, Levels, counted
from nigemizu.heat.reading.soundings.sniffing import opened

__all__ = ["read_igra"]

_MISSING: Final = (-9999, -8888)
"""Never measured; and removed by the archive's quality control."""
_LEVEL_LENGTH: Final = 51
_HEADER_LENGTH: Final = 71
_DERIVED_LENGTH: Final = 90  # of a header; that of a file of derived parameters has 157 columns

_FIELDS: Final = {
    "pressure": (9, 15, 1.0, 0.0),
    "height": (16, 21, 1.0, 0.0),
    "temperature": (22, 27, 0.1, 273.15),
    "relative_humidity": (28, 33, 1e-3, 0.0),
    "depression": (34, 39, 0.1, 0.0),
    "wind_direction": (40, 45, 1.0, 0.0),
    "wind_speed": (46, 51, 0.1, 0.0),
}
"""First column, the one past the last, factor and offset to SI."""


class _Header(NamedTuple):
    row: int
    label: Label
    levels: int


def read_igra(path: Path, want: Wanted) -> Levels:
    """One sounding of a ``…-data.txt`` file, plain or packed.

    Parameters
    ----------
    path : pathlib.Path
    want : Wanted
        Which of them.

    Returns
    -------
    Levels

    Raises
    ------
    InputError
        None fits or several do; a record that is cut short or is no number; more or fewer records than the
        header counts.

    Notes
    -----
    Columns of the archive's ``igra2-data-format.txt``: pressure in Pa, geopotential height in m, temperature,
    dew point depression and relative humidity in tenths, wind in tenths of m/s; −9999 is missing, −8888 was
    removed. The time is the nominal hour, or that of the release where the hour is missing (99). Levels
    before the one marked as the surface lie in the ground and are left out.

    References
    ----------
    I. Durre, X. Yin, R. S. Vose, S. Applequist and J. Arnfield, J. Atmos. Oceanic Technol. 35 (2018) 1753,
    doi:10.1175/JTECH-D-17-0223.1.
    """
    file = str(path)
    headers: list[_Header] = []
    fitting: dict[int, list[tuple[int, str]]] = {}
    with opened(path) as stream:
        kept: list[tuple[int, str]] | None = None
        for row, raw in enumerate(stream, 1):
            line = raw.decode("latin-1")
            if line.startswith("#"):
                headers.append(_header(line.rstrip("\r\n"), row, file))
                # A station's whole record may not fit the memory: only what may be wanted is kept.
                kept = None
                if want.fits(headers[-1].label) and len(fitting) < 2:
                    kept = fitting.setdefault(len(headers) - 1, [])
            elif kept is not None and line.strip():
                kept.append((row, line.rstrip("\r\n")))
    index = chosen([header.label for header in headers], want, file)
    if index not in fitting:  # of several near a place, a later one
        raise InputError("several soundings could be meant", file=file, key="time", remedy="give the time")
    return _levels(headers[index], fitting[index], file)


def _header(line: str, row: int, file: str) -> _Header:
    if len(line.rstrip()) > _DERIVED_LENGTH:
        raise InputError(
            "this holds IGRA's derived parameters",
            file=file,
            key=f"line {row}",
            expected="the file …-data.txt of the station",
        )
    try:
        if len(line.rstrip()) < _HEADER_LENGTH:
            raise ValueError("cut short")
        year, month, day, hour = (int(line[a:b]) for a, b in ((13, 17), (18, 20), (21, 23), (24, 26)))
        release = line[27:31].strip() or "9999"
        minute = 0
        if hour == 99:
            hour, minute = int(release[:-2] or 0), int(release[-2:])
        time = (
            None
            if hour == 99
            else datetime(year, month, day, hour, 0 if minute == 99 else minute, tzinfo=UTC)
        )
        place = (int(line[55:62]) / 1e4, int(line[63:71]) / 1e4)
        count = int(line[32:36])
    except ValueError as error:
        raise InputError(
            "not a header of IGRA version 2",
            file=file,
            key=f"line {row}",
            value=line,
            expected="#ID YEAR MO DY HR RELTIME NUMLEV P_SRC NP_SRC LAT LON in their columns",
            remedy=f"it says: {error}",
        ) from error
    known = abs(place[0]) <= 90.0 and abs(place[1]) <= 180.0
    return _Header(row, Label(time, (line[1:12].strip(),), place if known else None), count)


def _levels(header: _Header, lines: list[tuple[int, str]], file: str) -> Levels:
    if len(lines) != header.levels:
        raise InputError(
            f"{len(lines)} levels stand here and the header counts {header.levels}",
            file=file,
            key=f"line {header.row}",
            value=header.label.words(),
            remedy="the file is cut short, or lines are lost: download it again",
        )
    table = np.array([_record(line, row, file) for row, line in lines]).reshape(-1, len(_FIELDS))
    values = dict(zip(_FIELDS, table.T, strict=True))
    shown = {
        name: [line[first:last].strip() for _, line in lines] for name, (first, last, *_) in _FIELDS.items()
    }
    shown["dew_point"] = [f"depression {text}" for text in shown["depression"]]
    values["dew_point"] = values["temperature"] - values.pop("depression")
    removed = sum(text == "-8888" for texts in shown.values() for text in texts)
    notes = (f"removed by the archive's quality control: {counted(removed, 'value')}",) if removed else ()
    levels = Levels(
        [f"line {row}" for row, _ in lines],
        values,
        shown,
        sinks=SWINGS,
        time=header.label.time,
        place=header.label.place,
        station=header.label.names[0],
        source=f"{file} (IGRA v2)",
        notes=notes,
    )
    surface = [index for index, (_, line) in enumerate(lines) if line[1] == "1"]
    if surface:
        above = np.arange(len(lines)) >= surface[0]
        levels = levels.kept(above, "left out below the surface")
    return levels


def _record(line: str, row: int, file: str) -> list[float]:
    if len(line.rstrip()) < _LEVEL_LENGTH or not re.match(r"[1-3][0-2] ", line):
        raise InputError(
            "a record that is cut short",
            file=file,
            key=f"line {row}",
            value=line,
            expected=f"{_LEVEL_LENGTH} columns that begin with the type of the level",
        )
    numbers = []
    for name, (first, last, factor, offset) in _FIELDS.items():
        try:
            number = int(line[first:last])
        except ValueError:
            raise InputError(
                "no number",
                file=file,
                key=f"line {row}, {name.replace('_', ' ')}",
                value=line[first:last],
                expected=f"a whole number in columns {first + 1} to {last}",
            ) from None
        numbers.append(np.nan if number in _MISSING else number * factor + offset)
    return numbers
