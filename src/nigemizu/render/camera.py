"""The camera: where the eye stands and what it sees."""

from __future__ import annotations

import math
from typing import Annotated, Literal, final

from pydantic import Field

from nigemizu.values import Value

__all__ = ["Camera"]

Filter = Literal["box", "gaussian"]
Coordinates = tuple[float, float, float]


@final
class Camera(Value):
    """A pinhole camera whose picture plane stands upright.

    Parameters
    ----------
    eye : (x, y, z), m
        Where the eye is; z is its height above the ground.
    target : (x, y, z), m, optional
        The point in the middle of the picture. Takes the place of `heading` and `pitch`.
    heading : float, degrees
        Direction of view, 0 = along +x (forward), positive to the left (towards +y).
    pitch : float, degrees
        Elevation of the direction of view, positive upwards.
    field_of_view : float, degrees
        Horizontal angle of view; 6° is a 340 mm lens on 35 mm film.
    width, height : int
        Size of the picture in pixels.
    samples : int
        Rays per pixel.
    exposure : float, stops (EV)
        Each unit doubles the brightness. At 0, a white horizontal surface in full light comes out at 1.
    filter : {"box", "gaussian"}
        How the samples are put together to pixels. ``box`` is the quickest and leaves the samples of
        neighbouring pixels independent; ``gaussian`` is a little softer.
    seed : int
        Seed of the sampling; the same seed gives the same picture.
    """

    eye: Coordinates = Field((0.0, 0.0, 1.7), json_schema_extra={"unit": "m"})
    target: Coordinates | None = Field(None, json_schema_extra={"unit": "m"})
    heading: Annotated[float, Field(ge=-360, le=360, json_schema_extra={"unit": "degree"})] = 0.0
    pitch: Annotated[float, Field(gt=-90, lt=90, json_schema_extra={"unit": "degree"})] = 0.0
    field_of_view: Annotated[float, Field(gt=0, lt=170, json_schema_extra={"unit": "degree"})] = 6.0
    width: Annotated[int, Field(ge=1, le=16384)] = 960
    height: Annotated[int, Field(ge=1, le=16384)] = 540
    samples: Annotated[int, Field(ge=1, le=1_000_000)] = 64
    exposure: Annotated[float, Field(ge=-30, le=30)] = 0.0
    filter: Filter = "box"
    seed: Annotated[int, Field(ge=0)] = 0

    @property
    def direction(self) -> Coordinates:
        """Unit vector of the direction of view."""
        if self.target is not None:
            offset = [t - e for t, e in zip(self.target, self.eye, strict=True)]
            length = math.hypot(*offset)
            return (offset[0] / length, offset[1] / length, offset[2] / length)
        heading, pitch = math.radians(self.heading), math.radians(self.pitch)
        return (math.cos(pitch) * math.cos(heading), math.cos(pitch) * math.sin(heading), math.sin(pitch))

    @property
    def pixel_angle(self) -> float:
        """Angle that one pixel in the middle of the picture spans, rad."""
        return 2.0 * math.tan(math.radians(self.field_of_view) / 2.0) / self.width
