"""A person's own table of levels: CSV with a line of headings, or TOML."""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from nigemizu.errors import InputError
from nigemizu.heat.reading.soundings import heights
from nigemizu.heat.reading.soundings.choosing import Label, Wanted, as_place, as_time, chosen
from nigemizu.heat.reading.soundings.levels import BELIEVABLE, SWINGS, Levels, listed
from nigemizu.heat.reading.soundings.measures import UNITS, Column, column_of, nearest_names
from nigemizu.heat.reading.soundings.sniffing import decoded, names_columns, opened

__all__ = ["read_csv", "read_toml"]

_MISSING: Final = {"", "nan", "na", "n/a", "-", "--", "null", "none", "/", "//", "///", "*", "m"}
_RELEASED_BEFORE: Final = timedelta(hours=2)
_HEIGHTS: Final = ("height", "altitude", "geopotential_height")
_FACTS: Final = {
    "time": "time", "date": "time", "station": "station", "place": "place",
    "latitude": "latitude", "lat": "latitude", "longitude": "longitude", "lon": "longitude",
    "station height": "station_height", "station elevation": "station_height",
    "surface pressure": "surface_pressure",
}  # fmt: skip
"""What else a file may tell, in lower case."""


class _Entry(NamedTuple):
    """A column: what it means, its heading, and its texts."""

    meaning: Column
    heading: str
    texts: list[str]


def read_csv(path: Path, want: Wanted, *, wyoming: bool = False) -> Levels:
    """A table with a line of headings such as ``height [m], temperature [C], pressure [hPa], humidity [%]``.

    Parameters
    ----------
    path : pathlib.Path
    want : Wanted
        What the file does not tell is taken from here.
    wyoming : bool
        The file is the CSV of the University of Wyoming: seconds of a flight, of which the first row tells
        the time of release and the place.

    Returns
    -------
    Levels

    Raises
    ------
    InputError
        Headings that nothing is known by, a row of another length, no number, units of another kind.

    Notes
    -----
    Parted by commas, semicolons, tabs or blanks; with semicolons and tabs, decimal commas count. Units stand
    in brackets, after an underscore or a slash, or in a line of their own; without units, SI. Lines that
    begin with ``#`` may tell ``time``, ``station``, ``latitude``, ``longitude``, ``station_height`` and
    ``surface_pressure``.
    """
    file = str(path)
    with opened(path) as stream:
        text = decoded(stream.read(), file)
    facts, lines = _facts_and_lines(text)
    headings, rows = _split(lines, file)
    units = _units_row(headings, rows)
    if units:
        del rows[0]
    entries = []
    unused = []
    for number, heading in enumerate(headings):
        meaning = column_of(heading)
        texts = [cells[number] for _, cells in rows]
        plain = " ".join(re.sub(r"[\W_]+", " ", heading).lower().split())
        if meaning is not None:
            entries.append(
                _Entry(meaning._replace(units=meaning.units or units.get(number, "")), heading, texts)
            )
        elif plain in _FACTS and texts:
            facts.setdefault(_FACTS[plain], texts[0])
        elif heading:
            unused.append(heading)
    if wyoming and re.match(r"\s*-99\.9", str(facts.get("latitude", ""))):
        del facts["latitude"]  # so the archive writes that it does not know the place
    notes = (f"columns not used: {listed(unused, 8)}",) if unused else ()
    kind = "University of Wyoming, CSV" if wyoming else "CSV"
    named = [f"line {row}" for row, _ in rows]
    return _levels(entries, headings, named, facts, want, file, kind, notes, swings=wyoming)


def _facts_and_lines(text: str) -> tuple[dict[str, Any], list[tuple[int, str]]]:
    """What comments tell, and the other lines with their numbers."""
    facts: dict[str, Any] = {}
    lines: list[tuple[int, str]] = []
    comment: tuple[int, str] | None = None
    for row, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("<"):
            continue
        if not line.lstrip().startswith("#"):
            if not lines and comment and _all_numbers(line):
                lines.append(comment)  # headings that a program has commented out
            lines.append((row, line))
            continue
        told = line.lstrip("# \t")
        comment = (row, told) if names_columns(told) else comment
        name, mark, value = re.match(r"([^:=]*)([:=]?)(.*)", told).groups()  # type: ignore[union-attr]
        key = _FACTS.get(" ".join(name.lower().replace("_", " ").split()))
        if mark and key:
            facts[key] = value.strip()
    return facts, lines


def _all_numbers(line: str) -> bool:
    return all(
        re.fullmatch(r"[-+]?[\d.,]+(e[-+]?\d+)?|nan|", cell, re.I)
        for cell in re.split(r"[;,\s]+", line.strip())
    )


