"""From moments of displacements to turbulence, with intervals, and beside the theory."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.heat.turbulence.theory import rytov_variance
from nigemizu.measure.films import Film
from nigemizu.measure.forms import coherence_length, difference_forms, unit_variance
from nigemizu.measure.measuring import Tracked
from nigemizu.measure.optics import Optics
from nigemizu.measure.result import Measurement, PerTile, Quantity, Separations, Temporal
from nigemizu.measure.statistics import Correlation, Interval, correlation_of, quadratic

__all__ = ["evaluate"]

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.intp]

_BINS = 12


@final
@dataclass(frozen=True)
class _Axis:
    """The tiles that show motion along one axis: places and covariances in pixels."""

    number: int
    index: IntArray
    place: FloatArray
    covariance: FloatArray
    noise: FloatArray

    @property
    def count(self) -> int:
        return self.index.size

    def pairs(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Separation [pixels], cos 2α and mean squared difference [pixels²] of all pairs."""
        i, j = np.triu_indices(self.count, 1)
        offset = self.place[i] - self.place[j]
        apart = np.hypot(*offset.T)
        cosine = (2 * (offset[:, self.number] / apart) ** 2 - 1) if apart.size else apart
        c, n = self.covariance, self.noise
        return apart, cosine, c[i, i] + c[j, j] - 2 * c[i, j] - n[i] - n[j]


def evaluate(
    film: Film,
    optics: Optics,
    tracked: Tracked,
    mean: NDArray[np.float32],
    frames: int,
    interval: float | None,
    *,
    remove_shake: bool,
    points: bool,
) -> Measurement:
    """Put the result together; see `nigemizu.measure.measure_film`."""
    axes = [axis for axis in (_axis(tracked, number, remove_shake) for number in (0, 1)) if axis.count]
    if not axes:
        raise InputError(
            "all edges are slanting: no tile shows motion along x or along y", file=str(film.path)
        )
    if remove_shake and max(axis.count for axis in axes) < 4:
        raise InputError(
            "too few tiles to tell shake from shimmer",
            key="--remove-shake",
            value=max(axis.count for axis in axes),
            expected="4 tiles at least",
        )
    correlation = _correlation(tracked, axes, frames)
    patch = 0.0 if points else optics.pixel_angle * float(np.median(tracked.texture.radius))
    quantities = _quantities(optics, axes, correlation, frames, patch, interval, remove_shake)
    raw = sum(float(np.trace(axis.covariance)) for axis in axes)
    noise_share = sum(float(axis.noise.sum()) for axis in axes) / raw if raw > 0 else 0.0
    return Measurement(
        film=film.path,
        frames=frames,
        shape=film.shape,
        interval=interval,
        tile=tracked.tile,
        search=tracked.search,
        optics=optics,
        quantities=quantities,
        tiles=_per_tile(tracked, axes, frames, optics.pixel_angle),
        separations=_separations(optics, axes, patch),
        temporal=_temporal(tracked, axes, correlation, interval, optics.pixel_angle),
        independent=frames / correlation.squared,
        noise_share=noise_share,
        common=(float(tracked.common[0]), float(tracked.common[1])),
        shake_removed=remove_shake,
        remarks=_remarks(optics, quantities, correlation, noise_share, frames, interval, patch),
        picture=mean,
    )


def _axis(tracked: Tracked, number: int, remove_shake: bool) -> _Axis:
    shows = tracked.texture.along_x if number == 0 else tracked.texture.along_y
    index = np.flatnonzero(shows)
    covariance = tracked.moments.covariance(number)[np.ix_(index, index)]
    noise = tracked.moments.noise[index, number]
    if remove_shake and index.size:
        noise = noise * (1 - 2 / index.size) + noise.mean() / index.size
    return _Axis(number, index, _middles(tracked)[tracked.kept[index]], covariance, noise)


def _middles(tracked: Tracked) -> FloatArray:
    """Column and row of the middle of all tiles."""
    return np.asarray(tracked.corners[:, ::-1], dtype=np.float64) + (tracked.tile - 1) / 2


def _correlation(tracked: Tracked, axes: list[_Axis], frames: int) -> Correlation:
    lagged = tracked.moments.autocovariance()
    total = sum(axis.count for axis in axes)
    pooled = sum(lagged[:, axis.index, axis.number].sum(1) for axis in axes) / total
    noise = sum(float(axis.noise.sum()) for axis in axes) / total
    return correlation_of(np.asarray(pooled), noise, frames)


