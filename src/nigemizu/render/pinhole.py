"""The pinhole camera behind a Mitsuba sensor, and the way back from a direction to the film."""

from __future__ import annotations

from typing import Any, Final, final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Pinhole"]

Vector = NDArray[np.float64]

_TOLERANCE: Final = 1e-6  # of a sampled ray: rad of its direction, and its distance from the eye (relative)
_FITTED: Final = 11  # every so many sampled rays fit the camera; prime to the grid, so that they spread
_GRID: Final = 17  # film positions per axis: averages the rounding of the sampled directions
_APERTURE: Final = ((0.5, 0.5), (0.05, 0.3), (0.9, 0.7))


@final
class Pinhole:
    """A camera whose rays leave one point, in directions that are a linear map of the film. Frozen.

    Parameters
    ----------
    origin : (3,) float64, scene units
        The eye.
    c0, cu, cv : (3,) float64, 1
        The ray through the film position (u, v) has the direction c0 + u cu + v cv, in scene axes. (0, 0)
        is the upper left corner of the part of the film that is rendered, (1, 1) its lower right corner.
    size : (int, int)
        Width and height of that part in pixels.

    Notes
    -----
    Pixel positions (x, y) = (width · u, height · v) are counted from that corner as well: the middle of the
    first pixel is (0.5, 0.5).
    """

    # Not a dataclass: Dr.Jit would take it for a part of the state of loops that mention it.

    def __init__(self, origin: Vector, c0: Vector, cu: Vector, cv: Vector, size: tuple[int, int]) -> None:
        self.origin: Final = _frozen(origin)
        self.c0: Final = _frozen(c0)
        self.cu: Final = _frozen(cu)
        self.cv: Final = _frozen(cv)
        self.size: Final = size
        self._on_device: Final[dict[Any, tuple[Any, ...]]] = {}

    def __repr__(self) -> str:
        return f"Pinhole(origin={self.origin}, c0={self.c0}, cu={self.cu}, cv={self.cv}, size={self.size})"

    @staticmethod
    def of(sensor: Any) -> Pinhole | None:
        """The pinhole camera that a Mitsuba sensor is, or None if it is none.

        Parameters
        ----------
        sensor : mi.Sensor
            Any: what counts is where its rays start and go.

        Returns
        -------
        Pinhole or None
            None where rays depend on the position on the aperture or on the time, do not meet in a point,
            or are spread otherwise over the film (thin lens, orthographic, fisheye).

        Notes
        -----
        With d the sampled directions and w = (1, u, v), the matrix C = (c0, cu, cv) is the least-squares
        solution of d × C w = 0 with |C| = 1. Mitsuba starts its rays on the near plane; the eye is where
        they meet when they are followed backwards.

        Limits: rays are sampled in single precision and have to agree to 10⁻⁶ rad, so that distortions of
        the lens below that, a tenth of a pixel at a field of view of half a degree, are not seen.
        """
        film = sensor.film()
        places, start, direction = _sampled(sensor)
        matrix = _linear_map(places, direction)
        if matrix is None:
            return None
        known = np.asarray(sensor.world_transform().matrix, dtype=np.float64).reshape(4, 4)[:3, 3]
        for origin in (known, _meeting_point(start, direction)):
            if origin is not None and _all_pass(origin, start, direction):
                width, height = (int(length) for length in film.crop_size())
                return Pinhole(origin, matrix[:, 0], matrix[:, 1], matrix[:, 2], (width, height))
        return None

    @property
    def pixel_angle(self) -> float:
        """Angle that one pixel in the middle of the picture spans horizontally, rad."""
        x, y = self.size[0] / 2, self.size[1] / 2
        left, right = self.directions(np.array([x - 0.5, x + 0.5]), np.array([y, y]))
        return float(np.arctan2(np.linalg.norm(np.cross(left, right)), left @ right))

    def directions(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Directions of the rays through positions on the film.

        Parameters
        ----------
        x, y : (N,) float64, pixels
            To the right and down from the corner of the rendered film; may lie outside it.

        Returns
        -------
        (N, 3) float64, 1
            Unit vectors in scene axes.
        """
        u = np.atleast_1d(np.asarray(x, dtype=np.float64)) / self.size[0]
        v = np.atleast_1d(np.asarray(y, dtype=np.float64)) / self.size[1]
        rays = self.c0 + u[:, None] * self.cu + v[:, None] * self.cv
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))

    def film_position(self, direction: Any) -> tuple[Any, Any]:
        """Where on the film light from a direction arrives: the inverse of `directions`.

        Parameters
        ----------
        direction : Array3f, 1
            Away from the eye, in scene axes; `mi.Vector3f` or any Dr.Jit array of three, single or double.
            Unit vectors lose the fewest digits.

        Returns
        -------
        x, y : Float, pixels
            In the precision of `direction`; NaN for directions behind the eye, so that no comparison with
            the edges of the film holds.

        Notes
        -----
        With C⁻¹ d = (w, wu, wv), x = width · u and y = height · v. The camera is data of the kernel: one
        that moves does not compile it again.

        Limits: single precision rounds the components of a unit vector by up to 3·10⁻⁸, 0.005 pixels at a
        field of view of half a degree over 960 pixels and a line of sight oblique to the axes.
        """
        centre, forward, right, down, at_centre = self._device_values(type(direction))
        # From the middle of the film: the difference is exact, and small where the angle of view is.
        offset = direction - centre
        depth = dr.dot(forward, direction)
        depth = dr.select(depth > 0, depth, dr.nan)
        width, height, x, y = at_centre
        return width + (dr.dot(right, offset) + x) / depth, height + (dr.dot(down, offset) + y) / depth

    def _device_values(self, kind: Any) -> tuple[Any, ...]:
        """The camera as opaque values of the type of the directions, made when first needed."""
        if kind not in self._on_device:
            number = dr.value_t(kind)
            inverse = np.linalg.inv(np.stack([self.c0, self.cu, self.cv], axis=1))
            width, height = self.size
            right = width * (inverse[1] - 0.5 * inverse[0])
            down = height * (inverse[2] - 0.5 * inverse[0])
            middle = self.directions([width / 2], [height / 2])[0]
            centre = middle.astype(np.float32).astype(np.float64)  # exact in both precisions

            def opaque(values: Any) -> list[Any]:
                return [dr.opaque(number, float(value)) for value in values]

            self._on_device[kind] = (
                kind(*opaque(centre)),
                kind(*opaque(inverse[0])),
                kind(*opaque(right)),
                kind(*opaque(down)),
                # What `right` and `down` see of the rounded middle, which is nearly at right angles to them.
                tuple(opaque((width / 2, height / 2, right @ centre, down @ centre))),
            )
        return self._on_device[kind]


def _frozen(values: Vector) -> Vector:
    copy = np.array(values, dtype=np.float64)
    copy.flags.writeable = False
    return copy


def _sampled(sensor: Any) -> tuple[Vector, Vector, Vector]:
    """Rays of a sensor: (1, u, v) on the film, start and direction, each (N, 3)."""
    line = np.linspace(0.0, 1.0, _GRID)
    u, v, aperture = (axis.ravel() for axis in np.meshgrid(line, line, np.arange(len(_APERTURE))))
    # Neighbours of the grid take the beginning and the end of the exposure in turn.
    late = np.arange(u.size) % 2
    time = sensor.shutter_open() + late * sensor.shutter_open_time()
    lens = np.asarray(_APERTURE)[aperture.astype(np.int64)]
    ray, _ = sensor.sample_ray_differential(
        mi.Float(time), mi.Float(0.5), mi.Point2f(mi.Float(u), mi.Float(v)), mi.Point2f(lens.T)
    )
    dr.eval(ray)
    start, direction = (np.asarray(part, dtype=np.float64).T for part in (ray.o, ray.d))
    # A sensor whose rays share a point or a direction says so with one entry.
    start, direction = (np.broadcast_to(part, (u.size, 3)) for part in (start, direction))
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return np.stack([np.ones_like(u), u, v], axis=1), start, direction


def _linear_map(places: Vector, direction: Vector) -> Vector | None:
    """The matrix (c0, cu, cv) for which all directions are along C (1, u, v); None if there is none."""
    if not np.all(np.isfinite(direction)):
        return None
    # d × (C w) = 0: three equations per ray in the nine entries of C, row by row. Some of the rays fit it;
    # all of them are held against it.
    some = slice(None, None, _FITTED)
    zero = np.zeros_like(places[some])
    x, y, z = (direction[some, axis, None] * places[some] for axis in range(3))
    equations = np.concatenate([
        np.concatenate([zero, -z, y], axis=1),
        np.concatenate([z, zero, -x], axis=1),
        np.concatenate([-y, x, zero], axis=1),
    ])  # fmt: skip
    matrix = np.linalg.svd(equations, full_matrices=False)[2][-1].reshape(3, 3)
    fitted = places @ matrix.T
    length = np.linalg.norm(fitted, axis=1)
    if np.linalg.cond(matrix) > 1.0 / _TOLERANCE or length.min() < _TOLERANCE * length.max():
        return None
    sign = np.sign(np.sum(fitted[0] * direction[0]))
    strays = np.linalg.norm(sign * fitted / length[:, None] - direction, axis=1)
    middle = float(np.linalg.norm(matrix @ np.array([1.0, 0.5, 0.5])))
    return np.asarray(sign * matrix / middle) if strays.max() < _TOLERANCE else None


def _meeting_point(start: Vector, direction: Vector) -> Vector | None:
    """The point nearest to all lines: Σ (1 − d dᵀ)(p − o) = 0; None for parallel ones."""
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    middle = start.mean(axis=0)
    total = across.sum(axis=0)
    if np.linalg.cond(total) > 1e12:
        return None
    return np.asarray(
        middle + np.linalg.solve(total, np.einsum("nij,nj->i", across, start - middle)), dtype=np.float64
    )


def _all_pass(origin: Vector, start: Vector, direction: Vector) -> bool:
    """Whether all rays come from a point and start in front of it, within single precision."""
    offset = start - origin
    before = np.sum(offset * direction, axis=1)
    beside = np.linalg.norm(offset - before[:, None] * direction, axis=1)
    within = _TOLERANCE * (np.linalg.norm(start, axis=1) + np.linalg.norm(offset, axis=1))
    return bool(np.all(beside <= within) and np.all(before >= -within))
