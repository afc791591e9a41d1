"""How wrong a picture's rays are: a few hundred of them against paths in double precision."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr
import mitsuba as mi
import numpy as np

from nigemizu import trace
from nigemizu.render.bending import Bending

__all__ = ["ErrorReport", "measure"]

_RAYS: Final = 1024
_STRIDE: Final = 389  # has no divisor in common with the number of rays
_FINER: Final = 1 / 50  # of the accuracy asked for, for the paths that the picture's are compared with
_NEARBY: Final = 0.02  # pixels, from a ray to its neighbours
_STEPS: Final = 200_000
_LOST: Final = int(trace.RayStatus.OUT_OF_STEPS)
_FIXED: Final = 0.1  # pixels: what a fixed step's reference is a fiftieth of
_EDGE: Final = 0.25  # pixels around a ray within which its neighbours must meet what it meets
_ELSEWHERE: Final = 0.2  # of the way to what is met: by so much does another object lie nearer or farther


@final
@dataclass(frozen=True)
class ErrorReport:
    """Displacement errors of a picture's rays, seen from the eye, and the effort that went into them.

    Attributes
    ----------
    worst, mean : float, pixels
        Largest and mean displacement of what is seen, over the rays that were compared: by integration,
        precision, sharing and chords together.
    strays : float
        Fraction of the rays that met something else than they ought to, away from edges of objects.
    steps, queries : float
        Mean number of a camera ray's own integration steps, and of pieces tested against objects.
    paths : int
        Paths that were flown for all rays to share; 0 where nothing is shared.
    shared : float
        Fraction of the picture whose rays share paths.
    worst_of_each : tuple of float, pixels
        Of several pictures: the largest displacement in each.
    """

    worst: float
    mean: float
    strays: float
    steps: float
    queries: float
    paths: int
    shared: float
    worst_of_each: tuple[float, ...] = ()

    @property
    def usual_worst(self) -> float:
        """Largest displacement in a picture, the mean of several, pixels.

        Of many pictures together more rays have been compared, and the worst of all lies farther out.
        """
        return float(np.mean(self.worst_of_each)) if self.worst_of_each else self.worst

    @staticmethod
    def joined(reports: Iterable[ErrorReport]) -> ErrorReport:
        """Of several pictures: the worst of all, and the means."""
        entries = list(reports)
        if len(entries) == 1:
            return entries[0]

        def mean(name: str) -> float:
            return float(np.mean([getattr(entry, name) for entry in entries]))

        each = tuple(entry.worst for entry in entries)
        means = {name: mean(name) for name in ("mean", "strays", "steps", "queries", "shared")}
        return ErrorReport(worst=max(each), paths=round(mean("paths")), worst_of_each=each, **means)

    def __str__(self) -> str:
        return (
            f"displacement error {self.mean:.2g} pixels on average, {self.worst:.2g} at worst; "
            f"{self.strays:.2%} of the rays meet something else than they ought to; "
            f"{self.steps:.1f} steps and {self.queries:.1f} queries a ray; "
            f"{self.paths} shared paths for {self.shared:.1%} of the picture"
        )


def measure(bending: Bending, scene: Any, sensor: Any) -> ErrorReport | None:
    """Compare rays spread over the picture with the same rays in double precision.

    Parameters
    ----------
    bending : Bending
        Prepared for the sensor.
    scene : mi.Scene
    sensor : mi.Sensor

    Returns
    -------
    ErrorReport or None
        None where light is not bent by a field.

    Notes
    -----
    Compared is the point that a ray has reached where it met something, as an angle seen from the eye; for
    a ray that met nothing also its final direction. Where neighbouring rays see things M times as far apart
    as without air, an error of what is seen displaces the picture by a fraction 1/M of it; M is taken as 1
    where it is less. The reference is marched at a fiftieth of the accuracy, through the same voxels.

    A ray strays if what it meets, or that it meets nothing, is another thing than what the reference meets
    among the same objects, and the references through a quarter of a pixel around it agree with that one.

    Limits: rays that just pass an edge on one side or the other count like any other, by the place that
    they reach. 1024 rays do not see a fault of a few pixels.
    """
    if bending.method != "bent":
        return None
    ray = _spread(sensor)
    origin, direction = bending.frame.to_air(ray.o, ray.d)
    active = mi.Bool(True)
    if bending.paths is None:
        end = bending.march(scene, origin, direction, active)
    else:
        end = bending.from_eye(scene, direction, active)
    dr.eval(end)
    angle = bending.angle if bending.controlled else _FIXED * bending.pixel_angle
    field = trace.grounded(bending.reference(), bending.boxes(scene))
    pixel = bending.pixel_angle
    displaced = _displacement(field, origin, direction, end, angle * _FINER, _NEARBY * pixel) / pixel
    share = None if bending.paths is None else bending.paths.report
    references = _References(field, bending.frame.surface(scene), angle * _FINER, _EDGE * pixel)
    return ErrorReport(
        worst=float(displaced.max()),
        mean=float(displaced.mean()),
        strays=references.strays(origin, direction, end) / _RAYS,
        steps=_mean(end.steps),
        queries=_mean(end.queries),
        paths=0 if share is None else share.paths,
        shared=0.0 if share is None else share.shared,
    )


def _spread(sensor: Any) -> Any:
    """Rays through places spread evenly over the film and the aperture."""
    u, v = trace.spread(_RAYS)
    # Another order of the same places: one on the aperture tells nothing of that on the film.
    other = np.arange(_RAYS) * _STRIDE % _RAYS
    places, lens = (mi.Point2f(mi.Float(a), mi.Float(b)) for a, b in ((u, v), (u[other], v[other])))
    ray, _ = sensor.sample_ray_differential(0.0, 0.5, places, lens)
    dr.eval(ray)
    return ray


def _displacement(
    field: Any, origin: Any, direction: Any, end: trace.RayEnd, accuracy: float, nearby: float
) -> Any:
    """Displacement [rad] of each ray's end from where it ought to be after the same path length.

    `nearby` [rad] is how far neighbours leave the eye from the ray, to see how the air magnifies.
    """
    types = field.types
    Array3f, Float = types.Array3f, types.Float
    reached, length, ahead = Array3f(end.position), Float(end.path_length), Array3f(end.direction)
    d = dr.normalize(Array3f(direction))
    side = dr.normalize(dr.select(abs(d.z) < 0.9, Array3f(-d.y, d.x, 0), Array3f(0, -d.z, d.y)))
    up = dr.cross(d, side)
    ways = [d, dr.normalize(d + side * nearby), dr.normalize(d + up * nearby)]
    exact = [_exact(field, Array3f(origin), way, length, accuracy) for way in ways]
    hit = end.hit
    wrong = _apart(reached, ahead, exact[0], length, hit)
    beside = [_apart(other.position, other.direction, exact[0], length, hit) for other in exact[1:]]
    magnified = dr.maximum(dr.maximum(*beside) / nearby, 1)
    counts = (hit | end.escaped) & (length > 0)
    return np.asarray(dr.select(counts, wrong / magnified, 0), dtype=np.float64)


@final
class _References:
    """Rays in double precision that meet the scene's objects.

    Parameters
    ----------
    field : Field
    surface : Surface
    accuracy : float, rad
    nearby : float, rad
        How far the neighbours of a ray leave the eye from it.
    """

    def __init__(self, field: Any, surface: Any, accuracy: float, nearby: float) -> None:
        self._field, self._surface = field, surface
        self._accuracy, self._nearby = accuracy, nearby

    def strays(self, origin: Any, direction: Any, end: trace.RayEnd) -> int:
        """Number of rays that ended elsewhere than the reference and all of its neighbours."""
        ends = self._march(origin, direction)
        suspects = np.flatnonzero(_elsewhere(ends, _met(end)))
        if not len(suspects):
            return 0
        eye = np.broadcast_to(np.asarray(origin, dtype=np.float64).reshape(3, -1), (3, _RAYS))[:, suspects]
        d = np.asarray(direction, dtype=np.float64)[:, suspects]
        side, up = _across(d)
        agree = np.ones(len(suspects), dtype=bool)
        for way in (side, -side, up, -up):
            agree &= ~_elsewhere(self._march(eye, d + self._nearby * way), ends[:, suspects])
        return int(np.count_nonzero(agree))

    def _march(self, origin: Any, direction: Any) -> Any:
        types = self._field.types
        Array3f, Float = types.Array3f, types.Float
        end = trace.march(
            self._field,
            Array3f(origin),
            dr.normalize(Array3f(direction)),
            accuracy=dr.opaque(Float, self._accuracy),
            max_steps=dr.opaque(types.UInt32, _STEPS),
            surface=self._surface,
            chord_tolerance=dr.opaque(Float, self._accuracy),
        )
        dr.eval(end)
        return _met(end)


def _met(end: trace.RayEnd) -> Any:
    """Path length [m] of each ray to what it met, infinite where that is nothing; status: (2, N) float64."""
    length = dr.select(end.hit, end.path_length, dr.inf)
    return np.stack([np.asarray(part, dtype=np.float64) for part in (length, end.status)])


def _elsewhere(met: Any, others: Any) -> Any:
    """Which of two rays met different things."""
    nearer, farther = np.minimum(met[0], others[0]), np.maximum(met[0], others[0])
    with np.errstate(invalid="ignore"):
        return (nearer < (1 - _ELSEWHERE) * farther) & (met[1] != _LOST) & (others[1] != _LOST)


def _across(direction: Any) -> tuple[Any, Any]:
    """Two unit vectors (3, N) at right angles to unit vectors and to each other."""
    x, y, z = direction
    level = np.abs(z) < 0.9
    side = np.where(level, [-y, x, 0 * z], [0 * x, -z, y])
    side = side / np.linalg.norm(side, axis=0)
    return side, np.cross(direction, side, axis=0)


def _exact(field: Any, origin: Any, direction: Any, length: Any, accuracy: float) -> trace.RayEnd:
    types = field.types
    end = trace.march(
        field,
        origin,
        direction,
        accuracy=dr.opaque(types.Float, accuracy),
        max_steps=dr.opaque(types.UInt32, _STEPS),
        max_distance=length,
    )
    dr.eval(end)
    return end


def _apart(position: Any, ahead: Any, exact: trace.RayEnd, length: Any, hit: Any) -> Any:
    """Angle [rad] between two ends: of places, and where the view is unlimited, of directions too."""
    offset = position - exact.position
    offset -= exact.direction * dr.dot(offset, exact.direction)
    beside = dr.norm(offset) / dr.maximum(length, 1)
    return dr.select(hit, beside, dr.maximum(beside, dr.norm(ahead - exact.direction)))


def _mean(values: Any) -> float:
    return float(np.mean(np.asarray(values, dtype=np.float64)))
