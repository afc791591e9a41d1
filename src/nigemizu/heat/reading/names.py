"""What other programs call the variables of air."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Final, NamedTuple

import xarray as xr

from nigemizu.errors import InputError
from nigemizu.heat.reading.units import FRACTION, KELVIN, MASS_FRACTION, PASCAL, SPEED, Units

__all__ = ["LOOKED_FOR", "Kind", "described", "find_variables"]


class Kind(NamedTuple):
    """A variable that is looked for.

    Attributes
    ----------
    units : Units
    low, high : float
        Range in which its SI values are believable.
    aliases : tuple of str
        What PALM, MicroHH, DALES, SAM and others call it, besides its CF standard names.
    standard_names : tuple of str
        CF standard names besides our own.
    """

    units: Units
    low: float
    high: float
    aliases: tuple[str, ...] = ()
    standard_names: tuple[str, ...] = ()


LOOKED_FOR: Final[dict[str, Kind]] = {
    "air_temperature": Kind(KELVIN, 100.0, 5000.0, ("ta", "temperature", "TABS", "tabs", "tk", "T")),
    "air_potential_temperature": Kind(
        *(KELVIN, 100.0, 5000.0),
        ("theta", "pt", "th", "thl", "thetal", "theta_l", "lpt", "potential_temperature"),
    ),
    "surface_temperature": Kind(KELVIN, 100.0, 5000.0),
    "air_pressure": Kind(PASCAL, 1.0, 1e7, ("phydro", "ph", "hyp", "pressure", "pres")),
    "relative_humidity": Kind(FRACTION, 0.0, 1.0, ("rh", "hur", "relhum")),
    "specific_humidity": Kind(MASS_FRACTION, -0.1, 1.0, ("qv", "hus", "q", "qt")),
    "humidity_mixing_ratio": Kind(MASS_FRACTION, -0.1, 1.0),
    "air_refractivity": Kind(FRACTION, 0.0, 0.1),
    "x_wind": Kind(SPEED, -400.0, 400.0, ("u", "ua", "u_wind"), ("eastward_wind",)),
    "y_wind": Kind(SPEED, -400.0, 400.0, ("v", "va", "v_wind"), ("northward_wind",)),
    "upward_air_velocity": Kind(SPEED, -400.0, 400.0, ("w", "wa", "w_wind")),
}
"""Not among the aliases: p, which PALM and MicroHH give to the perturbation of the pressure."""

_MAIN: Final = ("air_temperature", "air_potential_temperature", "air_refractivity")
_WIND: Final = ("x_wind", "y_wind", "upward_air_velocity")
_LISTED: Final = 12


def find_variables(
    dataset: xr.Dataset, names: Mapping[str, str] | None, wind: bool, file: str | None
) -> dict[str, str]:
    """Map our names to those of the file.

    Parameters
    ----------
    dataset : xarray.Dataset
    names : mapping of str to str, optional
        Our name to the file's, where a person knows better.
    wind : bool
        Whether the wind is looked for.
    file : str, optional
        Named in errors.

    Returns
    -------
    dict of str to str
        Holds one of the temperatures or the refractivity.

    Raises
    ------
    InputError
        Nothing tells the index of refraction (what is there is listed), or several variables could be meant.

    Notes
    -----
    A variable is known, in this order, by `names`, by our name, by its ``standard_name``, by an alias. An
    alias does not count where the description says something else ("potential" for a temperature,
    "perturbation" for anything). Of two temperatures the absolute one is taken, of two humidities the
    relative one.
    """
    for ours, theirs in (names or {}).items():
        if ours not in LOOKED_FOR:
            raise InputError(
                "no such name", file=file, key=f"names.{ours}", expected="one of " + ", ".join(LOOKED_FOR)
            )
        if theirs not in dataset.variables:
            raise InputError(
                "no such variable",
                file=file,
                key=f"names.{ours}",
                value=theirs,
                expected="one of " + described(dataset),
            )
    found = dict(names or {})
    for ours, kind in LOOKED_FOR.items():
        if ours not in found and (wind or ours not in _WIND):
            match = _match(dataset, ours, kind, file)
            if match is not None and match not in found.values():
                found[ours] = match
    if not any(name in found for name in _MAIN):
        raise _unknown(dataset, file)
    if "air_temperature" in found:
        found.pop("air_potential_temperature", None)
    humidities = ("relative_humidity", "specific_humidity", "humidity_mixing_ratio")
    for worse in [name for name in humidities if name in found][1:]:
        del found[worse]
    return found


def _match(dataset: xr.Dataset, ours: str, kind: Kind, file: str | None) -> str | None:
    if ours in dataset.data_vars:
        return ours
    for standard in (ours, *kind.standard_names):
        matches = [
            str(name)
            for name, array in dataset.data_vars.items()
            if array.attrs.get("standard_name") == standard
        ]
        if len(matches) > 1:
            raise InputError(
                f"several variables have the standard_name {standard}: {', '.join(matches)}",
                file=file,
                remedy=f"name the right one {ours}",
            )
        if matches:
            return matches[0]
    for alias in kind.aliases:
        if alias in dataset.data_vars and not _contradicts(dataset[alias], ours, kind):
            return alias
    return None


def _contradicts(array: xr.DataArray, ours: str, kind: Kind) -> bool:
    """Whether the description of a variable with a short name says that it is something else."""
    attributes = array.attrs
    words = f"{attributes.get('long_name', '')} {attributes.get('description', '')}".lower()
    units = str(attributes.get("units", "")).strip().lower()
    another = attributes.get("standard_name", ours) not in (ours, *kind.standard_names)
    return (
        "perturbation" in words
        or ("potential" in words and ours == "air_temperature")
        or "virtual" in words
        or (bool(units) and units not in kind.units.known)
        or (another and attributes["standard_name"] in LOOKED_FOR)
    )


def described(dataset: xr.Dataset) -> str:
    """The variables of a dataset, each with its dimensions and units."""
    if not dataset.data_vars:
        return "no variable at all"
    shown = [
        f"{name}({', '.join(map(str, array.dims))})"
        + (f" [{array.attrs['units']}]" if array.attrs.get("units") else "")
        for name, array in list(dataset.data_vars.items())[:_LISTED]
    ]
    more = len(dataset.data_vars) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")


def _unknown(dataset: xr.Dataset, file: str | None) -> InputError:
    expected = " or ".join(
        f"{name} ({', '.join(LOOKED_FOR[name].aliases)})" if LOOKED_FOR[name].aliases else name
        for name in _MAIN
    )
    near = _nearest(dataset)
    return InputError(
        "no variable air_temperature, nor another that tells the index of refraction",
        file=file,
        expected=f"{expected}, by name or standard_name; found {described(dataset)}",
        remedy=None
        if near is None
        else f"is it {near!r}? rename it, set its standard_name, or read_air(..., "
        f"names={{'air_temperature': {near!r}}})",
    )


def _nearest(dataset: xr.Dataset) -> str | None:
    """The variable whose name is most like one that is known, or else the largest in kelvin or °C."""
    names = [str(name) for name in dataset.data_vars]
    for ours in _MAIN:
        for name in (ours, *(alias for alias in LOOKED_FOR[ours].aliases if len(alias) > 3)):
            near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
            if near:
                return near[0]
    warm = [
        array
        for array in dataset.data_vars.values()
        if str(array.attrs.get("units", "")).strip().lower() in KELVIN.known and array.ndim
    ]
    return str(max(warm, key=lambda array: array.ndim).name) if warm else None
