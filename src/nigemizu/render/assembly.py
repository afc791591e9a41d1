"""From values to a Mitsuba scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import mitsuba as mi
import numpy as np

from nigemizu.errors import InputError
from nigemizu.render import aircraft, meshes, vehicle
from nigemizu.render.bsdfs import bsdf_of, demand_file, glossy, ground_bsdf, matt, naming
from nigemizu.render.camera import Camera
from nigemizu.render.light import Light
from nigemizu.render.materials import Masonry, Texture
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
    Sphere,
    Vehicle,
)
from nigemizu.render.sensors import sensor
from nigemizu.render.sky import Sky, bake

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


def build(
    camera: Camera,
    light: Light,
    objects: Sequence[Object],
    *,
    integrator: Any,
    sky: Sky | None = None,
) -> Any:
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
    sky : Sky, optional
        Of a physical sky, that which lights the objects.

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
        **(bake(light) if sky is None else sky).emitters(),
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
            return {"pyramid": _mesh(triangles, bsdf_of(item.material, f"{key}.material", camera, place))}
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
                    "bsdf": bsdf_of(item.material, f"{key}.material", camera, (item.position, 0.0)),
                }
            }
        case Mesh():
            return {"mesh": _mesh_file(item, key, camera)}
        case Hills():
            return {"hills": _mesh(meshes.hills(item), matt(item.colour))}
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
    bsdf = ground_bsdf(item.material, item.road, f"{key}.material", camera)
    return _mesh(meshes.plain(item.height), bsdf)


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
        "bsdf": bsdf_of(item.material, f"{key}.material", camera, (item.position, item.rotation)),
    }


def _pole(item: Pole) -> dict[str, Any]:
    (x, y, z), band = item.position, item.height / item.bands
    shapes = {}
    for index in range(item.bands):
        start, end = np.array([x, y, z + index * band]), np.array([x, y, z + (index + 1) * band])
        triangles = meshes.cylinder(start, end, item.diameter / 2)
        shapes[f"band{index}"] = _mesh(triangles, matt(item.colours[index % 2]))
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
        colour, shiny = (paint[name], True) if name in paint else _PARTS[name]
        bsdf = glossy(colour) if shiny else matt(colour)
        extra = {}
        if name == "lamp" and lamps_on:
            extra["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": _HEADLIGHT}}
        for index, part in enumerate(parts):
            sized = replace(part, vertices=part.vertices * scale)
            shapes[f"{name}{index}"] = _mesh(sized.moved(item.position, item.heading), bsdf, **extra)
    return shapes


def _mesh_file(item: Mesh, key: str, camera: Camera) -> Any:
    demand_file(item.file, f"{key}.file")
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
    bsdf = bsdf_of(item.material, f"{key}.material", camera, (item.position, item.rotation))
    with naming(f"{key}.file", item.file):
        return mi.load_dict({"type": kind, "filename": str(item.file), "to_world": placed, "bsdf": bsdf})


def _foreign(item: MitsubaFile, key: str) -> dict[str, Any]:
    if item.file is not None:
        demand_file(item.file, f"{key}.file")
        with naming(f"{key}.file", item.file):
            loaded = mi.load_file(str(item.file))
        return {f"shape{index}": shape for index, shape in enumerate(loaded.shapes())}
    fragment = dict(item.fragment or {})
    parts = {"shape": fragment} if "type" in fragment else fragment
    found = {}
    for name, part in parts.items():
        with naming(f"{key}.fragment.{name}", None):
            loaded = mi.load_dict(part)
        if not isinstance(loaded, mi.Shape):
            raise InputError("not a Mitsuba shape", key=f"{key}.fragment.{name}", value=part.get("type"))
        found[name] = loaded
    return found