def _joined(axes: list[_Axis], weights: list[FloatArray], frames: int, correlation: Correlation) -> Interval:
    """tr(W C) over both axes, whose displacements do not depend on each other."""
    ends = np.cumsum([0, *(axis.count for axis in axes)])
    w, c = np.zeros((2, ends[-1], ends[-1]))
    for axis, weight, begin, end in zip(axes, weights, ends[:-1], ends[1:], strict=True):
        w[begin:end, begin:end], c[begin:end, begin:end] = weight / len(axes), axis.covariance
    return quadratic(w, c, np.concatenate([axis.noise for axis in axes]), frames, correlation)


def _differences(axes: list[_Axis]) -> list[FloatArray]:
    """Weights whose tr(W C) is the mean squared difference over all pairs of tiles."""
    return [2 / (a.count - 1) * (np.eye(a.count) - 1 / a.count) for a in axes]


def _mean_difference_form(optics: Optics, axis: _Axis, patch: float) -> float:
    """What `_differences` is for Cn² = 1, rad²."""
    apart, cosine, _ = axis.pairs()
    angle = optics.pixel_angle * apart
    nodes = np.linspace(0.0, float(angle.max()), 64)
    isotropic, directional = difference_forms(optics, patch, nodes)
    return float(np.mean(np.interp(angle, nodes, isotropic) + cosine * np.interp(angle, nodes, directional)))


def _quantities(
    optics: Optics,
    axes: list[_Axis],
    correlation: Correlation,
    frames: int,
    patch: float,
    interval: float | None,
    remove_shake: bool,
) -> tuple[Quantity, ...]:
    square, cn2 = optics.pixel_angle**2, optics.cn2
    several = [axis for axis in axes if axis.count > 1]
    forms = [_mean_difference_form(optics, axis, patch) for axis in several]
    unit = unit_variance(optics, patch)
    # without the motion that all share, half of the mean squared difference of two tiles is left
    units = {a.number: 0.5 * f * (a.count - 1) / a.count for a, f in zip(several, forms, strict=True)}
    found: list[Quantity] = []

    def add(name: str, words: str, unit_name: str, one: Interval, theory: float | None) -> None:
        found.append(Quantity(name, words, unit_name, one.value, one.low, one.high, theory))

    plain = [np.eye(axis.count) / axis.count for axis in axes]
    part = " less shake" if remove_shake else ""
    for axis, weight in zip(axes, plain, strict=True):
        one = _joined([axis], [weight], frames, correlation).scaled(square)
        letter = "xy"[axis.number]
        share = units.get(axis.number, 0.0) if remove_shake else unit
        theory = None if cn2 is None else cn2 * share
        add(f"variance_{letter}", f"variance of the angle of arrival, {letter}{part}", "rad²", one, theory)
    both = _joined(axes, plain, frames, correlation).scaled(square)
    if len(axes) > 1:
        share = float(np.mean([units.get(a.number, 0.0) for a in axes])) if remove_shake else unit
        add("variance", f"mean of x and y{part}", "rad²", both, None if cn2 is None else cn2 * share)
    strengths: list[tuple[str, str, Interval]] = []
    if not remove_shake:
        strengths.append(("", "", both.scaled(1 / unit)))
    if several:
        apart = _joined(several, _differences(several), frames, correlation).scaled(square)
        form = float(np.mean(forms))
        theory = None if cn2 is None else cn2 * form
        add("difference", "mean squared difference of two tiles, per axis", "rad²", apart, theory)
        strengths.append(("_differential", ", from differences", apart.scaled(1 / form)))
    for suffix, words, one in strengths:
        add(f"cn2{suffix}", f"mean Cn² of the path{words}", "m^(-2/3)", one, cn2)
    for suffix, words, one in strengths:
        value, low, high = (float(r0) for r0 in coherence_length([one.value, one.high, one.low], optics))
        theory = None if cn2 is None else float(coherence_length(cn2, optics))
        found.append(Quantity(f"r0{suffix}", f"r0{words}", "m", value, low, high, theory))
    step, name = (1.0, "frames") if interval is None else (interval, "s")
    found.append(Quantity("correlation_time", "correlation time", name, 0.5 * step * correlation.time))
    return tuple(found)


def _per_tile(tracked: Tracked, axes: list[_Axis], frames: int, angle: float) -> PerTile:
    count = len(tracked.corners)
    variance, noise = np.full((2, count, 2), np.nan)
    lost, radius = np.ones(count), np.full(count, np.nan)
    kinds = ["none"] * count
    for position, index in enumerate(tracked.kept):
        kinds[index] = tracked.texture.kind(position)
    lost[tracked.kept] = 1 - tracked.moments.found / frames
    radius[tracked.kept] = tracked.texture.radius
    for axis in axes:
        at = tracked.kept[axis.index]
        variance[at, axis.number] = (np.diagonal(axis.covariance) - axis.noise) * angle**2
        noise[at, axis.number] = axis.noise * angle**2
    return PerTile(_middles(tracked), tuple(kinds), variance, noise, lost, radius)


