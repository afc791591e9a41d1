"""What surfaces are made of, as Mitsuba's reflectances."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import mitsuba as mi

from nigemizu.errors import InputError
from nigemizu.render.camera import Camera
from nigemizu.render.materials import Asphalt, Checker, Colour, Dots, Masonry, Material, Sand, Texture, Water
from nigemizu.render.objects import Road

__all__ = ["bsdf_of", "demand_file", "glossy", "ground_bsdf", "matt", "naming"]

_WATER_INDEX: Final = 1.335  # of refraction, of sea water in green light


def bsdf_of(
    material: Material, key: str, camera: Camera, place: tuple[tuple[float, float, float], float]
) -> dict[str, Any]:
    position, rotation = place
    match material:
        case Colour():
            return matt(material.colour)
        case Texture():
            demand_file(material.image, f"{key}.image")
            with naming(f"{key}.image", material.image):
                bitmap = mi.load_dict(
                    {
                        "type": "bitmap",
                        "filename": str(material.image),
                        "to_uv": mi.ScalarTransform3f().scale(list(material.repeat)),
                    }
                )
            return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": bitmap}}
        case Water():
            return _sea(material)
        case Sand() | Asphalt():
            return {"type": "twosided", "bsdf": ground_bsdf(material, None, key, camera)}
        case Checker():
            first, second = material.colours
            texture = {
                **_seen("nigemizu_checker", camera),
                "colour": mi.ScalarColor3f(list(first)),
                "other": mi.ScalarColor3f(list(second)),
                "size": material.size,
            }
        case Dots():
            first, second = material.colours
            texture = {
                **_seen("nigemizu_dots", camera),
                "colour": mi.ScalarColor3f(list(first)),
                "other": mi.ScalarColor3f(list(second)),
                "diameter": material.diameter,
                "density": material.density,
                "seed": material.seed,
                "centre": list(position),
                "turn": math.radians(rotation),
            }
        case Masonry():
            texture = {
                **_seen("nigemizu_masonry", camera),
                "colour": mi.ScalarColor3f(list(material.colour)),
                "contrast": material.contrast,
                "seed": material.seed,
                "course": material.course,
                "centre": list(position),
                "turn": math.radians(rotation),
            }
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": texture}}


def ground_bsdf(material: Material, road: Road | None, key: str, camera: Camera) -> dict[str, Any]:
    if not isinstance(material, Sand | Asphalt | Colour) or (road is None and isinstance(material, Colour)):
        if road is not None:
            raise InputError("a road goes on sand, asphalt or a plain colour", key=key, value=material.kind)
        return bsdf_of(material, key, camera, ((0.0, 0.0, 0.0), 0.0))
    texture = {
        **_seen("nigemizu_ground", camera),
        "colour": mi.ScalarColor3f(list(material.colour)),
        "contrast": 0.0 if isinstance(material, Colour) else material.contrast,
        "seed": 0 if isinstance(material, Colour) else material.seed,
        "scale": material.scale if isinstance(material, Sand) else 9.0,
    }
    if road is not None:
        texture |= {
            "road_width": road.width,
            "road_centre": road.centre,
            "road_colour": mi.ScalarColor3f(list(road.surface.colour)),
            "road_contrast": road.surface.contrast,
            "line_colour": mi.ScalarColor3f(list(road.line_colour)),
            "line_width": road.line_width,
            "edge_inset": road.edge_inset,
            "dash": road.dash,
            "gap": road.gap,
        }
    return {"type": "diffuse", "reflectance": texture}


def _sea(water: Water) -> dict[str, Any]:
    return {
        "type": "roughplastic",
        "distribution": "beckmann",
        "int_ior": _WATER_INDEX,
        "diffuse_reflectance": {"type": "rgb", "value": list(water.colour)},
        # Beckmann's roughness squared is the mean square of the slopes.
        "alpha": math.sqrt(0.003 + 0.00512 * water.wind),
    }


def _seen(plugin: str, camera: Camera) -> dict[str, Any]:
    return {"type": plugin, "eye": list(camera.eye), "pixel_angle": camera.pixel_angle}


def matt(colour: Sequence[float]) -> dict[str, Any]:
    return {
        "type": "twosided",
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(colour)}},
    }


def glossy(colour: Sequence[float]) -> dict[str, Any]:
    return {
        "type": "twosided",
        "bsdf": {
            "type": "roughplastic",
            "diffuse_reflectance": {"type": "rgb", "value": list(colour)},
            "alpha": 0.05,
        },
    }


def demand_file(path: Path, key: str) -> None:
    if not path.is_file():
        raise InputError("file not found", key=key, file=str(path))


@contextlib.contextmanager
def naming(key: str, path: Path | None) -> Iterator[None]:
    """Say of which key and file it is that Mitsuba complains."""
    try:
        yield
    except (RuntimeError, TypeError) as error:
        reason = str(error).strip().splitlines()[-1]
        where = None if path is None else str(path)
        raise InputError(f"Mitsuba cannot read it: {reason}", key=key, file=where) from error
