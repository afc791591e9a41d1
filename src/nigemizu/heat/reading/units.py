"""Units at the door: what a file's ``units`` may say, and how it becomes SI."""

from __future__ import annotations

from typing import Final, NamedTuple

from nigemizu.errors import InputError

__all__ = ["FRACTION", "KELVIN", "MASS_FRACTION", "METRE", "PASCAL", "SECOND", "SPEED", "Units"]


class Units(NamedTuple):
    """Units of one kind.

    Attributes
    ----------
    si : str
        The SI unit.
    kind : str
        What is expected, for a person.
    known : dict of str to (float, float)
        Factor and offset to SI of each spelling, in lower case.
    """

    si: str
    kind: str
    known: dict[str, tuple[float, float]]

    def to_si(self, units: str, name: str, file: str | None) -> tuple[float, float]:
        """Factor and offset of `units`; those without any are taken as SI.

        Raises
        ------
        InputError
            `units` is of another kind.
        """
        spelling = units.strip().lower()
        if not spelling:
            return 1.0, 0.0
        if spelling not in self.known:
            raise InputError("units of the wrong kind", file=file, key=name, value=units, expected=self.kind)
        return self.known[spelling]


def _spellings(text: str, factor: float = 1.0, offset: float = 0.0) -> dict[str, tuple[float, float]]:
    return dict.fromkeys(text.split(), (factor, offset))


KELVIN: Final = Units(
    "K",
    "a temperature (K, degC)",
    {
        **_spellings("k kelvin kelvins degk deg_k degree_kelvin degrees_kelvin"),
        **_spellings(
            "degc deg_c c °c celsius degree_celsius degrees_celsius degree_c degrees_c", 1.0, 273.15
        ),
        **_spellings("degf °f fahrenheit degree_fahrenheit", 5.0 / 9.0, 273.15 - 160.0 / 9.0),
    },
)
PASCAL: Final = Units(
    "Pa",
    "a pressure (Pa, hPa)",
    {
        **_spellings("pa pascal pascals"),
        **_spellings("hpa mbar millibar millibars mb hectopascal", 100.0),
        **_spellings("kpa", 1e3),
        **_spellings("bar", 1e5),
        **_spellings("atm", 101325.0),
    },
)
FRACTION: Final = Units(
    "1", "1 or %", {**_spellings("1 fraction dimensionless"), **_spellings("% percent", 0.01)}
)
MASS_FRACTION: Final = Units(
    "1",
    "kg/kg or g/kg",
    {
        **_spellings("1 fraction dimensionless kg/kg kgkg-1 kg.kg-1"),
        "kg kg-1": (1.0, 0.0),
        "kg kg^-1": (1.0, 0.0),
        **_spellings("g/kg gkg-1 g.kg-1", 1e-3),
        "g kg-1": (1e-3, 0.0),
        "g kg^-1": (1e-3, 0.0),
    },
)
SPEED: Final = Units(
    "m s-1",
    "a speed (m s-1, km h-1)",
    {
        **_spellings("m/s ms-1 m.s-1"),
        **dict.fromkeys(("m s-1", "m s^-1", "meters s-1", "meter second-1"), (1.0, 0.0)),
        **dict.fromkeys(("km/h", "km h-1"), (1.0 / 3.6, 0.0)),
    },
)
METRE: Final = Units(
    "m",
    "lengths (m, km, cm, mm)",
    {
        **_spellings("m metre metres meter meters"),
        **_spellings("km kilometre kilometres kilometer kilometers", 1e3),
        **_spellings("cm", 1e-2),
        **_spellings("mm", 1e-3),
    },
)
SECOND: Final = Units(
    "s",
    "durations (s, min, h, days), or dates",
    {
        **_spellings("s sec secs second seconds"),
        "time units": (1.0, 0.0),  # of MicroHH's own converter
        **_spellings("ms millisecond milliseconds", 1e-3),
        **_spellings("min mins minute minutes", 60.0),
        **_spellings("h hr hrs hour hours", 3600.0),
        **_spellings("d day days", 86400.0),
    },
)
