"""Rays to files: tables for people who compute, the ray diagram for people who look."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.scene.far_air import natural

if TYPE_CHECKING:
    from nigemizu.output import DiagramRay, Outline, Profile
    from nigemizu.render import Object
    from nigemizu.scene.model import Scene
    from nigemizu.scene.rays import TracedRays

__all__ = ["save"]

Coordinates: TypeAlias = tuple[float, float, float]
Corners: TypeAlias = list[tuple[float, float]]

_SHEET: Final = 0.004  # width of a ridge in the figure, in distances
_HORIZONS: Final = 3.0  # reach over an empty sea, in distances of the horizon
_DENSE: Final = 240  # rays of the bundle whose envelope is the vanishing line


def save(rays: TracedRays, path: Path, command: str) -> Path:
    """See `nigemizu.scene.rays.TracedRays.save`."""
    from nigemizu.output import ready_to_write, write_air

    path = ready_to_write(path, (".csv", ".nc", ".svg", ".png", ".pdf"))
    if path.suffix.lower() == ".nc":
        return write_air(air=rays.to_dataset(), path=path)
    if path.suffix.lower() == ".csv":
        return _write_csv(rays, path)
    return _draw(rays, path, command)


def _write_csv(rays: TracedRays, path: Path) -> Path:
    from nigemizu.output.files import write_bytes

    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    vector = [f"{name}_{axis}" for name in ("end", "end_direction") for axis in "xyz"]
    table.writerow(["elevation", "azimuth", "status", *vector, "turning_height", "optical_path", "steps"])
    for record in rays.as_records():
        table.writerow(
            [
                record["elevation"],
                record["azimuth"],
                record["status"],
                *record["end"],
                *record["end_direction"],
                record["turning_height"],
                record["optical_path"],
                record["steps"],
            ]
        )
    return write_bytes(path, text.getvalue().encode("utf-8"))


def _draw(rays: TracedRays, path: Path, command: str) -> Path:
    from nigemizu.output import Provenance, ray_diagram, vanishing_line

    if not rays.paths:
        raise InputError(
            "these rays were traced without their paths", key="paths", remedy="trace(paths=True)"
        )
    scene = rays.scene
    outlines = _outlines(scene)
    reach = _reach(scene, outlines)
    lowest, highest = float(rays.elevation.min()), float(rays.elevation.max())
    dense = rays.traced_again(np.linspace(lowest, highest, _DENSE))
    shown = _side_view(rays, reach)
    return ray_diagram(
        path,
        rays=shown,
        profile=_profile(rays),
        objects=outlines,
        vanishing=vanishing_line([*shown, *_side_view(dense, reach)]),
        eye=(0.0, scene.camera.eye[2]),
        title=scene.title,
        surface="sea" if _is_round(scene) else "ground",
        provenance=Provenance(scene=scene.to_toml(), command=command),
    )


def _side_view(rays: TracedRays, reach: float) -> list[DiagramRay]:
    """The rays as height over horizontal distance from the eye, up to `reach`."""
    from nigemizu.output import DiagramRay

    eye = np.array(rays.scene.camera.eye)
    views = []
    for points, status in zip(rays.paths, rays.status, strict=True):
        distance = np.hypot(points[:, 0] - eye[0], points[:, 1] - eye[1])
        inside = distance <= reach
        x, z, ending = distance[inside], points[inside, 2], status
        if not inside.all():
            # The part beyond is not drawn: the ray leaves the figure between two of its points.
            first = int(np.argmin(inside))
            z = np.append(
                z, np.interp(reach, distance[first - 1 : first + 1], points[first - 1 : first + 1, 2])
            )
            x, ending = np.append(x, reach), "escaped"
        views.append(DiagramRay(x, z, ending))
    return views


def _profile(rays: TracedRays) -> Profile:
    from nigemizu.output import Profile

    heights, refractivity = natural(rays.scene, rays.air)
    return Profile(heights, refractivity.mean(axis=(1, 2)), rays.air.temperature)


def _outlines(scene: Scene) -> list[Outline]:
    """Silhouettes of the objects that stand within the air, seen from the side of the line of sight."""
    from nigemizu.output import Outline

    found = []
    for entry in scene.objects:
        shape = _silhouette(entry)
        if shape is None:
            continue
        place, corners = shape
        distance = _along(scene, place)
        if 0.0 < distance <= _air_end(scene):
            x, z = np.array(corners, dtype=np.float64).T
            found.append(Outline(entry.kind, distance + x, place[2] + z))
    return found or (_coast(scene) if _is_round(scene) else [])


def _coast(scene: Scene) -> list[Outline]:
    """The nearest ridge, as a sheet: what is looked at over a round sea with nothing on it."""
    from nigemizu.output import Outline
    from nigemizu.render import Hills

    ridges = [entry for entry in scene.objects if isinstance(entry, Hills)]
    if not ridges:
        return []
    near = min(ridges, key=lambda ridge: ridge.distance)
    x, z = np.array(_rectangle(_SHEET * near.distance, near.height)).T
    return [Outline(near.kind, near.distance + x, near.base + z)]


def _silhouette(entry: Object) -> tuple[Coordinates, Corners] | None:
    """Place of an object and its corners around it [m]; None for what has no place of its own."""
    from nigemizu.render import Aircraft, Box, Pole, Pyramid, Sphere, Vehicle

    match entry:
        case Pyramid():
            half = entry.base / 2.0
            return entry.position, [(-half, 0.0), (half, 0.0), (0.0, entry.height)]
        case Box():
            return entry.position, _rectangle(entry.size[0], entry.size[2])
        case Pole():
            return entry.position, _rectangle(entry.diameter, entry.height)
        case Vehicle() | Aircraft():
            return entry.position, _rectangle(entry.length, entry.length / 3.0)
        case Sphere():
            turn = np.linspace(0.0, 2.0 * math.pi, 49)
            circle = [(entry.radius * math.cos(angle), entry.radius * math.sin(angle)) for angle in turn]
            return entry.position, circle
    return None


def _rectangle(length: float, height: float) -> Corners:
    return [(-length / 2, 0.0), (length / 2, 0.0), (length / 2, height), (-length / 2, height)]


def _along(scene: Scene, place: Coordinates) -> float:
    """Distance of a place from the eye along the camera's heading [m]."""
    ahead: NDArray[np.float64] = np.array(scene.camera.direction[:2])
    offset = np.array(place[:2]) - np.array(scene.camera.eye[:2])
    return float(offset @ ahead / np.linalg.norm(ahead))


def _is_round(scene: Scene) -> bool:
    return scene.earth is not None and not scene.earth.flat


def _air_end(scene: Scene) -> float:
    if scene.profile is not None or scene.grid is None:
        return math.inf
    (x0, x1), (y0, y1) = scene.grid.x, scene.grid.y
    return max(_along(scene, (x, y, 0.0)) for x in (x0, x1) for y in (y0, y1))


def _reach(scene: Scene, outlines: list[Outline]) -> float:
    """How far the figure goes: a little beyond the last object, or to the end of the air.

    Over a round sea with nothing on it the figure goes to three times the distance at which a straight ray
    from the eye touches the sea.
    """
    farthest = max((float(outline.x.max()) for outline in outlines), default=math.inf)
    if math.isinf(farthest) and _is_round(scene) and scene.earth is not None:
        return _HORIZONS * math.sqrt(2.0 * scene.earth.radius * scene.camera.eye[2])
    return min(_air_end(scene), 1.15 * farthest)
