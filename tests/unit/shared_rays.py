"""What the tests of shared paths have in common: airs, walls, a film, and rays marched one by one."""

from __future__ import annotations

from typing import Any, NamedTuple, final

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from nigemizu import field, trace

FloatArray = NDArray[np.float64]

TYPES = field.types("llvm", "double")
PIXEL = 4e-4  # rad
SIZE = (96.0, 64.0)
ACCURACY = 0.1 * PIXEL
EYE = np.array([0.0, 0.3, 1.3])
FAR = 1e5


@final
class Film(trace.View):
    """A pinhole's film that looks along x, its horizon a little above the middle."""

    def __init__(self, eye: FloatArray = EYE, size: tuple[float, float] = SIZE) -> None:
        super().__init__(eye, size, PIXEL)
        self._middle = (size[0] / 2, size[1] * 0.4)

    def directions(self, x: FloatArray, y: FloatArray) -> FloatArray:
        across, down = ((np.asarray(v) - m) * PIXEL for v, m in zip((x, y), self._middle, strict=True))
        ahead = np.stack([np.ones_like(across), -across, -down], axis=-1)
        return ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)

    def locate(self, direction: Any) -> tuple[Any, Any]:
        across, down = -direction.y / direction.x, -direction.z / direction.x
        return across / PIXEL + self._middle[0], down / PIXEL + self._middle[1]


def hot_air(*, uneven: float = 0.0, depth: float = 0.2, floor: float = 0.0) -> field.StratifiedVolume:
    """Hot ground in cells from 5 mm; `uneven`: waves across it, of that share of its refractivity."""
    z = floor + np.concatenate([[0.0], np.cumsum(0.005 * 1.08 ** np.arange(55))])
    profile = 2.7e-4 - 2.5e-5 * np.exp(-z / depth)
    if not uneven:
        data = np.broadcast_to(profile[:, None, None], (len(z), 2, 2))
        return field.StratifiedVolume([0, 600], [-20, 20], z, data, TYPES, "extend")
    rng = np.random.default_rng(np.random.SeedSequence(3))
    x = np.linspace(-10, 600, 40)
    y = np.concatenate([[-20.0], np.cumsum(rng.uniform(1.5, 3.5, 16)) - 18])
    wave = np.sin(0.03 * x)[None, :] * np.cos(0.25 * y)[:, None]
    data = profile[:, None, None] + 2.5e-5 * uneven * wave[None] * np.exp(-z / depth)[:, None, None]
    return field.StratifiedVolume(x, y, z, data, TYPES)


# ---------------------------------------------------------------- surfaces and their boxes


class Objects(NamedTuple):
    """A ground and upright rectangles (x, y0, y1, top) that face the eye; their boxes."""

    surface: trace.Surface
    boxes: FloatArray


def objects(*walls: tuple[float, float, float, float], ground: float | None = 0.0) -> Objects:
    boxes = [[[x, y0, 0.0], [x, y1, top]] for x, y0, y1, top in walls]
    surface: trace.Surface | None = None
    if ground is not None:
        surface = trace.ground_plane(ground)
        boxes.append([[-FAR, -FAR, ground], [FAR, FAR, ground]])
    for wall in walls:
        surface = rectangle(*wall) if surface is None else trace.combine(surface, rectangle(*wall))
    assert surface is not None
    return Objects(surface, np.array(boxes, dtype=np.float64))


def rectangle(x: float, y0: float, y1: float, top: float) -> trace.Surface:
    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        t = (x - origin.x) / direction.x
        y, z = origin.y + t * direction.y, origin.z + t * direction.z
        within = (y >= y0) & (y <= y1) & (z >= 0) & (z <= top)
        return active & (t > 0) & (t <= length) & within, t

    return surface


VILLAGE = ((311.7, -6.0, -2.0, 2.5), (180.0, 2.0, 3.0, 1.0), (450.0, 4.0, 9.0, 3.0), (800.0, -9.0, 2.0, 4.0))


# ---------------------------------------------------------------- comparing


def directions_in(view: trace.View, count: int, azimuths: bool = False) -> FloatArray:
    rng = np.random.default_rng(np.random.SeedSequence(17))
    x, y = rng.uniform(0, max(view.size[0], 1e-9), count), rng.uniform(0, view.size[1], count)
    directions = view.directions(x, y)
    if azimuths:
        turn = rng.uniform(0, 2 * np.pi, count)
        level = np.hypot(directions[:, 0], directions[:, 1])
        directions[:, 0], directions[:, 1] = level * np.cos(turn), level * np.sin(turn)
    return directions


def march(air: field.Field, view: trace.View, surface: Any, directions: FloatArray) -> trace.RayEnd:
    return trace.march(
        air,
        TYPES.Array3f(*view.eye.tolist()),
        TYPES.Array3f(np.ascontiguousarray(directions.T)),
        accuracy=dr.opaque(TYPES.Float, ACCURACY / 100),
        chord_tolerance=dr.opaque(TYPES.Float, ACCURACY / 100),
        max_steps=20_000,
        surface=surface,
    )


def follow(paths: trace.SharedPaths, air: field.Field, surface: Any, directions: FloatArray) -> trace.RayEnd:
    return paths.follow(
        air,
        TYPES.Array3f(np.ascontiguousarray(directions.T)),
        accuracy=ACCURACY,
        chord_tolerance=0.5 * ACCURACY,
        max_steps=20_000,
        surface=surface,
    )


def apart(end: trace.RayEnd, other: trace.RayEnd, eye: FloatArray) -> FloatArray:
    """Displacement [rad] seen from the eye; of rays that met nothing the last straight lines are compared."""
    place, length, ahead = (np.array(v) for v in (end.position, end.path_length, end.direction))
    offset = place - np.array(other.position)
    way = np.array(other.direction)
    offset -= way * (offset * way).sum(axis=0)
    beside = np.linalg.norm(offset, axis=0) / np.maximum(length, 1)
    turned = np.linalg.norm(ahead - way, axis=0)
    return np.where(np.array(end.hit), beside, np.maximum(beside, turned))


def neighbours_differ(air: field.Field, view: trace.View, surface: Any, directions: FloatArray) -> Any:
    """Rays next to which, within three times the accuracy, something else is met."""
    exact = march(air, view, surface, directions)
    status, length = np.array(exact.status), np.array(exact.path_length)
    differ = np.zeros(len(directions), dtype=bool)
    for axis in (1, 2):
        for side in (-1, 1):
            moved = directions.copy()
            moved[:, axis] += 3 * side * ACCURACY
            moved /= np.linalg.norm(moved, axis=1, keepdims=True)
            end = march(air, view, surface, moved)
            jump = np.abs(np.array(end.path_length) - length) > 0.3 * length
            differ |= (np.array(end.status) != status) | jump
    return differ


def assert_alike(
    air: field.Field, view: trace.View, paths: trace.SharedPaths, surface: Any, directions: FloatArray
) -> tuple[trace.RayEnd, FloatArray]:
    """Same status and, within the accuracy, the same place; but for a few rays at edges."""
    shared, single = follow(paths, air, surface, directions), march(air, view, surface, directions)
    edge = neighbours_differ(air, view, surface, directions)
    assert edge.mean() < 0.1
    same = np.array(shared.status) == np.array(single.status)
    # What is met far beyond the air has a test of its own.
    near = np.array(single.path_length) < 1000
    assert np.all(same | edge | ~near)
    edge |= ~near & ~same
    errors = apart(shared, single, view.eye)
    assert np.all(errors[~edge] <= ACCURACY * 1.5)  # chords may add a half
    assert paths.report.error <= ACCURACY
    return shared, errors[~edge]
