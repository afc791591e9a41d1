"""Units at the door: a person may write ``"1.5 km"`` or ``"30 degC"``; inside everything is SI.

Limits: a number and one unit name from a short table. No products, no prefixes beyond those listed, no
guessing: what is not in the table of the wanted quantity is refused with the list of what is.
"""

from __future__ import annotations

import math
import re
from typing import Final

__all__ = ["UnitError", "accepted_units", "looks_like_quantity", "to_unit"]

# wanted unit → {accepted name: (factor, offset)}, wanted = factor · given + offset
_TABLE: Final[dict[str, dict[str, tuple[float, float]]]] = {
    "m": {"m": (1.0, 0.0), "km": (1e3, 0.0), "cm": (1e-2, 0.0), "mm": (1e-3, 0.0), "um": (1e-6, 0.0),
          "nm": (1e-9, 0.0), "ft": (0.3048, 0.0)},
    "s": {"s": (1.0, 0.0), "ms": (1e-3, 0.0), "min": (60.0, 0.0), "h": (3600.0, 0.0), "d": (86400.0, 0.0)},
    "K": {"K": (1.0, 0.0), "degC": (1.0, 273.15), "C": (1.0, 273.15), "°C": (1.0, 273.15),
          "degF": (5.0 / 9.0, 459.67 * 5.0 / 9.0)},
    "Pa": {"Pa": (1.0, 0.0), "hPa": (100.0, 0.0), "kPa": (1e3, 0.0), "mbar": (100.0, 0.0), "bar": (1e5, 0.0)},
    "degree": {"deg": (1.0, 0.0), "degree": (1.0, 0.0), "degrees": (1.0, 0.0), "°": (1.0, 0.0),
               "rad": (180.0 / math.pi, 0.0), "arcmin": (1.0 / 60.0, 0.0), "arcsec": (1.0 / 3600.0, 0.0)},
    "rad": {"rad": (1.0, 0.0), "mrad": (1e-3, 0.0), "deg": (math.pi / 180.0, 0.0),
            "arcmin": (math.pi / 10800.0, 0.0), "arcsec": (math.pi / 648000.0, 0.0)},
    "m/s": {"m/s": (1.0, 0.0), "km/h": (1.0 / 3.6, 0.0), "cm/s": (1e-2, 0.0), "kn": (1852.0 / 3600.0, 0.0)},
    "m2/s": {"m2/s": (1.0, 0.0), "cm2/s": (1e-4, 0.0), "mm2/s": (1e-6, 0.0)},
    "W": {"W": (1.0, 0.0), "kW": (1e3, 0.0), "MW": (1e6, 0.0)},
    "N": {"N": (1.0, 0.0), "kN": (1e3, 0.0)},
    "W/m2": {"W/m2": (1.0, 0.0), "kW/m2": (1e3, 0.0)},
    "W/m2/K": {"W/m2/K": (1.0, 0.0)},
    "m3/kg": {"m3/kg": (1.0, 0.0), "cm3/g": (1e-3, 0.0)},
    "electrons": {"electrons": (1.0, 0.0), "electron": (1.0, 0.0), "e-": (1.0, 0.0)},
    "1": {"1": (1.0, 0.0), "%": (1e-2, 0.0), "ppm": (1e-6, 0.0)},
}  # fmt: skip
_ALIASES: Final[dict[str, str]] = {
    "deg": "degree", "degrees": "degree", "m s-1": "m/s", "m2 s-1": "m2/s", "m^2/s": "m2/s", "m²/s": "m2/s",
    "W m-2": "W/m2", "W/m^2": "W/m2", "W/m²": "W/m2", "W m-2 K-1": "W/m2/K", "W/(m2 K)": "W/m2/K",
    "m3 kg-1": "m3/kg", "m³/kg": "m3/kg", "": "1", "dimensionless": "1",
}  # fmt: skip
# Differences and temperatures share the name "K"; a difference has no offset.
_DIFFERENCE: Final[dict[str, float]] = {"K": 1.0, "degC": 1.0, "C": 1.0, "°C": 1.0, "degF": 5.0 / 9.0}
_QUANTITY: Final = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z°%µ][^(*+]*?)?\s*")


class UnitError(ValueError):
    """A text that is no number with a unit of the wanted kind."""


def accepted_units(unit: str) -> tuple[str, ...]:
    """Names accepted where `unit` is wanted (``"K difference"`` for temperature differences)."""
    if unit == "K difference":
        return tuple(_DIFFERENCE)
    name = _ALIASES.get(unit, unit)
    return tuple(_TABLE.get(name, {name: (1.0, 0.0)}))


def looks_like_quantity(text: str) -> bool:
    """Whether `text` is a number followed by at most one word, as ``"2 km"`` or ``"5%"``."""
    return _QUANTITY.fullmatch(text) is not None


def to_unit(text: str, unit: str) -> float:
    """Convert a text such as ``"1.5 km"`` into a number of `unit`.

    Parameters
    ----------
    text : str
        A number, optionally followed by the name of a unit. A bare number is taken to be in `unit`.
    unit : str
        The wanted unit, such as ``"m"``, ``"K"``, ``"K difference"``, ``"degree"`` or ``"1"``.

    Returns
    -------
    float
        The value in `unit`.

    Raises
    ------
    UnitError
        If `text` is no number with a unit, or its unit measures something else.

    Examples
    --------
    >>> to_unit("1.5 km", "m")
    1500.0
    >>> to_unit("30 degC", "K")
    303.15
    >>> to_unit("30 degC", "K difference")
    30.0
    """
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise UnitError(f"a number, or a number with a unit ({', '.join(accepted_units(unit))})")
    number, given = float(match[1]), match[2]
    if given is None:
        return number
    if unit == "K difference":
        factors = {name: (factor, 0.0) for name, factor in _DIFFERENCE.items()}
    else:
        name = _ALIASES.get(unit, unit)
        factors = _TABLE.get(name, {name: (1.0, 0.0)})
    if given not in factors:
        raise UnitError(f"a number with one of the units {', '.join(factors)}")
    factor, offset = factors[given]
    return factor * number + offset
