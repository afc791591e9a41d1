"""Single rays from the eye: where they go, how they end, and the diagram that every mirage paper draws."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.progress import ProgressMeter
from nigemizu.scene.far_air import FarAir, medium
from nigemizu.scene.mapped import mapped_camera
from nigemizu.scene.rendering import Studio
from nigemizu.scene.running import AirSource, AirVolume, Variant, air_at

if TYPE_CHECKING:
    import xarray

    from nigemizu.scene.model import Scene

__all__ = ["TracedRays", "trace"]

FloatArray = NDArray[np.float64]

_FAN: Final = 41  # rays of the fan that is traced when no elevations are given
_GRAZING: Final = (-1.0, 0.25)  # degrees; what air can turn lies here
_STATUSES: Final = ("hit", "escaped", "out-of-steps")
_POINTS: Final = 2000  # points kept along a path, about
_FAR: Final = 1e5  # m, that straight rays are drawn where no mesh says how far the scene reaches
_FINER: Final = 0.01  # of the accuracy of pictures, for rays as data


@final
@dataclass(frozen=True)
class TracedRays:
    """Rays from the eye; N is their number.

    Attributes
    ----------
    elevation, azimuth : (N,) float64, degrees
        Directions in which they left the eye.
    status : tuple of N str
        ``hit``, ``escaped`` or ``out-of-steps``.
    end, end_direction : (N, 3) float64, m and 1
        Where they ended (where they left the air, if they escaped) and their direction there.
    turning_height : (N,) float64, m
        Lowest height at which each turned from falling to rising; NaN where it did not.
    optical_path, path_length : (N,) float64, m
        ∫ n ds and ∫ ds.
    steps : (N,) int64
        Integration steps (panes, for ``layered``).
    paths : tuple of N (K, 3) float64, m
        Points along each ray; empty unless they were asked for.
    scene : Scene
        What was traced.
    air : AirVolume
        Through which air.
    """

    elevation: FloatArray
    azimuth: FloatArray
    status: tuple[str, ...]
    end: FloatArray
    end_direction: FloatArray
    turning_height: FloatArray
    optical_path: FloatArray
    path_length: FloatArray
    steps: NDArray[np.int64]
    paths: tuple[FloatArray, ...]
    scene: Scene
    air: AirVolume

    def as_records(self) -> list[dict[str, Any]]:
        """One JSON-ready record per ray, as ``nigemizu trace --json`` prints them."""
        return [
            {
                "elevation": float(self.elevation[ray]),
                "azimuth": float(self.azimuth[ray]),
                "status": status,
                "end": self.end[ray].tolist(),
                "end_direction": self.end_direction[ray].tolist(),
                "turning_height": None
                if math.isnan(self.turning_height[ray])
                else float(self.turning_height[ray]),
                "optical_path": float(self.optical_path[ray]),
                "steps": int(self.steps[ray]),
            }
            for ray, status in enumerate(self.status)
        ]

    def to_dataset(self) -> xarray.Dataset:
        """The rays as a dataset over ``ray``, their points over ``(ray, point)``."""
        import xarray

        longest = max((len(path) for path in self.paths), default=0)
        points = np.full((len(self.paths), longest, 3), np.nan)
        for ray, path in enumerate(self.paths):
            points[ray, : len(path)] = path
        codes = np.array([_STATUSES.index(status) for status in self.status], dtype=np.int8)
        meanings = " ".join(_STATUSES).replace("-", "_")
        columns: dict[str, Any] = {
            "elevation": ("ray", self.elevation, {"units": "degree", "long_name": "elevation at the eye"}),
            "azimuth": (
                "ray",
                self.azimuth,
                {"units": "degree", "long_name": "azimuth from the camera's heading"},
            ),
            "status": ("ray", codes, {"flag_values": np.arange(3, dtype=np.int8), "flag_meanings": meanings}),
            "turning_height": ("ray", self.turning_height, {"units": "m"}),
            "optical_path": ("ray", self.optical_path, {"units": "m"}),
            "path_length": ("ray", self.path_length, {"units": "m"}),
            "steps": ("ray", self.steps, {"units": "1"}),
        }
        for number, axis in enumerate("xyz"):
            columns[f"end_{axis}"] = ("ray", self.end[:, number], {"units": "m"})
            columns[f"end_direction_{axis}"] = ("ray", self.end_direction[:, number], {"units": "1"})
            if self.paths:
                columns[f"path_{axis}"] = (("ray", "point"), points[..., number], {"units": "m"})
        attributes = {"title": self.scene.title, "nigemizu_scene": self.scene.to_toml()}
        return xarray.Dataset(columns, attrs=attributes)

    def traced_again(self, elevations: Iterable[float]) -> TracedRays:
        """Other rays through the same air, straight ahead, with their paths."""
        return _trace_through(self.scene, self.air, *_fan(self.scene, elevations, None), "auto", paths=True)

    def save(self, path: str | os.PathLike[str], *, command: str = "") -> Path:
        """Write ``.csv``, ``.nc``, or the ray diagram (``.svg``, ``.png``, ``.pdf``); return where it is."""
        from nigemizu.scene.ray_files import save

        return save(self, Path(path), command)


def trace(
    scene: Scene,
    elevations: Iterable[float] | None,
    azimuths: Iterable[float] | None,
    *,
    time: float | None,
    air: AirSource,
    paths: bool,
    variant: Variant,
    progress: ProgressMeter,
) -> TracedRays:
    """See `nigemizu.scene.Scene.trace`."""
    scene.check()
    elevation, azimuth = _fan(scene, elevations, azimuths)
    # Straight light needs no air to travel, but the diagram shows the profile beside it all the same.
    volume = air_at(scene, time, air, progress, variant)
    return _trace_through(scene, volume, elevation, azimuth, variant, paths=paths)


def _trace_through(
    scene: Scene, air: AirVolume, elevation: FloatArray, azimuth: FloatArray, variant: Variant, *, paths: bool
) -> TracedRays:
    from nigemizu.render import Light
    from nigemizu.trace import RayStatus

    directions = _directions(scene, elevation, azimuth)
    # What lights the objects does not count.
    unlit = scene.model_copy(update={"light": Light(sky="constant")})
    end, points = _follow(scene, Studio(unlit, variant), air, directions, paths)
    there, ahead, length, points = _in_the_world(scene, end, points)

    return TracedRays(
        elevation=elevation,
        azimuth=azimuth,
        status=tuple(RayStatus(int(status)).label for status in np.asarray(end.status)),
        end=there,
        end_direction=ahead,
        turning_height=_heights(scene, _per_ray(end.turning_height, len(elevation))),
        optical_path=_per_ray(end.optical_path, len(elevation)),
        path_length=length,
        steps=_per_ray(end.steps, len(elevation)).astype(np.int64),
        paths=points,
        scene=scene,
        air=air,
    )


def _heights(scene: Scene, z: FloatArray) -> FloatArray:
    return z if scene.earth is None else scene.earth.height(z)


def _in_the_world(
    scene: Scene, end: Any, paths: tuple[FloatArray, ...]
) -> tuple[FloatArray, FloatArray, FloatArray, tuple[FloatArray, ...]]:
    """End points, directions, path lengths and paths, with heights in place of the map's z."""
    position = np.asarray(end.position, dtype=np.float64).T.copy()
    direction = np.asarray(end.direction, dtype=np.float64).T
    length = _per_ray(end.path_length, len(position))
    if scene.earth is None or not scene.round:
        return position, direction, length, paths
    position[:, 2] = scene.earth.height(position[:, 2])
    # A piece of the map is shorter than that of the world by the stretch of its height.
    for ray, points in enumerate(paths):
        pieces = np.linalg.norm(np.diff(points, axis=0), axis=1)
        stretch = scene.earth.stretch(points[:, 2])
        along = float(pieces.sum())
        if along > 0:
            length[ray] *= float((pieces * (stretch[1:] + stretch[:-1])).sum()) / (2 * along)
    heights = (scene.earth.height(points[:, 2]) for points in paths)
    lifted = (np.column_stack([points[:, :2], z]) for points, z in zip(paths, heights, strict=True))
    return position, direction, length, tuple(lifted)


