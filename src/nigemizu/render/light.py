"""The light: sun, sky and haze."""

from __future__ import annotations

from typing import Annotated, Literal, final

from pydantic import Field

from nigemizu.values import Value

__all__ = ["Light"]

Reflectance = tuple[
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=0, le=1)],
]
Radiance = tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(ge=0)], Annotated[float, Field(ge=0)]]


@final
class Light(Value):
    """Sun and sky over the scene.

    Brightness is relative: sun and sky together are scaled so that a white horizontal surface in full
    light has radiance 1 (before the camera's exposure).

    Parameters
    ----------
    sky : {"sunsky", "gradient", "constant"}
        ``sunsky``: the clear-sky model of Hošek and Wilkie (2012), with its sun. ``gradient``: from
        `horizon_colour` to `zenith_colour`, with a white sun, for teaching: what is seen in the "water"
        is told apart at a glance. ``constant``: `horizon_colour` everywhere and no sun.
    sun_azimuth : float, degrees
        0 = ahead (+x), positive to the left, 180 = behind the camera that looks ahead.
    sun_elevation : float, degrees
        Above the horizon.
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

    sky: Literal["sunsky", "gradient", "constant"] = "sunsky"
    sun_azimuth: Annotated[float, Field(ge=-360, le=360, json_schema_extra={"unit": "degree"})] = 130.0
    sun_elevation: Annotated[float, Field(gt=0, le=90, json_schema_extra={"unit": "degree"})] = 50.0
    turbidity: Annotated[float, Field(ge=1, le=10)] = 3.0
    ground_albedo: Annotated[float, Field(ge=0, le=1)] = 0.3
    sun_scale: Annotated[float, Field(ge=0)] = 1.0
    sky_scale: Annotated[float, Field(ge=0)] = 1.0
    horizon_colour: Radiance = (0.75, 0.85, 1.0)
    zenith_colour: Radiance = (0.15, 0.35, 0.8)
    visibility: Annotated[float, Field(gt=0)] | None = Field(None, json_schema_extra={"unit": "m"})