def _separations(optics: Optics, axes: list[_Axis], patch: float) -> Separations:
    apart, cosine, squared = (np.concatenate(parts) for parts in zip(*(a.pairs() for a in axes), strict=True))
    if not apart.size:
        empty = np.zeros(0)
        return Separations(empty, empty, empty)
    bins = min(_BINS, max(1, np.unique(apart.round(3)).size))
    edges = np.linspace(apart.min() * 0.999, apart.max() * 1.001, bins + 1)
    which = np.clip(np.searchsorted(edges, apart) - 1, 0, bins - 1)
    # within 30 degrees of the line between the tiles, and of its normal
    masks = [np.ones(apart.size, dtype=bool), cosine > 0.5, cosine < -0.5]
    sums = [np.bincount(which[m], minlength=bins).astype(float) for m in masks]

    def binned(values: FloatArray) -> list[FloatArray]:
        """Means of all pairs, of those along the axis and of those across, in bins that hold pairs."""
        with np.errstate(invalid="ignore", divide="ignore"):
            means = [np.bincount(which[m], values[m], bins) / n for m, n in zip(masks, sums, strict=True)]
        return [mean[sums[0] > 0] for mean in means]

    scale = optics.pixel_angle**2
    angle = optics.pixel_angle * binned(apart)[0]
    _, along, across = binned(scale * squared)
    if optics.cn2 is None:
        return Separations(angle, along, across)
    # for the very pairs: those of a bin differ in length and in direction
    nodes = np.linspace(0.0, optics.pixel_angle * float(apart.max()), 64)
    isotropic, directional = (
        np.interp(optics.pixel_angle * apart, nodes, form) for form in difference_forms(optics, patch, nodes)
    )
    _, along_theory, across_theory = binned(optics.cn2 * (isotropic + cosine * directional))
    return Separations(angle, along, across, along_theory, across_theory)


def _temporal(
    tracked: Tracked, axes: list[_Axis], correlation: Correlation, interval: float | None, angle: float
) -> Temporal:
    step = 1.0 if interval is None else interval
    power = tracked.moments.spectrum()
    total = sum(axis.count for axis in axes)
    pooled = np.asarray(sum(power[:, axis.index, axis.number].sum(1) for axis in axes)) / total
    noise = sum(float(axis.noise.sum()) for axis in axes) / total
    frequency = np.arange(power.shape[0], dtype=np.float64) / (tracked.moments.segment * step)
    scale = 2 * step * angle**2
    lag = step * np.arange(correlation.values.size, dtype=np.float64)
    return Temporal(
        lag,
        correlation.values,
        frequency[1:],
        scale * pooled[1:],
        scale * noise,
        "frames" if interval is None else "s",
    )


def _remarks(
    optics: Optics,
    quantities: tuple[Quantity, ...],
    correlation: Correlation,
    noise_share: float,
    frames: int,
    interval: float | None,
    patch: float,
) -> tuple[str, ...]:
    named = {one.name: one for one in quantities}
    found: list[str] = []
    fresnel = math.sqrt(optics.wavelength * optics.distance)
    if 0 < optics.aperture < fresnel:
        found.append(
            f"the aperture is smaller than sqrt(λL) = {1e3 * fresnel:.3g} mm: "
            "geometrical optics is only rough here"
        )
    width = 2 * patch * optics.distance
    if width > max(optics.aperture, 1e-3):
        found.append(f"a tile spans {width:.3g} m at the far end; that it averages is allowed for")
    whole, apart = named.get("cn2"), named.get("cn2_differential")
    if whole and apart and apart.high > 0 and whole.low > apart.high:
        found.append(
            "all tiles move together by more than turbulence explains: the camera shook (--remove-shake), "
            "or eddies are larger than the picture"
        )
    x, y = named.get("variance_x"), named.get("variance_y")
    if x and y and (x.low > y.high or y.low > x.high):
        found.append("x and y move by different amounts, which isotropic turbulence does not explain")
    best = whole or apart
    if best and best.value > 0:
        strong = rytov_variance(best.value, optics.distance, optics.wavelength, wave=optics.wave)
        if strong > 1:
            found.append(f"scattering is strong (Rytov variance {strong:.2g}): bright points break up")
    if correlation.time < 1.5:
        found.append("frames are as good as independent: the correlation time is below the time between them")
    if frames / correlation.squared < 20:
        found.append("few independent frames: a longer film would narrow the intervals")
    if not correlation.complete:
        found.append("displacements stay correlated throughout the film: its variance is a lower bound")
    if noise_share > 0.3:
        found.append("much of the variance is noise: larger tiles or less noise would help")
    if interval is None:
        found.append("the time between frames is not known: times are in frames (state --fps)")
    return tuple(found)
