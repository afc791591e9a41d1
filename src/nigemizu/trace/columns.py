"""Rays through air in layers, layer by layer in closed form: tables over elevations and wavelengths."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError

__all__ = ["ColumnRays", "column_rays"]

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]

_AT_ONCE: Final = 1 << 21  # nodes of rays that are worked on together: some 200 MB


@final
@dataclass(frozen=True, eq=False)
class ColumnRays:
    """Where rays through a column of air end, for K wavelengths and E elevations.

    Attributes
    ----------
    escaped, grounded : (K, E) bool
        Out at the top; met the ground. Neither: the ray goes round in a duct for ever.
    distance : (K, E) float64, m
        Along the sea to where the ray leaves the top or meets the ground; NaN in a duct.
    elevation : (K, E) float64, rad
        Of the ray there, against the horizontal of that place; NaN in a duct.
    true_elevation : (K, E) float64, rad
        Of the ray beyond the air, against the horizontal of the eye; NaN unless it escapes.
    lowest : (K, E) float64, m
        Least height of the ray, in the map.
    depth : (..., K, E) float64, 1
        Integral of each coefficient along the ray; infinite in a duct. The leading axes are those of the
        coefficients.
    """

    escaped: BoolArray
    grounded: BoolArray
    distance: FloatArray
    elevation: FloatArray
    true_elevation: FloatArray
    lowest: FloatArray
    depth: FloatArray


def column_rays(
    z: ArrayLike,
    index: ArrayLike,
    *,
    eye: float,
    elevation: ArrayLike,
    radius: float,
    coefficients: ArrayLike | None = None,
) -> ColumnRays:
    """Follow rays from an eye to the top of the air, or to the ground.

    Parameters
    ----------
    z : (nz,) array_like, m
        Heights in the flat map of a round Earth, z = R ln(r/R), increasing; the ground is the first.
    index : (K, nz) or (nz,) array_like, 1
        n′ = n e^(z/R) there.
    eye : float, m
        Height of the eye, in the map.
    elevation : (E,) array_like, rad
        Apparent elevations, −π/2 to π/2.
    radius : float, m
        R; infinite over a flat Earth.
    coefficients : (..., K, nz) array_like, 1/m, optional
        Of extinction (or anything that is to be integrated along the true path), linear between nodes. One
        row of `index` serves all their K.

    Returns
    -------
    ColumnRays

    Raises
    ------
    InputError
        Shapes disagree, heights do not increase, the eye is outside, or an elevation is no elevation.

    Notes
    -----
    Between nodes n′² is linear in z. With p = n′ cos θ, constant along the ray, and q = n′ sin θ,
    q² = n′² − p², the ray is a parabola in σ (dx = p dσ, dz = q dσ): a layer takes Δσ = 2Δz/(q₀ + q₁), and
    of a quantity g that is linear in z it gathers Δσ ((q₀ + 2q₁) g₀ + (2q₀ + q₁) g₁)/(3(q₀ + q₁)). A true
    length is n′ e^(z/R) dσ. A ray turns where q² = 0. Beyond the air it makes the elevation θ − x/R with the
    horizontal of the eye.

    Limits: second order in the thickness of the layers, and of order 3/2 for rays that turn; exact for n′²
    linear in z. A ray that runs level where n′ does not change at all counts as in a duct.

    References
    ----------
    M. Born and E. Wolf (1999), Principles of Optics, 7th ed., section 3.2 (rays in stratified media).

    Examples
    --------
    >>> z = np.linspace(0, 100e3, 2001)
    >>> air = 1 + 2.8e-4 * np.exp(-z / 8e3)
    >>> rays = column_rays(z, air * np.exp(z / 6371e3), eye=0.0, elevation=[0.0], radius=6371e3)
    >>> float(np.degrees(-rays.true_elevation[0, 0]).round(2))
    0.63
    """
    z, index, elevation, extra = _checked(z, index, eye, elevation, coefficients)
    column = _Column.of(z, index, extra, eye, radius)
    step = max(1, _AT_ONCE // (index.shape[0] * (len(z) + 1)))
    starts = range(0, max(len(elevation), 1), step)
    parts = [column.follow(elevation[first : first + step]) for first in starts]
    if len(parts) == 1:
        return parts[0]
    names = [field.name for field in fields(ColumnRays)]
    return ColumnRays(*(np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in names))


def _checked(
    z: ArrayLike, index: ArrayLike, eye: float, elevation: ArrayLike, coefficients: ArrayLike | None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    heights = np.asarray(z, dtype=np.float64)
    if heights.ndim != 1 or len(heights) < 2 or not np.all(np.diff(heights) > 0):
        raise InputError("heights must increase, two of them at least", key="z", value=heights.shape)
    bent = np.atleast_2d(np.asarray(index, dtype=np.float64))
    if (
        bent.ndim != 2
        or bent.shape[1] != len(heights)
        or not np.all(bent > 0)
        or not np.all(np.isfinite(bent))
    ):
        raise InputError(
            "no index above 0 at every height", key="index", value=bent.shape, expected=f"(K, {len(heights)})"
        )
    angles = np.atleast_1d(np.asarray(elevation, dtype=np.float64))
    if angles.ndim != 1 or not np.all(np.abs(angles) <= np.pi / 2 + 1e-12):
        raise InputError("not an elevation", key="elevation", expected="radians from -pi/2 to pi/2, in a row")
    if not heights[0] <= eye <= heights[-1]:
        raise InputError(
            "outside the column", key="eye", value=eye, expected=f"metres, {heights[0]:g} to {heights[-1]:g}"
        )
    given = np.zeros((0, *bent.shape)) if coefficients is None else np.asarray(coefficients, dtype=np.float64)
    if given.ndim < 2 or given.shape[-1] != len(heights) or bent.shape[0] not in (1, given.shape[-2]):
        raise InputError(
            "shapes disagree",
            key="coefficients",
            value=given.shape,
            expected=f"(..., {bent.shape[0]}, {len(heights)})",
        )
    return heights, bent, angles, given


@final
@dataclass(frozen=True, eq=False)
class _Way:
    """From the eye up, or down: nodes (n,), n′² less that of the eye (K, n), coefficients (..., K, n)."""

    z: FloatArray
    rise: FloatArray
    extra: FloatArray

    def gathered(
        self, s: FloatArray, p: FloatArray
    ) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """What rays with q² = s and p [(K, E)] at the eye gather until they turn, or to the end of the way.

        Returns
        -------
        turns : (K, E) bool
        distance : (K, E), m
        end : (K, E)
            q at the end; 0 where they turn.
        last : (K, E), m
            Height at the end.
        depth : (..., K, E)
        """
        if len(self.z) == 1:  # an eye at the end
            none = np.zeros(s.shape)
            depth = np.zeros((*self.extra.shape[:-1], s.shape[-1]))
            return none.astype(bool), none, np.sqrt(s), none + self.z[0], depth
        thickness = np.abs(np.diff(self.z))
        square = s[..., None] + self.rise[:, None, :]
        stop = square[..., 1:] <= 0
        turns: BoolArray = np.asarray(stop.any(axis=-1))
        layer = np.where(turns, stop.argmax(axis=-1), len(thickness))  # in which it turns
        q = np.sqrt(np.maximum(square, 0.0))
        whole = np.arange(len(thickness)) < layer[..., None]
        total = q[..., 1:] + q[..., :-1]
        length = np.where(whole, 2 * thickness / np.where(whole, total, 1.0), 0.0)
        share = length * (1 + q[..., :-1] / np.where(whole, total, 1.0)) / 3  # that of the far node
        # the layer in which it turns, if it does
        at = np.minimum(layer, len(thickness) - 1)[..., None]
        before, after = (np.take_along_axis(part, at, -1) for part in (square[..., :-1], square[..., 1:]))
        fall = np.where(turns[..., None], before - after, 1.0)
        before = np.where(turns[..., None], np.maximum(before, 0.0), 0.0)
        part = before / np.where(fall > 0, fall, 1.0)
        turning = np.where(fall > 0, 2 * np.sqrt(before) * thickness[at] / np.where(fall > 0, fall, 1.0), 0.0)
        np.put_along_axis(length, at, np.take_along_axis(length, at, -1) + turning, -1)
        np.put_along_axis(share, at, np.take_along_axis(share, at, -1) + turning * part * 2 / 3, -1)
        weights = np.zeros(square.shape)
        weights[..., 1:] += share
        weights[..., :-1] += length - share
        last = np.where(turns, self.z[at[..., 0]], self.z[-1])
        step = np.sign(self.z[1] - self.z[0]) * part[..., 0] * thickness[at[..., 0]]
        end = np.where(turns, 0.0, q[..., -1])
        return turns, p * length.sum(axis=-1), end, last + step, self._depth(weights)

    def _depth(self, weights: FloatArray) -> FloatArray:
        lead = self.extra.shape[:-1]
        if weights.shape[0] == 1:
            flat = self.extra.reshape(-1, len(self.z))
            return np.asarray((flat @ weights[0].T).reshape(*lead, weights.shape[1]))
        flat = self.extra.reshape(-1, *self.extra.shape[-2:]).transpose(1, 2, 0)
        return np.asarray(np.matmul(weights, flat).transpose(2, 0, 1).reshape(*lead, weights.shape[1]))


@final
@dataclass(frozen=True, eq=False)
class _Column:
    """A column, seen from an eye."""

    index: FloatArray  # (K,) at the eye
    up: _Way
    down: _Way
    radius: float

    @classmethod
    def of(cls, z: FloatArray, index: FloatArray, extra: FloatArray, eye: float, radius: float) -> _Column:
        square = index**2
        at_eye = np.sqrt([np.interp(eye, z, row) for row in square])
        above, below = z > eye, z < eye
        path = extra * (index * np.exp(z / radius))
        rows = path.reshape(-1, len(z))
        here = np.array([np.interp(eye, z, row) for row in rows]).reshape(path.shape[:-1])
        ways = []
        for part, turn in ((above, 1), (below, -1)):
            nodes, beyond = z[part][::turn], index[:, part][:, ::turn]
            rise = (beyond - at_eye[:, None]) * (beyond + at_eye[:, None])
            gather = np.concatenate([here[..., None], path[..., part][..., ::turn]], axis=-1)
            start = np.zeros((len(index), 1))
            ways.append(_Way(np.append(eye, nodes), np.concatenate([start, rise], axis=1), gather))
        return cls(at_eye, ways[0], ways[1], radius)

    def follow(self, elevation: FloatArray) -> ColumnRays:
        p = self.index[:, None] * np.cos(elevation)
        s = (self.index[:, None] * np.sin(elevation)) ** 2
        caught, rise_x, rise_q, _, rise_depth = self.up.gathered(s, p)
        turned, fall_x, fall_q, bottom, fall_depth = self.down.gathered(s, p)
        down = np.broadcast_to(elevation < 0, s.shape)
        escaped = ~caught & (~down | turned)
        grounded = ~turned & (down | caught)
        # Downwards and up again; or up, turned back, and down to the ground.
        rises = np.where(escaped, 1.0, np.where(caught & ~down, 2.0, 0.0))
        falls = np.where(grounded, 1.0, np.where(escaped & down, 2.0, 0.0))
        met = escaped | grounded
        distance = np.where(met, rises * rise_x + falls * fall_x, np.nan)
        end = np.where(escaped, np.arctan2(rise_q, p), np.where(grounded, -np.arctan2(fall_q, p), np.nan))
        true = np.where(escaped, end - distance / self.radius, np.nan)
        reaches = down | caught
        lowest = np.where(reaches, bottom, self.up.z[0])
        depth = np.where(met, rises * rise_depth + falls * fall_depth, np.inf)
        return ColumnRays(escaped, grounded, distance, end, true, lowest, depth)
