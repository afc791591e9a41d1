"""Intervals of variances: how often they hold the truth, over frames and tiles that resemble each other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from nigemizu.measure.moments import Moments
from nigemizu.measure.statistics import correlation_of, quadratic

TILES, FRAMES, NOISE = 4, 160, 0.1


def series(seed, memory, alike):
    """Displacements (frames, tiles, 2) of variance 1 that remember, shared between tiles, and their noise."""
    rng = np.random.default_rng(seed)
    mix = np.linalg.cholesky((1 - alike) * np.eye(TILES) + alike)
    fresh = np.einsum("ij,tjk->tik", mix, rng.standard_normal((FRAMES, TILES, 2)))
    x = np.empty_like(fresh)
    x[0] = fresh[0]
    for t in range(1, FRAMES):
        x[t] = memory * x[t - 1] + np.sqrt(1 - memory**2) * fresh[t]
    return x + np.sqrt(NOISE) * rng.standard_normal(x.shape)


def gathered(values, found=None):
    moments = Moments(TILES, len(values))
    for number, value in enumerate(values):
        seen = np.ones(TILES, dtype=bool) if found is None else found[number]
        moments.take(value, np.full((TILES, 2), NOISE), seen)
    return moments


def interval(moments, correlation):
    weights = np.eye(TILES) / TILES
    return quadratic(weights, moments.covariance(0), np.full(TILES, NOISE), FRAMES, correlation)


@pytest.mark.parametrize(("memory", "alike"), [(0.0, 0.99), (0.6, 0.5), (0.8, 0.5)])
def test_intervals_hold_the_truth_as_often_as_they_say(memory, alike):
    seeds, held, careless, values = 100, 0, 0, []
    for seed in range(seeds):
        moments = gathered(series(1000 + seed, memory, alike))
        lagged = moments.autocovariance()
        correlation = correlation_of(lagged.mean((1, 2)), NOISE, FRAMES)
        one = interval(moments, correlation)
        values.append(one.value)
        held += one.low <= 1.0 <= one.high
        forgetful = interval(moments, dataclasses.replace(correlation, squared=1.0))
        careless += forgetful.low <= 1.0 <= forgetful.high
    # 95 %, with three standard deviations of a binomial law of 100; long memory costs a little
    assert 0.87 <= held / seeds <= 1.0
    assert np.mean(values) == pytest.approx(1.0, abs=3 * np.std(values) / np.sqrt(seeds) + 0.01)
    if memory >= 0.6:
        assert careless / seeds < 0.85  # frames that resemble each other, taken for independent


def test_the_correlation_time_is_found():
    times = []
    for seed in range(40):
        moments = gathered(series(seed, 0.6, 0.0))
        times.append(correlation_of(moments.autocovariance().mean((1, 2)), NOISE, FRAMES).time)
    # of 1 + 2 Σ 0.6^k = 4 the noise takes the share 0.1/1.1 of the part beyond lag 0
    assert np.mean(times) == pytest.approx(1 + 3 / 1.1, rel=0.1)


def test_moments_are_those_of_the_whole_series():
    values = series(7, 0.6, 0.5)
    found = np.random.default_rng(8).random((FRAMES, TILES)) > 0.02
    moments = gathered(values, found)
    everything = gathered(values)
    x = values[:, :, 0]
    assert everything.covariance(0) == pytest.approx(np.cov(x.T, bias=True), rel=1e-9)
    assert everything.mean == pytest.approx(values.mean(0), rel=1e-9)
    lag = 3
    direct = (values[lag:, 1, 1] * values[:-lag, 1, 1]).mean() - values[:, 1, 1].mean() ** 2
    assert everything.autocovariance()[lag, 1, 1] == pytest.approx(direct, rel=1e-9)
    seen = found[:, 0] & found[:, 2]
    assert moments.pairs[0, 2] == seen.sum()
    partly = np.cov(x[seen, 0], x[seen, 2], bias=True)[0, 1]
    assert moments.covariance(0)[0, 2] == pytest.approx(partly, rel=1e-9)


def test_the_spectrum_has_the_variance():
    values = np.random.default_rng(3).standard_normal((4096, TILES, 2))
    moments = gathered(values)
    assert moments.spectrum()[2:-2].mean() == pytest.approx(1.0, rel=0.03)
    tone = np.sin(2 * np.pi * 0.25 * np.arange(1024))[:, None, None] * np.ones((1, TILES, 2))
    power = gathered(tone).spectrum()[:, 0, 0]
    assert power.argmax() == 64
    # both signs of the frequency, in steps of 1/256 of a cycle per frame
    assert 2 * power[60:69].sum() / 256 == pytest.approx(0.5, rel=0.01)


def test_room_does_not_grow_with_the_film():
    def size(frames):
        moments = Moments(50, frames)
        return sum(one.nbytes for one in vars(moments).values() if isinstance(one, np.ndarray))

    assert size(10**6) == size(2000)
