"""What has to be known of the camera and the path, from flags or from the scene of one of our own films."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias, final

import numpy as np

from nigemizu.errors import InputError
from nigemizu.units import UnitError, to_unit

if TYPE_CHECKING:
    from nigemizu.heat.turbulence.settings import Turbulence
    from nigemizu.measure.films import Film

__all__ = ["Optics", "optics_of"]

Wave: TypeAlias = Literal["plane", "spherical"]

_DEFAULT_VIEW: Final = 6.0  # degrees, of a camera that states no angle of view
_DEFAULT_EYE: Final = (0.0, 0.0, 1.7)


@final
@dataclass(frozen=True)
class Optics:
    """Camera and path.

    Parameters
    ----------
    distance : float, m
        From the camera to what it looks at; for a plane wave the length of the path through the turbulence.
    aperture : float, m
        Diameter of the aperture; 0 is a pinhole, which needs `inner_scale`.
    pixel_angle : float, rad
        Angle between neighbouring pixels.
    wavelength : float, m
    wave : {"spherical", "plane"}
        From a point at `distance`, or from infinity.
    inner_scale : float, m
        0 for none.
    outer_scale, largest : float, m, optional
        See `nigemizu.heat.Turbulence`.
    cn2 : float, m-2/3, optional
        Turbulence as stated, to compare with.
    origin : mapping of str to str
        Where each of these comes from, in words.

    Raises
    ------
    InputError
        A value is not above zero, or a pinhole has no inner scale.
    """

    distance: float
    aperture: float
    pixel_angle: float
    wavelength: float = 550e-9
    wave: Wave = "spherical"
    inner_scale: float = 0.0
    outer_scale: float | None = None
    largest: float | None = None
    cn2: float | None = None
    origin: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for key in ("distance", "pixel_angle", "wavelength", "outer_scale", "largest", "cn2"):
            value = getattr(self, key)
            if value is not None and not (0.0 < value < math.inf):
                raise InputError("impossible value", key=_flag(key), value=value, expected="a number above 0")
        for key in ("aperture", "inner_scale"):
            if not 0.0 <= getattr(self, key) < math.inf:
                raise InputError("impossible value", key=_flag(key), value=getattr(self, key), expected="≥ 0")
        if self.wave not in ("plane", "spherical"):
            raise InputError("unknown wave", key="--wave", value=self.wave, expected="spherical or plane")
        if self.aperture == 0 and self.inner_scale == 0:
            raise InputError(
                "a pinhole (aperture 0) sees all eddies down to the inner scale, which is not stated",
                key="--inner-scale",
                expected="a length such as 5mm",
                remedy="state --inner-scale, or the --aperture of the lens",
            )


def optics_of(film: Film, **typed: Any) -> Optics:
    """Put together what was typed and what the scene of the film says; the former comes first.

    Parameters
    ----------
    film : Film
    **typed
        The parameters of `Optics`, and ``focal_length``, ``pixel_pitch`` [m] in the place of
        ``pixel_angle``; None stands for what was not typed.

    Raises
    ------
    InputError
        Distance, aperture or angle of a pixel are missing; or as `Optics`.
    """
    given = {key: value for key, value in typed.items() if value is not None}
    origin = dict.fromkeys(given, "typed")
    angle = _typed_angle(given)
    if angle is not None:
        given["pixel_angle"] = angle
        origin["pixel_angle"] = "typed"
    for key, (value, words) in _of_scene(film).items():
        if key not in given:
            given[key], origin[key] = value, words
    for key, remedy in (
        ("distance", "state the distance to what the film shows, such as --distance 1km"),
        ("aperture", "state the diameter of the lens, such as --aperture 50mm (0 for a pinhole)"),
        ("pixel_angle", "state --pixel-angle 10e-6, or --focal-length 500mm with --pixel-pitch 5um"),
    ):
        if key not in given:
            raise InputError("is missing", file=str(film.path), key=_flag(key), remedy=remedy)
    names = set(Optics.__dataclass_fields__) - {"origin"}
    chosen = {key: value for key, value in given.items() if key in names}
    return Optics(**chosen, origin={key: words for key, words in origin.items() if key in names})


def _typed_angle(given: dict[str, Any]) -> float | None:
    focal_length, pitch = given.pop("focal_length", None), given.pop("pixel_pitch", None)
    if "pixel_angle" in given:
        if focal_length is not None or pitch is not None:
            raise InputError(
                "follows from --focal-length and --pixel-pitch already",
                key="--pixel-angle",
                remedy="state one of them",
            )
        return None
    if focal_length is None and pitch is None:
        return None
    if focal_length is None or pitch is None:
        known, other = ("--focal-length", "--pixel-pitch")[:: 1 if pitch is None else -1]
        raise InputError(f"says nothing without {other}", key=known, remedy=f"state {other} too")
    for key, value in (("--focal-length", focal_length), ("--pixel-pitch", pitch)):
        if not 0.0 < value < math.inf:
            raise InputError("impossible value", key=key, value=value, expected="a length above 0")
    return float(pitch / focal_length)


def _flag(key: str) -> str:
    return "--" + key.replace("_", "-")


def _of_scene(film: Film) -> dict[str, tuple[Any, str]]:
    """What the scene tells, each with where it stands; keys that this room does not know are passed over."""
    if film.scene is None:
        return {}
    camera = film.scene.get("camera", {})
    found: dict[str, tuple[Any, str]] = {}
    angle = _pixel_angle(camera, film.shape[1])
    if angle is not None:
        found["pixel_angle"] = (angle, "the scene's camera")
    found["aperture"] = (_aperture(camera), "the scene's camera")
    place = _sight(film.scene, camera)
    if place is not None:
        found["distance"] = place[1:]
    wavelength = _number(film.scene.get("air", {}).get("wavelength"), "m")
    if wavelength is not None:
        found["wavelength"] = (wavelength, "the scene's air")
    found |= _turbulence(film.scene, camera, None if place is None else place[0])
    return found


def _number(value: Any, unit: str) -> float | None:
    if isinstance(value, bool) or value is None:
        return None
    if isinstance(value, int | float):
        return float(value)
    try:
        return to_unit(str(value), unit)
    except UnitError:
        return None


def _point(value: Any) -> np.ndarray | None:
    if not isinstance(value, list) or len(value) != 3:
        return None
    numbers = [_number(one, "m") for one in value]
    return None if None in numbers else np.array(numbers, dtype=np.float64)


def _pixel_angle(camera: Mapping[str, Any], width: int) -> float | None:
    """Angle of a pixel of the film; a film that was scaled down has larger pixels than the camera."""
    pixels = _number(camera.get("width"), "1") or 960.0
    focal_length = _number(camera.get("focal_length"), "m")
    if focal_length is None:
        view = _number(camera.get("field_of_view"), "degree") or _DEFAULT_VIEW
        film = 2 * math.tan(math.radians(view) / 2)
    else:
        sensor = _number(camera.get("sensor_width"), "m")
        pitch = _number(camera.get("pixel_pitch"), "m")
        if sensor is None and pitch is None:
            return None
        focus = _number(camera.get("focus_distance"), "m") or math.inf
        film = (sensor or (pitch or 0.0) * pixels) * (1 / focal_length - 1 / focus)
    # H.264 completes an odd width by one column, which scales nothing
    return film / (pixels if abs(width - pixels) <= 1 else width)


def _aperture(camera: Mapping[str, Any]) -> float:
    number, focal_length = _number(camera.get("f_number"), "1"), _number(camera.get("focal_length"), "m")
    if number and focal_length:
        return focal_length / number
    return _number(camera.get("aperture"), "m") or 0.0


def _sight(scene: Mapping[str, Any], camera: Mapping[str, Any]) -> tuple[np.ndarray, float, str] | None:
    """Where the line of sight ends, its length [m], and what says so."""
    eye = _point(camera.get("eye"))
    start = np.array(_DEFAULT_EYE) if eye is None else eye
    target = _point(camera.get("target"))
    objects = [one for one in scene.get("objects", []) if isinstance(one, Mapping)]
    places = [place for place in (_point(one.get("position")) for one in objects) if place is not None]
    focus = _number(camera.get("focus_distance"), "m")
    if focus is not None and math.isfinite(focus):
        if target is not None:
            along = (target - start) / np.linalg.norm(target - start)
        else:
            heading = math.radians(_number(camera.get("heading"), "degree") or 0.0)
            pitch = math.radians(_number(camera.get("pitch"), "degree") or 0.0)
            along = np.array(
                [math.cos(pitch) * math.cos(heading), math.cos(pitch) * math.sin(heading), math.sin(pitch)]
            )
        return start + focus * along, focus, "the scene's camera.focus_distance"
    if target is not None:
        return target, float(np.linalg.norm(target - start)), "the scene's camera.target"
    if len(places) == 1:
        return places[0], float(np.linalg.norm(places[0] - start)), "the scene's only object"
    return None


def _turbulence(
    scene: Mapping[str, Any], camera: Mapping[str, Any], end: np.ndarray | None
) -> dict[str, tuple[Any, str]]:
    """Scales, and the Cn² that moves the picture as much as what the path goes through."""
    stated = scene.get("turbulence")
    if not isinstance(stated, Mapping):
        return {}
    from pydantic import ValidationError

    from nigemizu.heat.turbulence.settings import Turbulence

    known = {
        key: value for key, value in stated.items() if key in Turbulence.model_fields and value != "none"
    }
    try:
        air = Turbulence.model_validate(known)
    except ValidationError:
        return {}
    words = "the scene's turbulence"
    found: dict[str, tuple[Any, str]] = {"inner_scale": (air.inner_scale, words)}
    if air.largest is not None:
        found["largest"] = (air.largest, words)
    if end is None:
        return found
    eye = _point(camera.get("eye"))
    start = np.array(_DEFAULT_EYE) if eye is None else eye
    w = (np.arange(400) + 0.5) / 400  # from the object to the camera
    heights = np.maximum(end[2] + w * (start[2] - end[2]), 1e-3)
    share = w ** (5 / 3)
    found["cn2"] = (float(np.average(_cn2(air, heights), weights=share)), words)
    outer = float(np.average(air.outer_scale_at(heights), weights=share))
    if math.isfinite(outer):
        found["outer_scale"] = (outer, words)
    return found


def _cn2(air: Turbulence, heights: np.ndarray) -> np.ndarray:
    from nigemizu.heat.turbulence.theory import cn2_from_ct2

    ct2 = air.structure_parameter(heights)
    return cn2_from_ct2(ct2, air.air_temperature, air.air_pressure, wavelength=air.wavelength)
