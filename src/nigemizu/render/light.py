"""The light: sun, sky and haze."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self, final

from pydantic import Field, model_validator

from nigemizu.air import Extinction
from nigemizu.errors import InputError
from nigemizu.values import Value

__all__ = ["Light", "Moon"]

_TWILIGHT: Final = -8.0  # degrees, below which the sky that is computed has no light left

Reflectance = tuple[
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=0, le=1)],
]
Radiance = tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(ge=0)], Annotated[float, Field(ge=0)]]


@final
class Moon(Value):
    """The Moon in a physical sky.

    Parameters
    ----------
    elevation : float, degrees
        Of its middle above the horizontal, without the air.
    azimuth : float, degrees
        0 = ahead (+x), positive to the left.
    speed : (azimuth, elevation) float, degree/s
        How fast it moves.
    diameter : float, degrees
        Its apparent diameter without the air: 0.49 to 0.56.
    phase_angle : float, degrees
        Angle Sun – Moon – eye: 0 is the full Moon, 90 the half Moon.
    lit_side : float, degrees
        Direction from the Moon's middle to the middle of its bright limb, from up clockwise.
    """

    elevation: Annotated[float, Field(ge=-5, le=90, json_schema_extra={"unit": "degree"})] = 1.0
    azimuth: Annotated[float, Field(ge=-360, le=360, json_schema_extra={"unit": "degree"})] = 0.0
    speed: Annotated[tuple[float, float], Field(json_schema_extra={"unit": "degree/s"})] = (0.0, 0.0)
    diameter: Annotated[float, Field(ge=0.4, le=0.6, json_schema_extra={"unit": "degree"})] = 0.5181
    phase_angle: Annotated[float, Field(ge=0, le=180, json_schema_extra={"unit": "degree"})] = 0.0
    lit_side: Annotated[float, Field(ge=-360, le=360, json_schema_extra={"unit": "degree"})] = 90.0


@final
class Light(Value):
    """Sun and sky over the scene.

    Brightness is relative: sun and sky together are scaled so that a white horizontal surface in full
    light has radiance 1 (before the camera's exposure). Only under the physical sky it is absolute: 1 is the
    radiance of a white surface that faces the Sun outside the air.

    Parameters
    ----------
    sky : {"sunsky", "gradient", "constant", "physical"}
        ``sunsky``: the clear-sky model of Hošek and Wilkie (2012), with its sun. ``gradient``: from
        `horizon_colour` to `zenith_colour`, with a white sun, for teaching: what is seen in the "water"
        is told apart at a glance. ``constant``: `horizon_colour` everywhere and no sun. ``physical``: Sun,
        Moon and sky as the layers of the scene's `profile` let them be seen, wavelength by wavelength along
        rays that are bent each by its own index.
    sun_azimuth : float, degrees
        0 = ahead (+x), positive to the left, 180 = behind the camera that looks ahead.
    sun_elevation : float, degrees
        Above the horizon. Under the physical sky, of the middle of the Sun without the air, at time 0: down
        to −8.
    sun_speed : (azimuth, elevation) float, degree/s
        How fast the Sun moves in a physical sky; 15°/h on a steep course are (0, −0.00417).
    moon : Moon, optional
        Of a physical sky.
    wavelengths : int
        Number of wavelengths of a physical sky.
    extinction : Extinction
        What the air of a physical sky scatters and absorbs.
    turbidity : float
        1 (pure air) to 10 (very hazy); only for ``sunsky``.
    ground_albedo : float
        Reflectance of the ground that lights the sky from below; only for ``sunsky``.
    sun_scale, sky_scale : float
        Factors on the sun and on the sky (0 switches one off) before both are scaled together.
    horizon_colour, zenith_colour : (r, g, b)
        Linear radiance of the ``gradient`` and ``constant`` skies, relative to each other.
    visibility : float, m, optional
        Meteorological range of the haze: the distance at which 2 % of an object's contrast is left
        (Koschmieder). Left out: perfectly clear air.
    """

    sky: Literal["sunsky", "gradient", "constant", "physical"] = "sunsky"
    sun_azimuth: Annotated[float, Field(ge=-360, le=360, json_schema_extra={"unit": "degree"})] = 130.0
    sun_elevation: Annotated[float, Field(ge=-90, le=90, json_schema_extra={"unit": "degree"})] = 50.0
    sun_speed: Annotated[tuple[float, float], Field(json_schema_extra={"unit": "degree/s"})] = (0.0, 0.0)
    moon: Moon | None = None
    wavelengths: Annotated[int, Field(ge=4, le=128)] = 16
    extinction: Extinction = Extinction()
    turbidity: Annotated[float, Field(ge=1, le=10)] = 3.0
    ground_albedo: Annotated[float, Field(ge=0, le=1)] = 0.3
    sun_scale: Annotated[float, Field(ge=0)] = 1.0
    sky_scale: Annotated[float, Field(ge=0)] = 1.0
    horizon_colour: Radiance = (0.75, 0.85, 1.0)
    zenith_colour: Radiance = (0.15, 0.35, 0.8)
    visibility: Annotated[float, Field(gt=0)] | None = Field(None, json_schema_extra={"unit": "m"})

    @model_validator(mode="after")
    def _sun_shines(self) -> Self:
        lowest = _TWILIGHT if self.sky == "physical" else 0.0
        if self.sun_elevation < lowest or (self.sun_elevation == 0 and lowest == 0):
            raise InputError(
                "the Sun is below the horizon" if lowest == 0 else "the Sun is so low that it is night",
                key="light.sun_elevation",
                value=self.sun_elevation,
                expected=f"degrees above {lowest:g}"
                + ("" if lowest else '; with sky = "physical", above -8'),
            )
        return self

    def at(self, time: float) -> Light:
        """The light at a time [s]: Sun and Moon moved on."""
        if self.sky != "physical":
            return self
        azimuth, elevation = self.sun_speed
        changes: dict[str, object] = {
            "sun_azimuth": self.sun_azimuth + azimuth * time,
            "sun_elevation": self.sun_elevation + elevation * time,
        }
        if self.moon is not None:
            azimuth, elevation = self.moon.speed
            place = {
                "azimuth": self.moon.azimuth + azimuth * time,
                "elevation": self.moon.elevation + elevation * time,
            }
            changes["moon"] = self.moon.model_copy(update=place)
        return self.model_copy(update=changes)

    @property
    def moves(self) -> bool:
        """Whether Sun or Moon change their place in time."""
        return self.sky == "physical" and any(
            (*self.sun_speed, *(() if self.moon is None else self.moon.speed))
        )