def _split(lines: list[tuple[int, str]], file: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The headings, and each row's number and cells."""
    first = lines[0][1]
    mark = next((mark for mark in "\t;," if mark in first), None)
    if mark:
        table = [[cell.strip() for cell in next(csv.reader([line], delimiter=mark))] for _, line in lines]
    else:
        table = [re.split(r"\s+(?![\[(])", line.strip()) for _, line in lines]
        if len(table) > 1 and len(table[0]) != len(table[1]):
            table = [re.split(r"\s{2,}", line.strip()) for _, line in lines]
    headings, *rows = table
    if _all_numbers(" ".join(headings)):
        raise InputError(
            "no line of headings",
            file=file,
            key=f"line {lines[0][0]}",
            value=first,
            expected="such as: height [m], temperature [C], pressure [hPa], humidity [%]",
        )
    for (row, line), cells in zip(lines[1:], rows, strict=True):
        while len(cells) > len(headings) and not cells[-1]:
            del cells[-1]
        if len(cells) != len(headings):
            raise InputError(
                f"{len(cells)} values where the headings are {len(headings)}",
                file=file,
                key=f"line {row}",
                value=line,
                expected="a value, or nothing between the marks, under each heading",
            )
        if mark in ("\t", ";"):
            cells[:] = [
                cell.replace(",", ".") if re.fullmatch(r"[-+]?\d*,\d+", cell) else cell for cell in cells
            ]
    return headings, [(row, cells) for (row, _), cells in zip(lines[1:], rows, strict=True)]


def _units_row(headings: list[str], rows: list[tuple[int, list[str]]]) -> dict[int, str]:
    """Units in a line of their own below the headings, by column; empty if that line holds values."""
    if not rows:
        return {}
    found = {}
    for number, (heading, cell) in enumerate(zip(headings, rows[0][1], strict=True)):
        meaning, units = column_of(heading), cell.strip("[]() ")
        if re.match(r"[-+]?[\d.]", cell) and cell != "1":
            return {}
        if meaning is not None and units.lower() in UNITS[meaning.name].known:
            found[number] = units
    return found


def read_toml(path: Path, want: Wanted) -> Levels:
    """A table of lists, ``height = [0, 2, 10]``, with ``[units]`` or units in the keys.

    Parameters
    ----------
    path : pathlib.Path
    want : Wanted
        What the file does not tell is taken from here.

    Returns
    -------
    Levels

    Raises
    ------
    InputError
        No TOML; keys that nothing is known by; lists of different lengths.
    """
    file = str(path)
    with opened(path) as stream:
        text = decoded(stream.read(), file)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError("not TOML", file=file, remedy=f"the reader says: {error}") from error
    units = data.pop("units", {})
    facts: dict[str, Any] = {}
    entries = []
    for key, value in data.items():
        meaning = column_of(key)
        known = _FACTS.get(" ".join(key.lower().replace("_", " ").split()))
        if known:
            facts[known] = value
        elif meaning is None or not isinstance(value, list):
            raise InputError(
                "a key that means nothing here" if meaning is None else "no list",
                file=file,
                key=key,
                value=value if meaning else None,
                expected="lists "
                + ", ".join(UNITS)
                + "; "
                + ", ".join(sorted(set(_FACTS.values())))
                + "; units",
                remedy=nearest_names([key]) if meaning is None else None,
            )
        else:
            meaning = meaning._replace(units=meaning.units or str(_units_of(units, key, meaning.name)))
            entries.append(_Entry(meaning, key, [str(one) for one in value]))
    longest = max(entries, key=lambda entry: len(entry.texts), default=None)
    for entry in entries:
        if longest and len(entry.texts) != len(longest.texts):
            raise InputError(
                f"{len(entry.texts)} values where {longest.heading} has {len(longest.texts)}",
                file=file,
                key=entry.heading,
                expected="lists of the same length (nan for what is missing)",
            )
    rows = [f"entry {number}" for number in range(1, len(longest.texts) + 1)] if longest else []
    return _levels(entries, list(data), rows, facts, want, file, "TOML", (), swings=False)


def _units_of(units: Any, key: str, name: str) -> str:
    if not isinstance(units, Mapping):
        return ""
    return str(next((units[known] for known in (key, name) if known in units), ""))


def _levels(
    entries: list[_Entry],
    headings: Sequence[str],
    rows: list[str],
    facts: dict[str, Any],
    want: Wanted,
    file: str,
    kind: str,
    notes: tuple[str, ...],
    *,
    swings: bool,
) -> Levels:
    by_name: dict[str, _Entry] = {}
    for entry in entries:
        if entry.meaning.name in by_name:
            raise InputError(
                f"{by_name[entry.meaning.name].heading!r} and {entry.heading!r} mean the same",
                file=file,
                expected=f"one {entry.meaning.name.replace('_', ' ')}",
            )
        by_name[entry.meaning.name] = entry
    tall = [name for name in _HEIGHTS if name in by_name]
    if "temperature" not in by_name or not (tall or "pressure" in by_name):
        raise InputError(
            "no temperature" if "temperature" not in by_name else "neither height nor pressure",
            file=file,
            expected="columns for the temperature and for the height or the pressure; found "
            + ", ".join(headings),
            remedy=nearest_names(list(headings)),
        )
    for other in tall[1:]:
        notes = (*notes, f"column not used: {by_name.pop(other).heading}")
    values: dict[str, np.ndarray] = {}
    shown: dict[str, Sequence[str]] = {}
    for name, entry in by_name.items():
        ours: str = "height" if name in _HEIGHTS else name
        values[ours], shown[ours] = _numbers(entry, rows, file), entry.texts
    time, place, station, station_height, surface = _told(facts, file)
    slack = _RELEASED_BEFORE if swings else timedelta(0)
    known = Label(
        time or want.time, (station,) if station else (want.station or "",), place or want.place, slack
    )
    chosen([known], want, file)
    from_ground = not tall or tall[0] == "height"
    if surface is not None and tall and not np.isfinite(values.get("pressure", np.nan)).any():
        values["pressure"] = _from_surface(values, surface, 0.0 if from_ground else station_height)
    return Levels(
        rows,
        values,
        shown,
        geopotential=not tall or tall[0] == "geopotential_height",
        from_ground=from_ground,
        sinks=SWINGS if swings else 0.0,
        station_height=station_height,
        time=known.time,
        place=known.place,
        station=known.names[0] or None,
        source=f"{file} ({kind})",
        notes=notes,
    )


def _from_surface(values: dict[str, Any], surface: float, ground: float | None) -> np.ndarray:
    """Pressures, unknown but for the lowest level, which stands a little above the ground."""
    tall = values["height"]
    usable = np.isfinite(values["temperature"]) & np.isfinite(tall)
    if not usable.any():
        return np.full(tall.size, np.nan)
    lowest = int(np.argmin(np.where(usable, tall, np.inf)))
    above = tall[lowest] - (tall[lowest] if ground is None else ground)
    pressure = np.full(tall.size, np.nan)
    pressure[lowest] = surface * np.exp(-above / (heights.SCALE * values["temperature"][lowest]))
    return pressure


def _numbers(entry: _Entry, rows: list[str], file: str) -> np.ndarray:
    factor, offset = UNITS[entry.meaning.name].to_si(entry.meaning.units, entry.heading, file)
    numbers = np.full(len(rows), np.nan)
    for index, text in enumerate(entry.texts):
        if text.lower() in _MISSING:
            continue
        try:
            number = float(text)
        except ValueError:
            raise InputError(
                "no number", file=file, key=f"{rows[index]}, {entry.heading}", value=text
            ) from None
        if number > -9000.0 and np.isfinite(number):
            numbers[index] = number * factor + offset
    return numbers


def _told(
    facts: dict[str, Any], file: str
) -> tuple[datetime | None, tuple[float, float] | None, str | None, float | None, float | None]:
    """Time, place, station, its height and the pressure there, as far as the file tells them."""
    given = facts.get("place")
    if given is None and {"latitude", "longitude"} <= set(facts):
        given = (facts["latitude"], facts["longitude"])
    if isinstance(given, str):
        given = re.split(r"[,;\s]+", given.strip("[]() "))
    try:
        time = as_time(facts["time"])[0] if "time" in facts else None
        place = None if given is None else as_place(given)
        numbers = {
            name: _quantity(facts[name], name, unit)
            for name, unit in (("station_height", "height"), ("surface_pressure", "pressure"))
            if name in facts
        }
    except InputError as error:
        raise error.in_file(file) from None
    station = str(facts["station"]) if "station" in facts else None
    return time, place, station, numbers.get("station_height"), numbers.get("surface_pressure")


def _quantity(given: Any, key: str, measure: str) -> float:
    number, _, units = str(given).strip().partition(" ")
    factor, offset = UNITS[measure].to_si(units, key, None)
    try:
        value = float(number) * factor + offset
    except ValueError:
        value = float("nan")
    low, high, words = BELIEVABLE[measure]
    if not low <= value <= high:
        raise InputError("not what it should be", key=key, value=given, expected=words)
    return value
