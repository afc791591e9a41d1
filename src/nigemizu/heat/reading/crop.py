"""Cutting out a box of the air before any of it is read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
import xarray as xr

from nigemizu.errors import InputError

__all__ = ["Crop", "checked_crop", "cut", "split_crop"]

Crop: TypeAlias = Mapping[str, tuple[float | None, float | None]]

_AXES: Final = ("time", "z", "y", "x")
_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE: Final = rf"\w+=(?:{_NUMBER})?:(?:{_NUMBER})?"
_TAIL: Final = re.compile(rf"(?P<path>.+)@(?P<crop>{_RANGE}(?:,{_RANGE})*)", re.DOTALL)


def split_crop(source: str) -> tuple[str, dict[str, tuple[float | None, float | None]]]:
    """Take ``AIR@x=0:200,z=:50`` apart.

    Parameters
    ----------
    source : str
        A path, perhaps followed by ``@`` and ranges of x, y, z (m) and time (s), each ``axis=from:to`` with
        either end left out where it is open. A file that has this very name is meant as it is.

    Returns
    -------
    path : str
    crop : dict
        As `read_air` takes it; empty when there is none.

    Examples
    --------
    >>> split_crop("les.zarr@x=0:200,time=600:")
    ('les.zarr', {'x': (0.0, 200.0), 'time': (600.0, None)})
    """
    match = _TAIL.fullmatch(source)
    if match is None or Path(source).exists():
        return source, {}
    crop: dict[str, tuple[float | None, float | None]] = {}
    for part in match["crop"].split(","):
        axis, _, ends = part.partition("=")
        low, _, high = ends.partition(":")
        if axis in crop:
            raise InputError("this axis is cropped twice", key=axis, value=source)
        crop[axis] = (float(low) if low else None, float(high) if high else None)
    return match["path"], crop


def checked_crop(crop: Crop | None, file: str | None) -> dict[str, tuple[float, float]]:
    """The box with its open ends at infinity.

    Raises
    ------
    InputError
        An unknown axis, or a range that is none.
    """
    box = {}
    for axis, ends in (crop or {}).items():
        if axis not in _AXES:
            raise InputError("no such axis to crop", file=file, key=axis, expected="x, y, z or time")
        try:
            low, high = (
                (-np.inf if ends[0] is None else float(ends[0])),
                (np.inf if ends[1] is None else float(ends[1])),
            )
            pair = len(ends) == 2
        except (TypeError, ValueError, IndexError):
            low, high, pair = np.nan, np.nan, False
        if not (pair and low <= high):
            raise InputError(
                "not a range", file=file, key=f"crop.{axis}", value=ends, expected="two numbers, low to high"
            )
        box[axis] = (low, high)
    return box


def cut(axis: xr.DataArray, low: float, high: float, file: str | None) -> slice:
    """Where the increasing coordinate lies in [low, high].

    Raises
    ------
    InputError
        Nowhere.
    """
    values = axis.values
    start, stop = int(np.searchsorted(values, low, "left")), int(np.searchsorted(values, high, "right"))
    if start >= stop:
        unit = axis.attrs.get("units", "")
        near = f", next to it {values[max(start - 1, 0)]:g} and {values[min(start, values.size - 1)]:g}"
        raise InputError(
            "nothing lies in this range",
            file=file,
            key=f"crop.{axis.dims[0]}",
            value=[low, high],
            expected=f"part of {values[0]:g} to {values[-1]:g} {unit}{near}",
        )
    return slice(start, stop)
