"""The text pages of the University of Wyoming: TEXT:LIST, saved as text or as HTML."""

from __future__ import annotations

import html
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np

from nigemizu.errors import InputError
from nigemizu.heat.reading.soundings.choosing import Label, Wanted, chosen
from nigemizu.heat.reading.soundings.levels import SWINGS, Levels
from nigemizu.heat.reading.soundings.measures import UNITS, column_of
from nigemizu.heat.reading.soundings.sniffing import decoded, opened

__all__ = ["read_wyoming"]

_WIDTH: Final = 7
_MONTHS: Final = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_TITLES: Final = (
    # 72357 OUN Norman Observations at 12Z 15 Apr 2010
    re.compile(r"^\s*(?P<station>\S.*?)\s+Observations at (?P<hour>\d\d)Z (?P<date>\d\d? \w{3} \d{4})"),
    # Observations for Station 56187 at 00 UTC 25 Jul 2026
    re.compile(
        r"^\s*Observations for Station (?P<station>\S+) at (?P<hour>\d\d) UTC (?P<date>\d\d? \w{3} \d{4})"
    ),
)
_FACTS: Final = {
    "station number": re.compile(r"Station number:\s*(\S+)"),
    "station identifier": re.compile(r"Station identifier:\s*(\S+)"),
    "latitude": re.compile(r"(?:Station latitude|\bLatitude):\s*([-\d.]+)"),
    "longitude": re.compile(r"(?:Station longitude|\bLongitude):\s*([-\d.]+)"),
    "elevation": re.compile(r"(?:Station elevation|\bElevation):\s*([-\d.]+)"),
    "time": re.compile(r"Observation time:\s*(\d{6}/\d{4})"),
}
_UNSTATED: Final = {
    **{"PRES": "hPa", "HGHT": "m", "TEMP": "C", "DWPT": "C", "RELH": "%", "MIXR": "g/kg"},
    **{"DRCT": "deg", "SKNT": "knot", "SPED": "m/s"},
}
"""Of pages whose line of units was lost."""


class _Section:
    """One sounding as it stands: what is told of it, and its rows."""

    def __init__(self, headings: list[str], ends: list[int], facts: dict[str, str]) -> None:
        self.headings, self.ends, self.facts = headings, ends, facts
        self.units = [_UNSTATED.get(heading, "") for heading in headings]
        self.rows: list[tuple[int, str]] = []

    def number(self, name: str) -> float | None:
        """A fact that is a number, unless it says that it is missing."""
        try:
            value = float(self.facts[name])
        except (KeyError, ValueError):
            return None
        return value if value > -9000.0 else None

    def label(self, file: str) -> Label:
        """What tells it from the others."""
        latitude, longitude = self.number("latitude"), self.number("longitude")
        place = None if latitude is None or longitude is None else (latitude, longitude)
        names = [*self.facts.get("station", "").split(maxsplit=2)]
        for name in ("station number", "station identifier"):
            if name in self.facts and self.facts[name] not in names:
                names.append(self.facts[name])
        return Label(self._time(file), tuple(names), place)

    def _time(self, file: str) -> datetime | None:
        given = (
            f"{self.facts['date']} {self.facts['hour']}" if "hour" in self.facts else self.facts.get("time")
        )
        if given is None:
            return None
        try:
            if "hour" not in self.facts:
                return datetime.strptime(given, "%y%m%d/%H%M").replace(tzinfo=UTC)
            day, month, year, hour = given.split()
            # Not by strptime, which reads the names of months in the language of the machine.
            return datetime(int(year), _MONTHS.index(month.lower()) + 1, int(day), int(hour), tzinfo=UTC)
        except ValueError:
            raise InputError(
                "no time of a sounding", file=file, value=given, expected="such as 12Z 15 Apr 2010"
            ) from None


