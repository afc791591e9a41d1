"""Integrals along rays in spherical shells: over the height, or over the local elevation of the ray."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Final, NamedTuple, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.trace.shells import SphericalAir

__all__ = ["Arcs", "Measure", "over_elevation", "over_height", "solve_climb"]

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.intp]

_HALF_NODES: Final = (
    0.991455371120812639206854697526329,
    0.949107912342758524526189684047851,
    0.864864423359769072789712788640926,
    0.741531185599394439863864773280788,
    0.586087235467691130294144691258980,
    0.405845151377397166906606412076961,
    0.207784955007898467600689403773245,
)
_HALF_WEIGHTS: Final = (
    0.022935322010529224963732008058970,
    0.063092092629978553290700663189204,
    0.104790010322250183839876322541518,
    0.140653259715525918745189590510238,
    0.169004726639267902826583426598550,
    0.190350578064785409913256402421014,
    0.204432940075298892414161999234649,
)
_MIDDLE_WEIGHT: Final = 0.209482141084727828012999174891714

NODES: Final = 0.5 * (1.0 + np.array([*(-x for x in _HALF_NODES), 0.0, *reversed(_HALF_NODES)]))
"""The 15 points of Kronrod on [0, 1], of which every other is one of the 7 of Gauss."""

_MIDDLE: Final = 7
_SEVEN: Final = np.zeros(15)
_SEVEN[1::2] = np.polynomial.legendre.leggauss(7)[1]
_WEIGHTS: Final = 0.5 * np.array([[*_HALF_WEIGHTS, _MIDDLE_WEIGHT, *reversed(_HALF_WEIGHTS)], _SEVEN])

_NOISE: Final = 1e-14  # of an integral, below which rounding hides its error
_DEEPEST: Final = 50  # halvings
_MOST: Final = 150_000  # numbers in one array, which then stays in the cache of a core


class Measure(NamedTuple):
    """What is summed along a ray: an amount per metre, times the cosine of the elevation if `level`.

    An integral over one shell may be wrong by `absolute`, or by `relative` of itself.
    """

    amount: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
    level: bool
    absolute: float
    relative: float = 0.0


@final
@dataclass(frozen=True)
class Arcs:
    """Pieces of rays that rise through (part of) a shell, for all K wavelengths each.

    Attributes
    ----------
    row : (N,) intp
        Of which ray.
    weight : (N,) float64, 1
        How often the ray passes.
    angle, angle_end : (N, K) float64, rad
        Elevation at either end.
    height, height_end : (N, K) float64, m
    """

    row: IntArray
    weight: FloatArray
    angle: FloatArray
    angle_end: FloatArray
    height: FloatArray
    height_end: FloatArray

    def pick(self, which: NDArray[np.bool_] | slice) -> Arcs:
        """Some of them."""
        return Arcs(*(getattr(self, field.name)[which] for field in fields(self)))

    @staticmethod
    def joined(parts: Sequence[Arcs]) -> Arcs:
        """All of them, one after another."""
        return Arcs(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Arcs)))


def over_height(
    air: SphericalAir,
    measures: Sequence[Measure],
    *,
    low: FloatArray,
    high: FloatArray,
    sine2: FloatArray,
    cosine2: FloatArray,
    level_end: str = "",
) -> FloatArray:
    """Integrals (M, N, K) from heights `low` to `high` of rays whose elevation at `low` is given.

    Parameters
    ----------
    air : SphericalAir
    measures : M of Measure
    low, high : (N or 1, K) float64, m
    sine2, cosine2 : (N, K) float64, 1
        Squares of the sine and cosine of the elevation at `low`.
    level_end : {"", "low", "high"}
        Near which end the ray may be all but level: heights crowd there as the square of the variable.

    Notes
    -----
    ds = dh / sin θ, with sin²θ = sin²θ₀ − cos²θ₀ (exp(−2F) − 1), F = ln(n r / n₀ r₀).
    """
    total = np.zeros((len(measures), *sine2.shape))
    here = air.state(low)[0]
    work = [(0.0, 1.0, np.arange(len(sine2)))]
    while work:
        start, end, rows = work.pop()
        _refuse_endless(end - start)
        own = rows if len(low) > 1 else slice(None)
        t = (start + (end - start) * NODES)[:, None]
        span = (high - low)[own][:, None]
        if level_end == "low":
            height, stretch = low[own][:, None] + span * t**2, 2.0 * span * t
        elif level_end == "high":
            height, stretch = high[own][:, None] - span * (1.0 - t) ** 2, 2.0 * span * (1.0 - t)
        else:
            height, stretch = low[own][:, None] + span * t, span
        excess, slope = air.state(height)
        gain = -np.expm1(-2.0 * air.climb(height, excess, low[own][:, None], here[own][:, None]))
        rise = sine2[rows][:, None] + cosine2[rows][:, None] * gain
        _refuse_turning(rise, span)
        rise = np.where(span > 0.0, rise, 1.0)
        steps = (end - start) * stretch / np.sqrt(rise)
        level = steps * np.sqrt(cosine2[rows][:, None] * (1.0 - gain))
        values = np.stack([m.amount(height, excess, slope) * (level if m.level else steps) for m in measures])
        doubt = np.finfo(float).eps * (np.abs(excess) + np.abs(gain)) / rise if level_end else None
        sums, poor = _summed(values, measures, doubt)
        total[:, rows[~poor]] += sums[:, ~poor]
        if np.any(poor):
            middle = 0.5 * (start + end)
            work += [(start, middle, rows[poor]), (middle, end, rows[poor])]
    return total


def over_elevation(air: SphericalAir, measures: Sequence[Measure], arcs: Arcs, total: FloatArray) -> None:
    """Add integrals over the arcs to the rays' totals (M, rays, K).

    Notes
    -----
    The form of Auer and Standish: ds = dθ / (cos θ F'), F' = d ln(n r)/dr, at heights that solve
    F(h) = ln(cos θ₀ / cos θ). Smooth where the ray is level, and wants F' > 0.
    """
    generations = 0
    while len(arcs.row):
        _refuse_endless(0.5**generations)
        generations += 1
        length = max(1, _MOST // (len(NODES) * arcs.angle.shape[1]))
        again = []
        for begin in range(0, len(arcs.row), length):
            part = arcs.pick(slice(begin, begin + length))
            sums, poor, middle = _once(air, measures, part)
            for number, amounts in enumerate(sums):
                np.add.at(total[number], part.row[~poor], (part.weight[:, None] * amounts)[~poor])
            again += _halves(part.pick(poor), middle[poor])
        if not again:
            return
        arcs = Arcs.joined(again)


def _halves(arcs: Arcs, middle: FloatArray) -> list[Arcs]:
    if not len(arcs.row):
        return []
    angle = 0.5 * (arcs.angle + arcs.angle_end)
    first = Arcs(arcs.row, arcs.weight, arcs.angle, angle, arcs.height, middle)
    return [first, Arcs(arcs.row, arcs.weight, angle, arcs.angle_end, middle, arcs.height_end)]


def _once(
    air: SphericalAir, measures: Sequence[Measure], arcs: Arcs
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Integrals (M, N, K), which arcs need halving (N,), and the heights of their middles (N, K)."""
    width = arcs.angle_end - arcs.angle
    angle = arcs.angle[:, None] + width[:, None] * NODES[:, None]
    ratio = np.sin(width[:, None] * NODES[:, None]) * np.sin(angle + arcs.angle[:, None])
    target = -0.5 * np.log1p(-ratio / np.cos(arcs.angle[:, None]) ** 2)
    low, high = arcs.height[:, None], arcs.height_end[:, None]
    here = air.state(low)[0]
    height, excess, slope = solve_climb(air, target, low, here, low, high)
    rate = air.rate(height, excess, slope)
    wide = width[:, None] != 0.0
    if np.any(wide & (rate <= 0.0)):
        raise _unresolved(float(height[wide & (rate <= 0.0)][0]))
    level = np.where(wide, width[:, None] / np.where(wide, rate, 1.0), 0.0)
    cosine = np.cos(angle) if not all(m.level for m in measures) else angle
    values = np.stack(
        [m.amount(height, excess, slope) * (level if m.level else level / cosine) for m in measures]
    )
    sums, poor = _summed(values, measures)
    return sums, poor, height[:, _MIDDLE]


def solve_climb(
    air: SphericalAir,
    target: FloatArray,
    from_: FloatArray,
    there: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Heights [m] in [low, high] at which ln(n r) exceeds its value at `from_` by `target`.

    n r grows all the way from `low` to `high`. Newton's method, kept between bounds that close in.

    Returns
    -------
    height, excess, slope : float64
        m, n − 1 and dn/dh [m⁻¹] there.
    """
    shape = np.broadcast_shapes(target.shape, low.shape, high.shape)
    below, above = np.broadcast_to(low, shape), np.broadcast_to(high, shape)
    width = above - below
    height = _guess(air, target, from_, there, low, high)
    for _ in range(100):
        excess, slope = air.state(height)
        surplus = air.climb(height, excess, from_, there) - target
        rate = air.rate(height, excess, slope)
        below = np.where(surplus < 0.0, height, below)
        above = np.where(surplus > 0.0, height, above)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = surplus / rate
        noise = (np.abs(excess) + np.abs(target)) / np.abs(rate) + np.abs(height)
        close = 1e-13 * width + 8.0 * np.finfo(float).eps * noise
        done = (np.abs(step) <= close) | (above - below <= close)
        if np.all(done):
            return height, excess, slope
        better = height - step
        inside = (better >= below) & (better <= above)
        height = np.where(done, height, np.where(inside, better, 0.5 * (below + above)))
    raise _unresolved(float(height[~done][0]))


def _guess(
    air: SphericalAir,
    target: FloatArray,
    from_: FloatArray,
    there: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Height as the cubic in ln(n r) that has its values and slopes at both bounds."""
    inset = 1e-9 * (high - low)
    first, last = low + inset, high - inset
    (excess, slope), (excess_end, slope_end) = air.state(first), air.state(last)
    start = air.climb(first, excess, from_, there)
    span = air.climb(last, excess_end, from_, there) - start
    flat = span <= 0.0
    u = np.clip(np.where(flat, 0.0, (target - start) / np.where(flat, 1.0, span)), 0.0, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = span / air.rate(first, excess, slope)
        rise_end = span / air.rate(last, excess_end, slope_end)
    cubic = first + u * (
        rise
        + u * (3.0 * (last - first) - 2.0 * rise - rise_end + u * (rise + rise_end - 2.0 * (last - first)))
    )
    plain = first + u * (last - first)
    return np.where((cubic >= low) & (cubic <= high), cubic, plain)


def _summed(
    values: FloatArray, measures: Sequence[Measure], doubt: FloatArray | None = None
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Integrals (M, N, K) of values (M, N, 15, K) on the nodes, and which of the N are not yet good.

    Values that rounding makes uncertain by a relative `doubt` (N, 15, K) get no better by halving.
    """
    fine, coarse = (np.einsum("mntk,t->mnk", values, weights) for weights in _WEIGHTS)
    size, gap = np.abs(fine), np.abs(fine - coarse)
    allowed = np.array([m.absolute for m in measures])[:, None, None]
    relative = np.array([m.relative for m in measures])[:, None, None]
    allowed = np.maximum(allowed, np.maximum(relative, _NOISE) * size)
    if doubt is not None:
        allowed = np.maximum(allowed, np.einsum("mntk,ntk,t->mnk", np.abs(values), doubt, _WEIGHTS[0]))
    return fine, np.any(_estimate(size, gap) > allowed, axis=(0, 2))


def _estimate(size: FloatArray, gap: FloatArray) -> FloatArray:
    """Error of the 15 points whose integral is `size` and differs by `gap` from that of the 7.

    As QUADPACK has it, with the integral itself for the scale of the integrand.
    """
    whole = np.maximum(size, gap)
    part = np.divide(gap, whole, out=np.zeros_like(gap), where=whole > 0.0)
    return np.asarray(whole * np.minimum(part, (200.0 * part) ** 1.5))


def _refuse_endless(width: float) -> None:
    if width < 0.5**_DEEPEST:
        raise InputError(
            "the refraction integral does not settle",
            key="index",
            expected="a smooth index between the breaks",
            remedy="give every height at which dn/dh jumps as a break",
        )


def _refuse_turning(rise: FloatArray, span: FloatArray) -> None:
    if np.any((rise <= 0.0) & (span > 0.0)):
        raise InputError(
            "a ray turns at a height between the breaks at which none was expected to",
            key="index",
            remedy="give heights on either side of each thin layer as breaks",
        )


def _unresolved(height: float) -> InputError:
    return InputError(
        f"n r is not monotonic near the height {height:g} m, between breaks that seemed to be smooth",
        key="index",
        remedy="give heights on either side of each thin layer as breaks",
    )
