"""The section of a scene that states air in layers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Protocol, Self, TypeAlias, final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from nigemizu.air.courses import Continued, Course, Linear, Near, Smooth, Standard, Summed
from nigemizu.air.earth import Earth
from nigemizu.air.layers import Layer
from nigemizu.air.profile import Profile
from nigemizu.air.rows import COLDEST, HOTTEST, Rows, refuse_other_pressures
from nigemizu.air.standards import STANDARD_TOP, standard_atmosphere, standard_gravity
from nigemizu.air.surface_layer import SurfaceLayer
from nigemizu.errors import InputError
from nigemizu.values import Value

__all__ = ["MeasuredAir", "ProfileSpec"]

FloatArray: TypeAlias = NDArray[np.float64]

_HUMID: Final = 12_000.0  # m, over which a standard's relative humidity falls to 0
_FADING: Final = 3_000.0  # m, over which what continues a table forgets it
_DRYING: Final = 2_000.0  # m, over which the vapour above a table falls to 1/e
_JOINING: Final = 200.0  # m, at most, over which the gradient above a table forgets that of its last rows
_BLENDING: Final = 50.0  # m, above which a surface layer fades
_THIN: Final = 2_000.0  # Pa at the ground: less is in hPa

# What is no number is refused with its row, by `Rows`.
Numbers = tuple[Annotated[float, Field(allow_inf_nan=True)], ...]


class MeasuredAir(Protocol):
    """A column that was read from a file (`nigemizu.heat.read_sounding`)."""

    @property
    def height(self) -> FloatArray: ...
    @property
    def pressure(self) -> FloatArray: ...
    @property
    def temperature(self) -> FloatArray: ...
    @property
    def vapour_fraction(self) -> FloatArray: ...


@final
class ProfileSpec(Value):
    """Air in layers: a standard atmosphere, a table or a sounding, and what lies on top of it.

    Parameters
    ----------
    kind : {"us1976", "isa", "table", "file"}
        U.S. Standard Atmosphere 1976 or ISA, which are one up to 80 km; `heights` and `temperatures`; or a
        file.
    surface_temperature : float, K, optional
        Of a standard atmosphere at height 0: the difference to 288.15 K fades linearly to the tropopause.
    surface_pressure : float, Pa, optional
        At the lowest row, or height 0; unless given here or by the data, that of the standard there.
    relative_humidity : float, 1
        Of a standard atmosphere at height 0; falls linearly to 0 at 12 km.
    heights : list of float, m
        Of a table, increasing.
    temperatures : list of float, K
        At them.
    pressures : list of float, Pa, optional
        At them. The first one counts; the others must be within 5 % of what the weight of the air makes them.
    relative_humidities : list of float, 1
        At them, in between as the temperatures, fading over 2 km above; dry if left out.
    file : path, optional
        A sounding (University of Wyoming, IGRA), a column of a model (netCDF) or a table (CSV, TOML).
    smoothing : float, m, optional
        Straight lines through the points whose corners are rounded over this length; 0 leaves the corners
        (which make false folds in an image). Left out: cubics through the points with a continuous slope,
        without extremes of their own.
    beyond : {"standard", "isothermal"}
        Above a table: the standard atmosphere, to which the last temperature fades over 3 km; or as warm as
        the last point. The gradient passes from the one to the other over the last interval, 200 m at most,
        or over `smoothing`.
    layers : list of layers
        Added on top: ``inversion``, ``exponential``, ``gaussian``. Their heights count from height 0.
    surface_layer : SurfaceLayer, optional
        Air that the ground warms or cools while the wind mixes it; its `blending_height` is 50 m where it is
        not given. The profile is shifted, by a difference that fades over 3 km, to meet its air temperature.
        Its ground is at height 0 (and some 0.02 K off, as the shift and the profile's own gradient count down
        to there); below the first row of a table that row holds.
    top : float, m
        Where the air ends; 86 km for the standard of 1976, 80 km for ISA.

    Notes
    -----
    Pressures follow from the temperatures, from that at the lowest height up, which overrules measured ones;
    `Profile.notes` says by how much they differ. Of a standard atmosphere gravity is the standard's; of
    tables and soundings that of the Earth's latitude.
    """

    kind: Literal["us1976", "isa", "table", "file"] = "us1976"
    surface_temperature: Annotated[float, Field(ge=COLDEST, le=HOTTEST)] | None = Field(
        None, json_schema_extra={"unit": "K"}
    )
    surface_pressure: Annotated[float, Field(ge=_THIN, le=1e6)] | None = Field(
        None, json_schema_extra={"unit": "Pa"}
    )
    relative_humidity: Annotated[float, Field(ge=0, le=1, json_schema_extra={"unit": "1"})] = 0.0
    heights: Annotated[Numbers, Field(json_schema_extra={"unit": "m"})] = ()
    temperatures: Annotated[Numbers, Field(json_schema_extra={"unit": "K"})] = ()
    pressures: Annotated[Numbers, Field(json_schema_extra={"unit": "Pa"})] = ()
    relative_humidities: Annotated[Numbers, Field(json_schema_extra={"unit": "1"})] = ()
    file: Path | None = None
    smoothing: Annotated[float, Field(ge=0)] | None = Field(None, json_schema_extra={"unit": "m"})
    beyond: Literal["standard", "isothermal"] = "standard"
    surface_layer: SurfaceLayer | None = None
    layers: tuple[Layer, ...] = ()
    top: Annotated[float, Field(gt=1000, le=86_000)] | None = Field(None, json_schema_extra={"unit": "m"})

    @model_validator(mode="after")
    def _is_one_profile(self) -> Self:
        for name in ("heights", "temperatures", "pressures", "relative_humidities"):
            if getattr(self, name) and self.kind != "table":
                raise InputError("goes with a table only", key=f"profile.{name}", remedy='set kind = "table"')
        if (self.file is not None) != (self.kind == "file"):
            raise InputError(
                "is missing" if self.kind == "file" else "goes with a file only",
                key="profile.file",
                remedy="name the sounding" if self.kind == "file" else 'set kind = "file"',
            )
        if self.kind == "table":
            self._rows().refuse()
        self._refuse_unused()
        return self

    def _refuse_unused(self) -> None:
        """What would be given in vain."""
        standard = self.kind in ("us1976", "isa")
        unused = {
            "surface_temperature": not standard and self.surface_temperature is not None,
            "relative_humidity": not standard and self.relative_humidity > 0,
            "smoothing": standard and self.smoothing is not None,
            "beyond": standard and self.beyond != "standard",
        }
        for key, given in unused.items():
            if given:
                owner = "tables and soundings" if standard else "a standard atmosphere"
                remedy = None
                if key == "relative_humidity" and self.kind == "table":
                    remedy = "give relative_humidities, one for each height"
                raise InputError(
                    f"belongs to {owner}", key=f"profile.{key}", value=getattr(self, key), remedy=remedy
                )
        if self.pressures and self.surface_pressure is not None:
            raise InputError("is given by the first of the pressures", key="profile.surface_pressure")

    def _rows(self) -> Rows:
        return Rows(self.heights, self.temperatures, self.pressures, self.relative_humidities)

    def build(
        self, earth: Earth, measured: MeasuredAir | None = None, *, target: float | None = None
    ) -> Profile:
        """The profile over an Earth.

        Parameters
        ----------
        earth : Earth
            Its gravity counts, unless the profile is a standard.
        measured : MeasuredAir, optional
            What was read from `file`.
        target : float, m, optional
            Height up to which there have to be data, not their continuation.

        Raises
        ------
        InputError
            If the file has not been read, if what was read is no column of air, if data lie above `top` or
            end below the target, or if pressures contradict the temperatures.
        """
        if measured is not None and self.kind != "file":
            raise InputError("has no use for what was measured", key="profile.kind", value=self.kind)
        top = self.top or STANDARD_TOP["isa" if self.kind == "isa" else "us1976"]
        if self.kind in ("us1976", "isa"):
            offset = 0.0 if self.surface_temperature is None else self.surface_temperature - 288.15
            humidity = Continued(
                Linear(np.array([0.0, _HUMID]), np.array([self.relative_humidity, 0.0])), _HUMID, None, 1.0
            )
            pressure = (
                float(standard_atmosphere(0.0)[1]) if self.surface_pressure is None else self.surface_pressure
            )
            rest: dict[str, Any] = {"base": 0.0, "top": top, "surface_pressure": pressure}
            course = self._with_layers(Standard(offset))
            return Profile(course, humidity, "relative humidity", gravity=standard_gravity, **rest)
        if self.kind == "file" and measured is None:
            raise InputError("has not been read", key="profile.file", value=str(self.file))
        profile = self._of_data(earth, top, measured)
        if target is not None and target > profile.measured_top:
            raise InputError(
                f"the data end at {profile.measured_top:g} m, below the target",
                key="profile",
                value=target,
                remedy="take a higher sounding or a lower target",
            )
        return profile

    def _of_data(self, earth: Earth, top: float, measured: MeasuredAir | None) -> Profile:
        """The profile through a table, or what was measured, and on up to the top."""
        rows, vapour_is = self._rows(), "relative humidity"
        if measured is not None:
            parts = (measured.height, measured.temperature, measured.pressure, measured.vapour_fraction)
            names = ("height", "temperature", "pressure", "vapour_fraction")
            rows, vapour_is = Rows(*parts, names, None if self.file is None else str(self.file)), "fraction"
            rows.refuse()
        heights, temperatures, pressures, vapours = (np.array(part, dtype=np.float64) for part in rows[:4])
        vapours = vapours if len(vapours) else np.zeros_like(heights)
        first, last = float(heights[0]), float(heights[-1])
        if last >= top:
            raise InputError("the data reach above the top of the air", key="profile.top", value=top)
        at_first = self.surface_pressure or float([*pressures, *standard_atmosphere(heights[:1])[1]][0])
        levels = self._down_to_ground(heights)
        if len(levels) > len(heights):
            temperatures, vapours = (np.concatenate([part[:1], part]) for part in (temperatures, vapours))
        course, humid = self._courses(levels, temperatures, vapours, top)
        rest: dict[str, Any] = {"gravity": earth.gravity, "base": float(levels[0]), "top": top}
        rest |= {
            "measured_top": last,
            "notes": (f"above {last:g} m the {self.beyond} continuation, not data",),
        }
        profile = Profile(course, humid, vapour_is, surface_pressure=at_first, **rest)
        if len(levels) > len(heights):
            at_ground = at_first**2 / float(profile.at(first)[1])
            profile = Profile(course, humid, vapour_is, surface_pressure=at_ground, **rest)
        if len(pressures):
            at_rest = profile.at(heights)[1]
            if self.pressures:
                refuse_other_pressures(pressures, at_rest)
            off = float(np.abs(pressures / at_rest - 1).max())
            note = f"pressures given differ by up to {off:.2%} from those of air at rest, which count"
            return replace(profile, notes=(*profile.notes, note))
        return profile

    def _courses(
        self, heights: FloatArray, temperatures: FloatArray, vapours: FloatArray, top: float
    ) -> tuple[Course, Course]:
        """Temperature, and vapour, through the rows and above them."""
        last = float(heights[-1])
        other = Standard() if self.beyond == "standard" else None
        joining = (
            min(float(heights[-1] - heights[-2]), _JOINING) if self.smoothing is None else self.smoothing
        )
        course: Course = Continued(self._through(heights, temperatures), last, other, _FADING, joining)
        dry = Linear(np.array([0.0, top]), np.zeros(2))
        moist = np.any(vapours > 0)
        humid = Continued(self._through(heights, vapours), last, dry, _DRYING) if moist else dry
        return self._with_layers(course), humid

    def _through(self, heights: FloatArray, values: FloatArray) -> Course:
        if self.smoothing is None and len(heights) > 2:
            return Smooth(heights, values)
        return Linear(heights, values, self.smoothing or 0.0)

    def _down_to_ground(self, heights: FloatArray) -> FloatArray:
        """The heights of the rows, and height 0 below them for a surface layer."""
        if self.surface_layer is None or heights[0] == 0:
            return heights
        blending = self.surface_layer.blending_height or _BLENDING
        if not 0 < heights[0] <= blending:
            raise InputError(
                "stands on the ground, at height 0, which the data do not reach"
                if heights[0] > 0
                else "stands on the ground, at height 0, and the data begin below it",
                key="profile.surface_layer",
                value=float(heights[0]),
                expected=f"a first row between 0 and {blending:g} m",
            )
        return np.concatenate([[0.0], heights])

    def _with_layers(self, course: Course) -> Course:
        if self.surface_layer is not None:
            layer = self.surface_layer
            if layer.blending_height is None:
                layer = layer.model_copy(update={"blending_height": _BLENDING})
            course = Near(course, layer, _FADING)
        return Summed(course, self.layers) if self.layers else course
