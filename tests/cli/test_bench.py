"""The benchmarks on sizes that take seconds: every number is there, and the table says what it is."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from nigemizu.cli.bench import BENCHMARKS, Sizes, rows, run_all, table
from nigemizu.cli.bench.fan import power_law
from nigemizu.cli.bench.heat import measure_convection
from nigemizu.cli.bench.memory import synthetic_air
from nigemizu.cli.bench.pictures import fluctuating_road
from nigemizu.cli.bench.rays import Voxels, by_hand, flat_rays
from nigemizu.cli.bench.superior import EARTH_RADIUS, inversion
from nigemizu.cli.bench.table import _convection
from nigemizu.cli.bench.timing import alternate, exponent
from nigemizu.field import types

Results = dict[str, Any]

TINY = Sizes(
    picture=(96, 54),
    samples=1,
    road_picture=(96, 54),
    road_samples=1,
    road=(32, 16, 24),
    march=Voxels((16, 16, 32)),
    rays=256,
    steps=16,
    far=(32, 20),
    panes=512,
    by_scipy=2,
    heat=(16, 16, 24),
    convection=(8, 8, 16),
    film=(32, 18),
    frames=1,
    growth=(24, 14),
    growth_samples=1,
    growth_road_picture=(24, 14),
    growth_road=(16, 8, 24),
    memory=(16, 16, 16),
    often=1,
    seldom=1,
    changes={
        "grid.cells": [8, 4, 24],
        "initial.unevenness": [],
        "time.duration": 10.0,
        "film.start": 0.0,
        "film.duration": 1.0,
        "objects": [{"kind": "ground"}],
    },
)


@pytest.fixture(scope="module")
def results() -> Results:
    return run_all(TINY, quiet=True)


@pytest.fixture
def copied(results: Results) -> Results:
    copy: Results = json.loads(json.dumps(results))
    return copy


def _numbers(found: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Every number in nested results, with the key that holds it."""
    if isinstance(found, dict):
        for key, value in found.items():
            yield from _numbers(value, key)
    elif isinstance(found, list):
        for value in found:
            yield from _numbers(value, name)
    elif isinstance(found, int | float) and not isinstance(found, bool):
        yield name, found


def test_every_benchmark_is_there(results: Results) -> None:
    assert list(results) == ["machine", *BENCHMARKS, "seconds"]
    assert set(results["pyramid"]) == set(results["road"])
    assert results["road"]["nodes"] == [32, 16, 24]
    assert set(results["growth"]) == {"pixels", "samples", "cells", "path_length"}
    assert {"mitsuba", "drjit", "numpy", "scipy"} <= set(results["machine"]["packages"])


def test_every_number_is_finite_and_what_must_be_positive_is(results: Results) -> None:
    found = list(_numbers(results))
    assert len(found) > 60
    assert [name for name, value in found if not math.isfinite(value)] == []
    # differences of two measurements may have either sign
    signed = {*results["growth"], "volumes", "base_bytes", "order"}
    assert [name for name, value in found if name not in signed and not value > 0] == []


def test_ratios_are_those_of_the_times_beside_them(results: Results) -> None:
    for name in ("pyramid", "road"):
        picture = results[name]
        for method in ("bent", "straight", "bent_alike", "straight_alike"):
            ratio = picture[f"{method}_seconds"] / picture["stock_seconds"]
            assert picture[f"{method}_over_stock"] == pytest.approx(ratio)
    rays = results["ray_by_ray"]
    assert rays["scipy_over_bent"] == pytest.approx(
        rays["scipy_seconds_per_ray"] / rays["bent_seconds_per_ray"]
    )
    march = results["march"]
    assert march["stretched_over_by_hand"] == pytest.approx(march["stretched"] / march["by_hand"])


def test_the_methods_are_compared_at_errors_that_they_keep(results: Results) -> None:
    panes = results["panes"]
    assert panes["bent_error_pixels"] < panes["equal_error_pixels"] == 0.1
    assert results["ray_by_ray"]["scipy_error_pixels"] <= 0.1
    errors = list(panes["errors_pixels"].values())
    assert list(panes["errors_pixels"]) == ["64", "128", "256", "512"]
    assert errors[0] > 2 * errors[-1]