def read_wyoming(path: Path, want: Wanted) -> Levels:
    """One sounding of a TEXT:LIST page, as the old service wrote it (knots) or the new one does (m/s).

    Parameters
    ----------
    path : pathlib.Path
    want : Wanted
        Which, where the page holds several.

    Returns
    -------
    Levels

    Raises
    ------
    InputError
        None fits or several do; a row whose columns cannot be told apart.

    Notes
    -----
    Columns of seven characters, blank where a value is missing, so that rows are not split at blanks unless
    they are complete. Heights are geopotential metres above the sea.
    """
    file = str(path)
    with opened(path) as stream:
        text = decoded(stream.read(), file)
    sections = _sections(text)
    labels = [section.label(file) for section in sections]
    index = chosen(labels, want, file)
    section, label = sections[index], labels[index]
    values, shown = _columns(section, file)
    return Levels(
        [f"line {row}" for row, _ in section.rows],
        values,
        shown,
        sinks=SWINGS,
        station_height=section.number("elevation"),
        time=label.time,
        place=label.place,
        station=" ".join(label.names) or None,
        source=f"{file} (University of Wyoming)",
    )


def _sections(text: str) -> list[_Section]:
    sections: list[_Section] = []
    facts: dict[str, str] = {}  # of what comes next
    inside = False
    for row, raw in enumerate(text.splitlines(), 1):
        line = html.unescape(re.sub(r"<[^>]*>", "", raw)).expandtabs().rstrip()
        words = line.split()
        title = next(filter(None, (pattern.match(line) for pattern in _TITLES)), None)
        table = sections[-1] if inside else None
        if words[:3] == ["PRES", "HGHT", "TEMP"]:
            sections.append(_Section(words, _ends(line), facts))
            facts, inside = {}, True
        elif title:
            facts, inside = title.groupdict(), False
        elif table and re.match(r"[-+]?\d", words[0] if words else ""):
            table.rows.append((row, line))
        elif table and not table.rows and (set(line) <= set("- ") or words[0] == "hPa"):
            if len(words) == len(table.headings):
                table.units = words
        else:
            inside = False
            found = {key: m[1] for key, pattern in _FACTS.items() if (m := pattern.search(line))}
            # The old pages say it after the table, the new ones before it.
            (facts if facts or not sections else sections[-1].facts).update(found)
    return sections


def _ends(line: str) -> list[int]:
    """Where the columns end: under the names, whose first one ends at seven even if blanks were lost."""
    ends = [match.end() for match in re.finditer(r"\S+", line)]
    return [end - ends[0] + _WIDTH for end in ends]


def _columns(section: _Section, file: str) -> tuple[dict[str, np.ndarray], dict[str, list[str]]]:
    meanings = [column_of(heading) for heading in section.headings]
    texts = [_cells(section, line, row, file) for row, line in section.rows]
    values: dict[str, np.ndarray] = {}
    shown: dict[str, list[str]] = {}
    for number, meaning in enumerate(meanings):
        if meaning is None:
            continue
        name = "height" if meaning.name == "geopotential_height" else meaning.name
        factor, offset = UNITS[meaning.name].to_si(section.units[number], name, file)
        shown[name] = [cells[number] for cells in texts]
        values[name] = np.array(
            [
                _number(cell, name, row, file) * factor + offset
                for cell, (row, _) in zip(shown[name], section.rows, strict=True)
            ],
            dtype=np.float64,
        )
    return values, shown


def _cells(section: _Section, line: str, row: int, file: str) -> list[str]:
    words = line.split()
    if len(words) == len(section.headings):
        return words
    line = words[0].rjust(section.ends[0]) + line.lstrip()[len(words[0]) :]  # blanks lost at the left
    starts = [0, *section.ends[:-1]]
    cells = [line[first:last] for first, last in zip(starts, section.ends, strict=True)]
    # Numbers stand at the right of their columns; one that does not was cut, or has slipped.
    astray = any(len(cell) > len(cell.rstrip()) > len(cell) - len(cell.lstrip()) for cell in cells)
    cut = any(
        cell.strip() and len(cell) < last - first
        for cell, first, last in zip(cells, starts, section.ends, strict=True)
    )
    if astray or cut or " ".join(cells).split() != words:
        raise InputError(
            "the columns of this row cannot be told apart",
            file=file,
            key=f"line {row}",
            value=line,
            expected=f"{len(section.headings)} columns of {_WIDTH} characters, blank where nothing is known",
            remedy="keep the blanks when copying from the page",
        )
    return [cell.strip() for cell in cells]


def _number(cell: str, name: str, row: int, file: str) -> float:
    if not cell:
        return float("nan")
    try:
        value = float(cell)
    except ValueError:
        raise InputError("no number", file=file, key=f"line {row}, {name}", value=cell) from None
    return value if value > -9000.0 else float("nan")