def _per_ray(values: Any, count: int) -> FloatArray:
    """Device array to NumPy; Dr.Jit keeps one entry where all rays agree."""
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (count,)).copy()


def _fan(
    scene: Scene, elevations: Iterable[float] | None, azimuths: Iterable[float] | None
) -> tuple[FloatArray, FloatArray]:
    """Every elevation at every azimuth [degrees]."""
    camera = scene.camera
    if elevations is None:
        middle = math.degrees(math.asin(camera.direction[2]))
        half = math.degrees(math.atan(camera.height / 2 * camera.pixel_angle))
        low, high = max(middle - half, _GRAZING[0]), min(middle + half, _GRAZING[1])
        if low >= high:  # the camera looks elsewhere
            low, high = middle - half, middle + half
        rising: FloatArray = np.linspace(low, high, _FAN)
    else:
        rising = np.array(list(elevations), dtype=np.float64)
    turning = np.array([0.0] if azimuths is None else list(azimuths), dtype=np.float64)
    for key, values in (("elevation", rising), ("azimuth", turning)):
        limit = 90.0 if key == "elevation" else 360.0
        if not values.size or not np.all(np.abs(values) <= limit):
            wrong = None if not values.size else float(values[np.argmax(~(np.abs(values) <= limit))])
            raise InputError(
                "no angle", key=key, value=wrong, expected=f"degrees from -{limit:g} to {limit:g}"
            )
    return np.tile(rising, turning.size), np.repeat(turning, rising.size)


