"""Names and units of what soundings and tables hold."""

from __future__ import annotations

import difflib
import re
from typing import Final, NamedTuple

from nigemizu.heat.reading.units import FRACTION, KELVIN, MASS_FRACTION, METRE, PASCAL, SPEED, Units

__all__ = ["ALIASES", "UNITS", "Column", "column_of", "nearest_names"]

_LENGTH: Final = Units(
    "m",
    "heights (m, km, ft)",
    {**METRE.known, **dict.fromkeys(("gpm", "geopotential metre", "masl", "magl"), (1.0, 0.0)),
     **dict.fromkeys(("ft", "feet", "foot"), (0.3048, 0.0))},
)  # fmt: skip
_SPEED: Final = Units(
    "m s-1",
    "a speed (m/s, km/h, knots)",
    {**SPEED.known, **dict.fromkeys(("kn", "kt", "kts", "knot", "knots"), (1852.0 / 3600.0, 0.0))},
)
_ANGLE: Final = Units(
    "degree", "an angle (deg)", dict.fromkeys(("deg", "degree", "degrees", "°", "degt"), (1.0, 0.0))
)
_MOLES: Final = Units("1", "1, % or ppm", {**FRACTION.known, "ppm": (1e-6, 0.0), "mol/mol": (1.0, 0.0)})

UNITS: Final = {
    "height": _LENGTH,
    "altitude": _LENGTH,
    "geopotential_height": _LENGTH,
    "pressure": PASCAL,
    "temperature": KELVIN,
    "dew_point": KELVIN,
    "relative_humidity": FRACTION,
    "mixing_ratio": MASS_FRACTION,
    "specific_humidity": MASS_FRACTION,
    "vapour_fraction": _MOLES,
    "wind_speed": _SPEED,
    "wind_direction": _ANGLE,
}

ALIASES: Final = {
    "height": ("height", "height above ground", "height agl", "agl", "z", "level height", "h"),
    "altitude": (
        *("altitude", "alt", "elevation", "height above sea level", "height asl", "height msl"),
        *("height above mean sea level", "asl", "msl", "gps altitude", "hoehe uenn"),
    ),
    "geopotential_height": (
        *("geopotential height", "geopotential", "gph", "gpheight", "hght", "geopot height"),
        *("geopotential altitude",),
    ),
    "pressure": ("pressure", "air pressure", "pres", "press", "p"),
    "temperature": ("temperature", "air temperature", "temp", "t", "ta", "dry bulb", "tair", "air temp"),
    "dew_point": (
        "dew point",
        "dewpoint",
        "dew point temperature",
        "dewpoint temperature",
        "dwpt",
        "td",
        "dewp",
    ),
    "relative_humidity": ("relative humidity", "humidity", "rh", "relh", "rel humidity", "hur"),
    "mixing_ratio": ("mixing ratio", "mixr", "water vapour mixing ratio", "water vapor mixing ratio"),
    "specific_humidity": ("specific humidity", "q", "qv", "hus"),
    "vapour_fraction": (
        *("vapour fraction", "vapor fraction", "water vapour fraction", "water vapor fraction"),
        *("vapour mole fraction", "vapor mole fraction"),
    ),
    "wind_speed": ("wind speed", "speed", "sped", "sknt", "wspd", "ws", "ff"),
    "wind_direction": ("wind direction", "direction", "drct", "wdir", "wd", "dd"),
}
"""In lower case, words parted by single blanks."""

_OURS: Final = {alias: name for name, aliases in ALIASES.items() for alias in aliases}
_BRACKETED: Final = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*")
_JOINT: Final = re.compile(r"_|/|,|\s+in\s+|\s")


class Column(NamedTuple):
    """What a heading means.

    Attributes
    ----------
    name : str
        A key of `UNITS`.
    units : str
        As the heading has them; "" without.
    """

    name: str
    units: str


def column_of(heading: str) -> Column | None:
    """What a heading such as ``"Temperature [°C]"``, ``"temperature_C"`` or ``"p/hPa"`` means, if anything.

    Examples
    --------
    >>> column_of("Dew point (°C)")
    Column(name='dew_point', units='°C')
    >>> column_of("geopotential height_m")
    Column(name='geopotential_height', units='m')
    >>> column_of("ozone [ppm]") is None
    True
    """
    heading = heading.strip().strip("\"'")
    match = _BRACKETED.fullmatch(heading)
    if not match:
        for joint in _JOINT.finditer(heading):
            known = _OURS.get(_plain(heading[: joint.start()]))
            units = heading[joint.end() :].strip()
            if known is not None and units.lower() in UNITS[known].known:
                return Column(known, units)
    name, units = (match[1], match[2]) if match else (heading, "")
    ours = _OURS.get(_plain(name))
    return None if ours is None else Column(ours, units)


def _plain(name: str) -> str:
    return " ".join(re.sub(r"[\W_]+", " ", name).lower().split())


def nearest_names(headings: list[str]) -> str:
    """Which of our names a heading could have meant, or what would match."""
    for heading in headings:
        match = difflib.get_close_matches(
            _plain(_BRACKETED.sub(r"\1", heading)), list(_OURS), n=1, cutoff=0.75
        )
        if match and column_of(heading) is None:
            return f"is {heading!r} the {_OURS[match[0]].replace('_', ' ')}? then call it that"
    return "name the columns " + "; ".join(
        f"{name.replace('_', ' ')} ({', '.join(ALIASES[name][1:5])})"
        for name in ("height", "pressure", "temperature")
    )