def test_the_far_view_is_as_exact_as_it_says(results: Results) -> None:
    far = results["stratified"]
    assert far["table_seconds"] < far["seconds"]
    assert far["paths"] < 10 * TINY.far[1] + 1000  # for all columns of pixels together
    assert far["compared"] > 10
    assert far["error_pixels"] < far["accuracy_pixels"] == 0.1


def test_json_is_valid_and_holds_everything(results: Results) -> None:
    assert json.loads(json.dumps(results, allow_nan=False)) == results


def test_the_table_prints_every_row(results: Results) -> None:
    text = table(results)
    lines = text.splitlines()
    for row in rows(results):
        mine = [
            line for line in lines if line.startswith(row.what) and line.endswith(row.ratio or row.figure)
        ]
        assert any(row.figure in line for line in mine), row
    assert lines[0].startswith(f"{results['machine']['cores']} cores of ")
    assert results["machine"]["llvm"] in lines[1]
    named = (
        "pyramid",
        "road",
        "march",
        "stratified",
        "panes",
        "DOP853",
        "heat",
        "convection",
        "film",
        "memory",
        "grows",
    )
    assert [word for word in named if word not in text] == []


@pytest.mark.parametrize("extrapolated", [True, False])
def test_what_is_extrapolated_says_so(copied: Results, extrapolated: bool) -> None:
    copied["panes"]["extrapolated"] = extrapolated
    shown = [f"{row.what} {row.figure} {row.ratio}" for row in rows(copied)]
    said = [line for line in shown if "extrapolated" in line]
    assert len(said) == (2 if extrapolated else 0)
    assert all("panes" in line or "their time" in line for line in said)


def test_what_was_not_measured_says_so(copied: Results) -> None:
    copied["panes"].update(panes=None, panes_seconds=None, panes_over_bent=None)
    copied["memory"].update(peak_bytes=None, volumes=None, base_bytes=None)
    copied["pyramid"]["report"] = None
    text = table(copied)
    assert all(word in text for word in ("none reach it", "not counted by this system", "not reported"))


def test_what_a_picture_tells_is_shown(copied: Results) -> None:
    copied["road"]["report"] = {
        "steps_per_ray": 12.34,
        "queries_per_ray": 3.21,
        "worst_error_pixels": 0.098,
        "mean_error_pixels": 0.0123,
    }
    figures = [row.figure for row in rows(copied)]
    assert {"12.3", "3.21", "0.012 (worst 0.098) pixel"} <= set(figures)