def _directions(scene: Scene, elevation: FloatArray, azimuth: FloatArray) -> FloatArray:
    ahead = scene.camera.direction
    heading = math.atan2(ahead[1], ahead[0]) + np.radians(azimuth)
    rise = np.radians(elevation)
    return np.stack([np.cos(rise) * np.cos(heading), np.cos(rise) * np.sin(heading), np.sin(rise)], axis=1)


def _follow(
    scene: Scene, studio: Studio, air: AirVolume, directions: FloatArray, paths: bool
) -> tuple[Any, tuple[FloatArray, ...]]:
    """The ends of the rays in double precision, and their points."""
    from nigemizu import trace

    tracer, surface = scene.tracer, studio.surfaces
    if tracer.method == "straight" and scene.round:
        air = FarAir.of(scene).vacuum()
    through = medium(scene, air, precision="double")
    types = through.types
    eye = mapped_camera(scene).eye
    origin = types.Array3f(*(types.Float(np.full(len(directions), place)) for place in eye))
    ahead = types.Array3f(*(types.Float(np.ascontiguousarray(column)) for column in directions.T))
    if tracer.method == "straight" and not scene.round:
        end = trace.straight(types, origin, ahead, surface=surface, details=True)
        return end, _straight_paths(scene, end, directions) if paths else ()
    if tracer.method == "layered":
        end = trace.cross_layers(
            through, origin, ahead, max_crossings=tracer.max_steps, surface=surface, details=True
        )
        return end, _pane_paths(scene, through, origin, ahead, surface) if paths else ()
    march: dict[str, Any] = {"max_steps": tracer.max_steps, "surface": surface}
    if tracer.step is None:
        pixel = scene.camera.pixel_angle
        march |= {
            "accuracy": tracer.angle(pixel) * _FINER,
            "chord_tolerance": tracer.chord_tolerance * pixel * _FINER,
        }
    else:
        march |= {"step": tracer.step, "stepper": trace.stepper_named(tracer.stepper)}
    end = trace.march(through, origin, ahead, details=True, **march)
    if not paths:
        return end, ()
    every = max(1, int(np.max(np.asarray(end.steps))) // _POINTS)
    points, _ = trace.record_paths(through, eye, directions, every=every, **march)
    return end, tuple(points)


def _straight_paths(scene: Scene, end: Any, directions: FloatArray) -> tuple[FloatArray, ...]:
    """From the eye to the hit, or far away."""
    far = _FAR if scene.grid is None else max(abs(edge) for edge in (*scene.grid.x, *scene.grid.y))
    length = np.where(np.asarray(end.hit), np.asarray(end.path_length), far)
    eye = np.array(scene.camera.eye)
    return tuple(np.stack([eye, eye + reach * way]) for reach, way in zip(length, directions, strict=True))


def _pane_paths(scene: Scene, panes: Any, origin: Any, ahead: Any, surface: Any) -> tuple[FloatArray, ...]:
    """The corners of the rays: where each meets the first, second, third … boundary, and the end."""
    from nigemizu import trace

    corners = [np.asarray(origin, dtype=np.float64).T]
    for crossings in range(1, scene.tracer.max_steps + 1):
        end = trace.cross_layers(panes, origin, ahead, max_crossings=crossings, surface=surface)
        corners.append(np.asarray(end.position, dtype=np.float64).T)
        if not np.any(np.asarray(end.status) == int(trace.OUT_OF_STEPS)):
            break
    return tuple(np.stack(corners, axis=1))
