"""Which of several soundings: by time, station and place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, date, datetime, timedelta
from typing import Final, NamedTuple

import numpy as np

from nigemizu.errors import InputError

__all__ = ["Label", "Wanted", "as_place", "as_time", "chosen", "wanted"]

_NEAR: Final = 1.0
"""Degrees of arc within which a place is that of a station."""
_SHOWN: Final = 6


class Label(NamedTuple):
    """What tells a sounding from the others of its file.

    Attributes
    ----------
    time : datetime.datetime, optional
    names : tuple of str
        Numbers, identifiers and names of the station.
    place : (float, float), degree, optional
    slack : datetime.timedelta
        How far from the time that is wanted it may be, of files that tell the time of release only.
    """

    time: datetime | None
    names: tuple[str, ...] = ()
    place: tuple[float, float] | None = None
    slack: timedelta = timedelta(0)

    def words(self) -> str:
        """For a person."""
        when = f"{self.time:%Y-%m-%d %H:%M}" if self.time else "without time"
        where = f" at {self.place[0]:g}, {self.place[1]:g}" if self.place and not self.names else ""
        return when + (f" of {' '.join(self.names)}" if self.names else where)


class Wanted(NamedTuple):
    """What a person asks for.

    Attributes
    ----------
    time : datetime.datetime, optional
    whole_day : bool
        Only the date was given.
    place : (float, float), degree, optional
    station : str, optional
    """

    time: datetime | None
    whole_day: bool
    place: tuple[float, float] | None
    station: str | None

    def fits(self, label: Label) -> bool:
        """Whether the sounding is one that is wanted."""
        if self.time is not None:
            if label.time is None:
                return False
            same_day = self.whole_day and label.time.date() == self.time.date()
            if not same_day and abs(label.time - self.time) > label.slack:
                return False
        if self.station is not None:
            sought = self.station.casefold().strip()
            names = [name.casefold() for name in label.names]
            if not any(sought == name or (len(sought) > 4 and name.endswith(sought)) for name in names):
                return False
        return self.place is None or label.place is None or _apart(self.place, label.place) <= _NEAR


def as_time(given: object) -> tuple[datetime, bool]:
    """A time in UTC, and whether it is a whole day.

    Raises
    ------
    InputError
        It is no time.
    """
    whole_day = False
    time: datetime | None = None
    if isinstance(given, np.datetime64):
        given = given.astype("M8[us]").item()
    if isinstance(given, datetime):
        time = given
    elif isinstance(given, date):
        time, whole_day = datetime(given.year, given.month, given.day), True
    elif isinstance(given, str):
        try:
            time = datetime.fromisoformat(given.strip().removesuffix("UTC").strip())
            whole_day = len(given.strip()) <= 10
        except ValueError:
            time = None
    if time is None:
        raise InputError(
            "no time",
            key="time",
            value=given,
            expected='such as "2026-07-01 12:00", in UTC unless it says so',
        )
    return (time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)), whole_day


def wanted(time: object, place: tuple[float, float] | None, station: str | int | None) -> Wanted:
    """What a person asks for, checked.

    Raises
    ------
    InputError
        No time, or no latitude and longitude.
    """
    when, whole_day = as_time(time) if time is not None else (None, False)
    return Wanted(when, whole_day, place and as_place(place), None if station is None else str(station))


def as_place(given: object) -> tuple[float, float]:
    """Latitude and longitude in degrees.

    Raises
    ------
    InputError
        It is no place on Earth.
    """
    try:
        latitude, longitude = (float(part) for part in given)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        latitude = longitude = math.nan
    if not (-90.0 <= latitude <= 90.0 and -360.0 <= longitude <= 360.0):
        raise InputError(
            "no place", key="place", value=given, expected="(latitude, longitude) in degrees, north and east"
        )
    return latitude, longitude


def chosen(labels: Sequence[Label], want: Wanted, file: str) -> int:
    """Index of the one sounding that is wanted.

    Raises
    ------
    InputError
        None fits, or several do; what there is is listed.
    """
    fitting = [index for index, label in enumerate(labels) if want.fits(label)]
    if want.place is not None and len(fitting) > 1:
        away = [_apart(want.place, label.place) if (label := labels[i]).place else 0.0 for i in fitting]
        fitting = [index for index, far in zip(fitting, away, strict=True) if far <= min(away) + 1e-6]
    if len(fitting) == 1:
        return fitting[0]
    asked = {"time": want.time, "place": want.place, "station": want.station}
    keys = [key for key, value in asked.items() if value is not None]
    if not fitting:
        raise InputError(
            "no such sounding",
            file=file,
            key=", ".join(keys),
            value=", ".join(_shown(asked[key]) for key in keys),
            expected=_there(labels, want),
        )
    raise InputError(
        f"{len(fitting)} soundings could be meant",
        file=file,
        key="time" if want.time is None or want.whole_day else "station",
        expected=_there([labels[index] for index in fitting], want),
        remedy="say which by time=, station= or place=",
    )


def _shown(value: object) -> str:
    return f"{value:%Y-%m-%d %H:%M}" if isinstance(value, datetime) else str(value)


def _there(labels: Sequence[Label], want: Wanted) -> str:
    """The soundings there are; of many, those nearest in time."""
    if len(labels) <= _SHOWN:
        return "one of " + "; ".join(label.words() for label in labels)
    near = [label for label in labels if label.time]
    if want.time is not None and near:
        sought = want.time
        near = sorted(near, key=lambda label: abs((label.time or sought) - sought))[: _SHOWN // 2]
        return (
            f"one of {len(labels)} from {labels[0].words()} to {labels[-1].words()}, next to it "
            + "; ".join(label.words() for label in near)
        )
    return f"one of {len(labels)} from {labels[0].words()} to {labels[-1].words()}"


def _apart(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Arc between two places on a sphere [degree]."""
    (a, b), (c, d) = (tuple(map(math.radians, place)) for place in (one, other))
    cosine = math.sin(a) * math.sin(c) + math.cos(a) * math.cos(c) * math.cos(b - d)
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
