"""From values to a Mitsuba scene."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import mitsuba as mi
import numpy as np

from nigemizu.errors import InputError
from nigemizu.render import aircraft, meshes, vehicle
from nigemizu.render.camera import Camera
from nigemizu.render.light import Light
from nigemizu.render.materials import Asphalt, Checker, Colour, Dots, Masonry, Material, Sand, Texture
from nigemizu.render.objects import (
    Aircraft,
    Box,
    Ground,
    Hills,
    Mesh,
    MitsubaFile,
    Object,
    Pole,
    Pyramid,
    Road,
    Sphere,
    Vehicle,
)
from nigemizu.render.sensors import sensor
from nigemizu.render.sky import bake

__all__ = ["build"]

# Gloss and colour of the parts of cars and aircraft that the paint does not colour.
_PARTS: Final[dict[str, tuple[tuple[float, float, float], bool]]] = {
    "glass": ((0.012, 0.014, 0.016), True),
    "dark": ((0.012, 0.012, 0.012), False),
    "rubber": ((0.02, 0.02, 0.02), False),
    "metal": ((0.35, 0.36, 0.37), True),
    "lamp": ((0.7, 0.72, 0.72), True),
    "tail": ((0.35, 0.01, 0.01), True),
    "plate": ((0.75, 0.75, 0.72), False),
    "grey": ((0.42, 0.43, 0.44), True),
}
_HEADLIGHT: Final = 30.0  # radiance of a lamp that is on, in units of sunlit white


def build(camera: Camera, light: Light, objects: Sequence[Object], *, integrator: Any) -> Any:
    """A Mitsuba scene of these values.

    Parameters
    ----------
    camera : Camera
        The view.
    light : Light
        Sun and sky; haze is the integrator's (`visibility`).
    objects : sequence of Object
        What stands in the scene.
    integrator : mi.Integrator or dict
        From `nigemizu.render.integrator`, or any of Mitsuba's own.

    Returns
    -------
    mi.Scene

    Raises
    ------
    InputError
        If a file is missing or unreadable, or the eye is below the ground.
    """
    _check_eye(camera, objects)
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": integrator,
        "sensor": sensor(camera),
        **bake(light).emitters(),
    }
    for index, item in enumerate(objects):
        for name, shape in _shapes(item, f"objects.{index}", camera).items():
            scene[f"object{index}_{name}"] = shape
    return mi.load_dict(scene)


def _check_eye(camera: Camera, objects: Sequence[Object]) -> None:
    if camera.target is not None and camera.target == camera.eye:
        raise InputError("the camera looks at its own eye", key="camera.target", value=camera.target)
    lens = camera.aperture_diameter / 2 * math.hypot(*camera.direction[:2])
    for item in objects:
        if isinstance(item, Ground) and camera.eye[2] <= item.height:
            raise InputError(
                "the eye is not above the ground",
                key="camera.eye",
                value=camera.eye,
                expected=f"z above {item.height} m",
            )
        if isinstance(item, Ground) and camera.eye[2] - lens <= item.height:
            raise InputError(
                "the aperture reaches into the ground",
                key="camera.eye",
                value=camera.eye,
                expected=f"z above {item.height + lens:g} m, or a smaller aperture",
            )


def _shapes(item: Object, key: str, camera: Camera) -> dict[str, Any]:
    """Mitsuba shapes (dictionaries or objects) of one object, by name."""
    match item:
        case Ground():
            return {"ground": _ground(item, key, camera)}
        case Pyramid():
            triangles = _pyramid(item).moved(item.position, item.rotation)
            place = (item.position, item.rotation)
            return {"pyramid": _mesh(triangles, _bsdf(item.material, f"{key}.material", camera, place))}
        case Box():
            return {"box": _box(item, key, camera)}
        case Pole():
            return _pole(item)
        case Sphere():
            return {
                "sphere": {
                    "type": "sphere",
                    "center": list(item.position),
                    "radius": item.radius,
                    "bsdf": _bsdf(item.material, f"{key}.material", camera, (item.position, 0.0)),
                }
            }
        case Mesh():
            return {"mesh": _mesh_file(item, key, camera)}
        case Hills():
            return {"hills": _mesh(meshes.hills(item), _matt(item.colour))}
        case Vehicle():
            scale, paint = item.length / vehicle.LENGTH, {"paint": item.colour}
            return _painted(item, vehicle.car(), scale, paint, item.headlights)
        case Aircraft():
            scale = item.length / aircraft.LENGTH
            paint = {"paint": item.colour, "fin": item.fin_colour}
            return _painted(item, aircraft.airliner(), scale, paint, item.lights)
        case MitsubaFile():
            return _foreign(item, key)


def _ground(item: Ground, key: str, camera: Camera) -> Any:
    bsdf = _ground_bsdf(item.material, item.road, f"{key}.material", camera)
    return _mesh(meshes.plain(item.height), bsdf)


def _ground_bsdf(material: Material, road: Road | None, key: str, camera: Camera) -> dict[str, Any]:
    if not isinstance(material, Sand | Asphalt | Colour) or (road is None and isinstance(material, Colour)):
        if road is not None:
            raise InputError("a road goes on sand, asphalt or a plain colour", key=key, value=material.kind)
        return _bsdf(material, key, camera, ((0.0, 0.0, 0.0), 0.0))
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


def _bsdf(
    material: Material, key: str, camera: Camera, place: tuple[tuple[float, float, float], float]
) -> dict[str, Any]:
    position, rotation = place
    match material:
        case Colour():
            return _matt(material.colour)
        case Texture():
            _demand_file(material.image, f"{key}.image")
            with _naming(f"{key}.image", material.image):
                bitmap = mi.load_dict(
                    {
                        "type": "bitmap",
                        "filename": str(material.image),
                        "to_uv": mi.ScalarTransform3f().scale(list(material.repeat)),
                    }
                )
            return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": bitmap}}
        case Sand() | Asphalt():
            return {"type": "twosided", "bsdf": _ground_bsdf(material, None, key, camera)}
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


def _seen(plugin: str, camera: Camera) -> dict[str, Any]:
    return {"type": plugin, "eye": list(camera.eye), "pixel_angle": camera.pixel_angle}


def _matt(colour: Sequence[float]) -> dict[str, Any]:
    return {
        "type": "twosided",
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(colour)}},
    }


def _glossy(colour: Sequence[float]) -> dict[str, Any]:
    return {
        "type": "twosided",
        "bsdf": {
            "type": "roughplastic",
            "diffuse_reflectance": {"type": "rgb", "value": list(colour)},
            "alpha": 0.05,
        },
    }


def _mesh(triangles: meshes.Triangles, bsdf: dict[str, Any], **extra: Any) -> Any:
    props = mi.Properties("mesh")
    props["mesh_bsdf"] = mi.load_dict(bsdf)
    for name, value in extra.items():
        props[name] = mi.load_dict(value)
    props["face_normals"] = not triangles.smooth
    mesh = mi.Mesh(
        "mesh",
        vertex_count=len(triangles.vertices),
        face_count=len(triangles.faces),
        has_vertex_normals=triangles.smooth,
        has_vertex_texcoords=triangles.coordinates is not None,
        props=props,
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(triangles.vertices.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(triangles.faces.astype(np.uint32).ravel())
    if triangles.coordinates is not None:
        parameters["vertex_texcoords"] = mi.Float(triangles.coordinates.astype(np.float32).ravel())
    parameters.update()
    if triangles.smooth:
        mesh.recompute_vertex_normals()
    return mesh


def _pyramid(item: Pyramid) -> meshes.Triangles:
    match item.material:
        case Masonry():
            return meshes.pyramid(item, item.material.course, item.material.seed)
        case Texture():
            return meshes.pyramid_faces(item)
    return meshes.pyramid(item, None, 0)


def _box(item: Box, key: str, camera: Camera) -> dict[str, Any]:
    # Mitsuba's own cube: it has texture coordinates on each face.
    transform = mi.ScalarTransform4f
    x, y, z = item.position
    half = [length / 2 for length in item.size]
    placed = transform().translate([x, y, z + half[2]]) @ transform().rotate([0, 0, 1], item.rotation)
    return {
        "type": "cube",
        "to_world": placed @ transform().scale(half),
        "bsdf": _bsdf(item.material, f"{key}.material", camera, (item.position, item.rotation)),
    }


def _pole(item: Pole) -> dict[str, Any]:
    (x, y, z), band = item.position, item.height / item.bands
    shapes = {}
    for index in range(item.bands):
        start, end = np.array([x, y, z + index * band]), np.array([x, y, z + (index + 1) * band])
        triangles = meshes.cylinder(start, end, item.diameter / 2)
        shapes[f"band{index}"] = _mesh(triangles, _matt(item.colours[index % 2]))
    return shapes


def _painted(
    item: Vehicle | Aircraft,
    groups: dict[str, list[meshes.Triangles]],
    scale: float,
    paint: dict[str, tuple[float, float, float]],
    lamps_on: bool,
) -> dict[str, Any]:
    """Parts of a vehicle by material, in its place."""
    shapes = {}
    for name, parts in groups.items():
        colour, glossy = (paint[name], True) if name in paint else _PARTS[name]
        bsdf = _glossy(colour) if glossy else _matt(colour)
        extra = {}
        if name == "lamp" and lamps_on:
            extra["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": _HEADLIGHT}}
        for index, part in enumerate(parts):
            sized = replace(part, vertices=part.vertices * scale)
            shapes[f"{name}{index}"] = _mesh(sized.moved(item.position, item.heading), bsdf, **extra)
    return shapes


def _mesh_file(item: Mesh, key: str, camera: Camera) -> Any:
    _demand_file(item.file, f"{key}.file")
    kind = item.file.suffix.lower().lstrip(".")
    if kind not in ("ply", "obj"):
        raise InputError(
            "unknown mesh format", key=f"{key}.file", value=str(item.file), expected=".ply or .obj"
        )
    transform = mi.ScalarTransform4f
    placed = transform().translate(list(item.position)) @ transform().rotate([0, 0, 1], item.rotation)
    placed = placed @ transform().scale(item.scale)
    if item.up == "y":
        placed = placed @ transform().rotate([1, 0, 0], 90)
    bsdf = _bsdf(item.material, f"{key}.material", camera, (item.position, item.rotation))
    with _naming(f"{key}.file", item.file):
        return mi.load_dict({"type": kind, "filename": str(item.file), "to_world": placed, "bsdf": bsdf})


def _foreign(item: MitsubaFile, key: str) -> dict[str, Any]:
    if item.file is not None:
        _demand_file(item.file, f"{key}.file")
        with _naming(f"{key}.file", item.file):
            loaded = mi.load_file(str(item.file))
        return {f"shape{index}": shape for index, shape in enumerate(loaded.shapes())}
    fragment = dict(item.fragment or {})
    parts = {"shape": fragment} if "type" in fragment else fragment
    found = {}
    for name, part in parts.items():
        with _naming(f"{key}.fragment.{name}", None):
            loaded = mi.load_dict(part)
        if not isinstance(loaded, mi.Shape):
            raise InputError("not a Mitsuba shape", key=f"{key}.fragment.{name}", value=part.get("type"))
        found[name] = loaded
    return found


def _demand_file(path: Path, key: str) -> None:
    if not path.is_file():
        raise InputError("file not found", key=key, file=str(path))


@contextlib.contextmanager
def _naming(key: str, path: Path | None) -> Iterator[None]:
    """Say of which key and file it is that Mitsuba complains."""
    try:
        yield
    except (RuntimeError, TypeError) as error:
        reason = str(error).strip().splitlines()[-1]
        where = None if path is None else str(path)
        raise InputError(f"Mitsuba cannot read it: {reason}", key=key, file=where) from error
