"""The camera: where the eye stands and what it sees."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self, final

from pydantic import Field, model_validator

from nigemizu.render.noise import Noise
from nigemizu.values import Value

__all__ = ["Camera"]

_WIDEST: Final = 170.0  # degrees
_USUAL: Final = 6.0  # degrees

Filter = Literal["box", "gaussian"]
Coordinates = tuple[float, float, float]
Angle = Annotated[float, Field(gt=0, lt=_WIDEST, json_schema_extra={"unit": "degree"})]
Length = Annotated[float, Field(gt=0, json_schema_extra={"unit": "m"})]


@final
class Camera(Value):
    """A camera whose picture plane stands upright: a pinhole, or a thin lens with an aperture.

    Parameters
    ----------
    eye : (x, y, z), m
        Where the eye is, the middle of the lens; z is its height above the ground.
    target : (x, y, z), m, optional
        The point in the middle of the picture. Takes the place of `heading` and `pitch`.
    heading : float, degrees
        Direction of view, 0 = along +x (forward), positive to the left (towards +y).
    pitch : float, degrees
        Elevation of the direction of view, positive upwards.
    field_of_view : float, degrees, optional
        Horizontal angle of view; 6 where neither this nor `focal_length` is stated, which is a 340 mm lens on
        35 mm film. The word ``"none"`` unsets it.
    focal_length : float, m, optional
        Of the lens, in the place of `field_of_view`; needs `pixel_pitch` or `sensor_width` beside it.
    pixel_pitch : float, m, optional
        Distance between the middles of neighbouring pixels on the sensor. A picture of fewer pixels then
        shows less.
    sensor_width : float, m, optional
        Width of the sensor, in the place of `pixel_pitch`; 36 mm is full frame. A picture of fewer pixels
        then shows the same.
    f_number : float, optional
        Focal length over the diameter of the aperture, in the place of `aperture`.
    aperture : float, m
        Diameter of the aperture; 0 is a pinhole. Every sample takes its own path through the air from its
        own point on the aperture.
    focus_distance : float, m
        Distance from the lens, along the direction of view, of the plane that is sharp without air; or
        ``"infinity"``.
    lens_points : int
        How many points on the aperture the samples share; 0 gives each its own. Rays of one point share
        their paths (`tracer.sharing`), which is several times quicker where there are several samples to a
        point, but a blur wider than some pixels then falls apart into so many images.
    shutter : float, s
        Exposure time: the picture of time t gathers light from t to t + `shutter`, while the air moves.
    shutter_instants : int
        In how many instants within the exposure the air is looked through, one sample at least for each.
    width, height : int
        Size of the picture in pixels.
    samples : int
        Rays per pixel.
    exposure : float, stops (EV)
        Each unit doubles the brightness. At 0, a white horizontal surface in full light comes out at 1. The
        aperture and the exposure time do not change it.
    highlights : {"clip", "soft", "film"}
        What becomes of what is brighter than white in a PNG or a film: cut off; bent towards white from 0.8
        on; or, as on film, bent from the beginning, so that a low Sun goes through yellow to white.
    filter : {"box", "gaussian"}
        How the samples are put together to pixels. ``box`` is the quickest and leaves the samples of
        neighbouring pixels independent; ``gaussian`` is a little softer.
    seed : int
        Seed of the sampling; the same seed gives the same picture.
    diffraction : bool
        Whether light is spread by diffraction at the aperture: the Airy pattern of 610, 540 and 460 nm in
        red, green and blue.
    noise : Noise, optional
        What the sensor adds; no noise unless given.

    Notes
    -----
    With the focal length f and the focus at s, the sensor stands v = f s / (s − f) behind the lens and the
    angle of view is 2 arctan(w / 2v), w being the width of the sensor: as long as s ≫ f, that of v = f. A
    point at the distance d becomes a disc of the diameter A v (1/s − 1/d), or minus that, A being the
    diameter of the aperture.

    Limits: a thin lens. No aberrations, no vignetting, no blades; moving objects are not smeared, the air is.
    """

    eye: Coordinates = Field((0.0, 0.0, 1.7), json_schema_extra={"unit": "m"})
    target: Coordinates | None = Field(None, json_schema_extra={"unit": "m"})
    heading: Annotated[float, Field(ge=-360, le=360, json_schema_extra={"unit": "degree"})] = 0.0
    pitch: Annotated[float, Field(gt=-90, lt=90, json_schema_extra={"unit": "degree"})] = 0.0
    field_of_view: Angle | None = None
    focal_length: Length | None = None
    pixel_pitch: Length | None = None
    sensor_width: Length | None = None
    f_number: Annotated[float, Field(gt=0)] | None = None
    aperture: Annotated[float, Field(ge=0, json_schema_extra={"unit": "m"})] = 0.0
    focus_distance: Length | Literal["infinity"] = "infinity"
    lens_points: Annotated[int, Field(ge=0, le=4096)] = 0
    shutter: Annotated[float, Field(ge=0, json_schema_extra={"unit": "s"})] = 0.0
    shutter_instants: Annotated[int, Field(ge=1, le=4096)] = 8
    width: Annotated[int, Field(ge=1, le=16384)] = 960
    height: Annotated[int, Field(ge=1, le=16384)] = 540
    samples: Annotated[int, Field(ge=1, le=1_000_000)] = 64
    exposure: Annotated[float, Field(ge=-30, le=30)] = 0.0
    highlights: Literal["clip", "soft", "film"] = "clip"
    filter: Filter = "box"
    seed: Annotated[int, Field(ge=0)] = 0
    diffraction: bool = False
    noise: Noise | None = None

    @model_validator(mode="before")
    @classmethod
    def _read_words(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        found = {
            key: None if isinstance(given, str) and given == "none" else given for key, given in data.items()
        }
        if found.get("focus_distance") in ("inf", math.inf):
            found["focus_distance"] = "infinity"
        return found

    @model_validator(mode="after")
    def _is_one_lens(self) -> Self:
        sizes = [key for key in ("pixel_pitch", "sensor_width") if getattr(self, key) is not None]
        if self.focal_length is None:
            if sizes:
                raise ValueError(f"{sizes[0]}: says nothing without focal_length")
            if self.f_number is not None:
                raise ValueError("f_number: needs focal_length; with field_of_view, state aperture in metres")
        else:
            self._check_focal_length(self.focal_length, sizes)
        if self.f_number is not None and self.aperture > 0:
            raise ValueError("aperture: follows from f_number already; state one of them")
        if self.diffraction and self.aperture_diameter == 0:
            raise ValueError("diffraction: needs the size of the aperture, by f_number or aperture")
        return self

    def _check_focal_length(self, focal_length: float, sizes: list[str]) -> None:
        if self.field_of_view is not None:
            raise ValueError(
                'field_of_view: follows from focal_length already; leave one out (field_of_view = "none")'
            )
        if not sizes:
            raise ValueError('focal_length: needs pixel_pitch or sensor_width ("36 mm" is full frame) too')
        if len(sizes) > 1:
            raise ValueError("sensor_width: follows from pixel_pitch and width already; state one of them")
        if self.focus <= focal_length:
            raise ValueError(f"focus_distance: a lens of {focal_length:g} m cannot focus this close")
        if self.angle_of_view >= _WIDEST:
            raise ValueError(
                f"focal_length: is too short for the sensor; the angle of view would be "
                f"{self.angle_of_view:.0f} degrees"
            )

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
        return self._film_width / self.width

    @property
    def angle_of_view(self) -> float:
        """Horizontal angle of view, degrees: as stated, or from the focal length."""
        if self.focal_length is None:
            return _USUAL if self.field_of_view is None else self.field_of_view
        return math.degrees(2.0 * math.atan(self._film_width / 2.0))

    @property
    def focus(self) -> float:
        """Distance of the plane in focus, m; may be infinite."""
        return math.inf if self.focus_distance == "infinity" else self.focus_distance

    @property
    def aperture_diameter(self) -> float:
        """Diameter of the aperture, m; 0 for a pinhole."""
        if self.f_number is None or self.focal_length is None:
            return self.aperture
        return self.focal_length / self.f_number

    def airy_scale(self, wavelength: float) -> float:
        """Scale λN of the Airy pattern on the sensor, in pixels; its first dark ring has the radius 1.22 λN.

        Parameters
        ----------
        wavelength : float, m
        """
        return wavelength / (self.aperture_diameter * self.pixel_angle)

    def instants(self, time: float) -> tuple[float, ...]:
        """Instants [s] at which the air is looked through for the picture of `time` [s].

        Returns
        -------
        tuple of float, s
            `time` itself where `shutter` is 0; else the middles of `shutter_instants` equal parts of the
            exposure from `time` to `time` + `shutter`, in order, or of `samples` parts where these are fewer.
        """
        if self.shutter == 0:
            return (time,)
        count = min(self.shutter_instants, self.samples)
        return tuple(time + self.shutter * (part + 0.5) / count for part in range(count))

    @property
    def _film_width(self) -> float:
        """Width of the sensor over its distance from the lens."""
        if self.focal_length is None:
            return 2.0 * math.tan(math.radians(self.angle_of_view) / 2.0)
        width = (self.pixel_pitch or 0.0) * self.width if self.sensor_width is None else self.sensor_width
        # 1/v = 1/f − 1/s
        return width * (1.0 / self.focal_length - 1.0 / self.focus)