def test_bench_prints_the_table_or_json(
    run: Callable[..., Any], results: Results, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nigemizu.cli.bench.run_all", lambda: results)
    done = run("bench", "--json")
    assert (done.code, done.err, json.loads(done.out)) == (0, "", results)
    done = run("bench")
    assert (done.code, done.err, done.out) == (0, "", f"{table(results)}\n")


def test_contestants_take_turns_and_the_first_round_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    now, calls = [0.0], []
    monkeypatch.setattr("nigemizu.cli.bench.timing.time.perf_counter", lambda: now[0])
    taken = {"one": iter([50.0, 1.0, 9.0, 2.0]), "other": iter([70.0, 4.0, 4.0, 100.0])}

    def work(name: str) -> Callable[[], None]:
        def spend() -> None:
            calls.append(name)
            now[0] += next(taken[name])

        return spend

    assert alternate({name: work(name) for name in taken}, 3) == {"one": 2.0, "other": 4.0}
    assert calls == ["one", "other"] * 4


@pytest.mark.parametrize(("power", "wanted"), [(0.5, 1e-3), (0.5, 0.3), (2.0, 1e-7), (1.0, 1.0)])
def test_power_law_is_followed_and_continued(power: float, wanted: float) -> None:
    counts = [2**k for k in range(4, 12)]
    errors = [8.0 * count**-power for count in counts]
    count, order = power_law(counts, errors, wanted)
    assert order == pytest.approx(power)
    assert count == pytest.approx(max(16.0, (8.0 / wanted) ** (1 / power)))


def test_errors_that_do_not_fall_are_never_small_enough() -> None:
    assert power_law([16, 32, 64], [1.0, 1.0, 2.0], 0.1)[0] == math.inf


def test_growth_of_a_power() -> None:
    assert exponent(3.0, 3.0 * 4**1.5, 4.0) == pytest.approx(1.5)


def test_fluctuations_have_the_size_and_length_that_are_promised() -> None:
    """0.5 K root mean square, correlated as exp(−d²/4) at d cells."""
    scene = TINY.scene("road", (32, 18), 1)
    one, again, other = (fluctuating_road(scene, (48, 40, 32), seed) for seed in (3, 3, 4))
    assert np.array_equal(one.refractivity, again.refractivity)
    assert not np.allclose(one.refractivity, other.refractivity, rtol=0, atol=1e-9)
    assert one.refractivity.shape == (32, 40, 48)
    deviation = one.refractivity - one.refractivity.mean(axis=(1, 2), keepdims=True)
    # dn/dT = −(n − 1)/T to within the humidity
    per_kelvin = -one.refractivity.mean(axis=(1, 2)) / one.temperature
    fluctuation = deviation / per_kelvin[:, None, None]
    assert fluctuation.std() == pytest.approx(0.5, rel=0.05)
    for distance in (1, 2):
        for axis in range(3):
            moved = np.roll(fluctuation, distance, axis)
            correlation = float(np.mean(fluctuation * moved) / fluctuation.var())
            assert correlation == pytest.approx(math.exp(-(distance**2) / 4), abs=0.06)


def test_air_over_the_round_earth_is_made_flat() -> None:
    """n' = n exp(z/R): without any air the index would grow by z/R."""
    z, refractivity = inversion()
    air = (1.0 + refractivity) * np.exp(-z / EARTH_RADIUS) - 1.0
    assert np.all((air > 2.5e-4) & (air < 3.0e-4))
    slope = np.gradient(refractivity, z)
    # far below and above the inversion light falls behind the curve of the Earth; in it, it overtakes
    assert slope[0] > 0 > slope.min()
    assert slope[-1] > 0


def test_the_loop_by_hand_follows_the_same_rays() -> None:
    from nigemizu import field, trace

    shape, types = Voxels((16, 12, 32)), field.types("llvm")
    z = shape.even_heights
    volume = field.TrilinearVolume(*shape.horizontal, z, shape.air(z), types)
    origin, direction = flat_rays(types, 100)
    marched = trace.march(volume, origin, direction, step=1.0, max_steps=200).position
    voxels = types.Float(shape.air(z).astype(np.float32).ravel())
    walked = by_hand(types, voxels, shape, origin, direction, 200)
    straight = np.array(types.Array3f(origin) + direction * 200.0)
    bend = np.abs(np.array(marched) - straight)[2].max()
    assert bend > 0.01  # m
    assert np.abs(np.array(walked) - np.array(marched))[2].max() < 0.01 * bend


def test_air_whose_memory_is_measured_is_no_larger_than_it_must_be() -> None:
    air = synthetic_air((12, 10, 8))
    assert air.refractivity.shape == (8, 10, 12)
    assert air.refractivity.flags.owndata
    assert air.refractivity.std(axis=(1, 2)) == pytest.approx(1e-8, rel=0.3)
    assert np.all(np.diff(air.refractivity.mean(axis=(1, 2)))[:4] > 0)


def test_a_card_is_measured_beside_the_processor() -> None:
    found = measure_convection((8, 8, 16), steps=1, card=types("llvm", "double"))
    assert found["card_updates_per_second"] > 0
    said = _convection(found).ratio
    assert f"{found['card_updates_per_second'] / found['cell_updates_per_second']:.1f} × on the card" in said
    assert "card" not in _convection(measure_convection((8, 8, 16), steps=1)).ratio
