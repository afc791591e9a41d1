"""Panes of constant index: Snell's law, total reflection, waviness, and the straight baseline."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nigemizu import field, trace
from nigemizu.errors import InputError

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")


def falling(types: field.Types, angles: Any) -> Any:
    """Directions that fall by angles [rad] below the horizon, along a line that is not an axis."""
    angle = np.atleast_1d(np.asarray(angles, dtype=np.float64))
    across = np.cos(angle)
    return types.Array3f(np.array([0.8 * across, 0.6 * across, -np.sin(angle)]))


@pytest.mark.parametrize(("types", "tolerance"), [(SINGLE, 3e-7), (DOUBLE, 1e-14)], ids=["single", "double"])
def test_snells_law_at_one_boundary(types: field.Types, tolerance: float) -> None:
    """From air into glass and out: sin of the angles to the normal in the ratio of the indices."""
    layers = field.Layers([0.0], [0.5, 0.0], types)
    angles = np.deg2rad([80.0, 45.0, 20.0, 1.0])
    end = trace.cross_layers(layers, types.Array3f(0, 0, 1), falling(types, angles), max_crossings=5)
    expected = np.cos(angles) / 1.5
    got = np.array(end.direction)
    assert np.allclose(np.hypot(got[0], got[1]), expected, rtol=0, atol=tolerance)
    assert np.allclose(got[1] / got[0], 0.75, rtol=0, atol=1e-6)  # stays in its plane
    assert np.all(got[2] < 0)
    back = trace.cross_layers(layers, types.Array3f(0, 0, -1), -end.direction, max_crossings=5)
    assert np.allclose(
        -np.array(back.direction), np.array(falling(types, angles)), rtol=0, atol=4 * tolerance
    )


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_total_reflection_begins_at_the_critical_angle(types: field.Types) -> None:
    """cos α = n_below/n_above: 1e-4 flatter is reflected, 1e-4 steeper is not, over an index step of 1e-5."""
    n_above, n_below = 1.00027, 1.00026
    critical = np.arccos(n_below / n_above)
    layers = field.Layers([0.0], [n_below - 1, n_above - 1], types)
    angles = critical * np.array([1 - 1e-4, 1 + 1e-4])
    end = trace.cross_layers(
        layers, types.Array3f(0, 0, 1), falling(types, angles), max_crossings=5, details=True
    )
    rise = np.array(end.direction.z)
    assert rise[0] > 0 > rise[1]
    assert abs(rise[0] / np.sin(angles[0]) - 1) < 1e-5  # as steep as it came
    assert np.array(end.turning_height)[0] == 0
    assert np.isnan(np.array(end.turning_height)[1])
    assert list(end.steps) == [1, 1]


def test_many_panes_keep_snells_invariant() -> None:
    layers = field.Layers.from_profile(
        np.linspace(0, 2, 101), 2.7e-4 - 2e-5 * np.exp(-np.linspace(0, 2, 101) / 0.1), 50, DOUBLE
    )
    angles = np.array([0.003, 0.005, 0.0062, 0.008])
    end = trace.cross_layers(layers, DOUBLE.Array3f(0, 0, 1.5), falling(DOUBLE, angles), max_crossings=500)
    start = np.array(layers.index(layers.pane_at(DOUBLE.Float(1.5))))
    last = np.array(layers.index(layers.pane_at(end.position.z + end.direction.z)))
    direction = np.array(end.direction)
    across = np.hypot(direction[0], direction[1])
    assert np.allclose(across * last, np.cos(angles) * start, rtol=0, atol=1e-13)
    assert list(direction[2] > 0) == [True, True, True, False]


def test_surfaces_are_met_between_panes() -> None:
    layers = field.Layers([0.2, 0.5, 0.8], [2.4e-4, 2.5e-4, 2.6e-4, 2.7e-4], DOUBLE)
    ahead = falling(DOUBLE, [0.1, 0.1, -0.1])
    for height in (0.35, -2.0):
        end = trace.cross_layers(
            layers,
            DOUBLE.Array3f(0, 0, 1),
            ahead,
            max_crossings=50,
            surface=trace.ground_plane(height),
            details=True,
        )
        assert list(np.array(end.status)) == [trace.HIT, trace.HIT, trace.ESCAPED]
        assert np.allclose(np.array(end.position.z)[:2], height, rtol=0, atol=1e-12)
        on_chord = end.chord_origin + end.chord_direction * (end.path_length - end.chord_start)
        assert np.max(np.abs(np.array(on_chord - end.position))) < 1e-12
    assert np.allclose(np.array(end.path_length)[:2], 3 / np.sin(0.1), rtol=1e-2)
    ratio = np.array(end.optical_path / end.path_length)[0]
    assert 1.00024 < ratio < 1.00027


def test_crossings_run_out_and_distance_ends() -> None:
    layers = field.Layers(np.linspace(0, 1, 11), np.linspace(2.6e-4, 2.7e-4, 12), DOUBLE)
    start, ahead = DOUBLE.Array3f(0, 0, 1.05), falling(DOUBLE, 0.1)
    assert trace.cross_layers(layers, start, ahead, max_crossings=4).status[0] == trace.OUT_OF_STEPS
    end = trace.cross_layers(layers, start, ahead, max_crossings=100, max_distance=3.0)
    assert end.status[0] == trace.STOPPED
    assert abs(float(end.path_length[0]) - 3) < 1e-12
    masked = trace.cross_layers(layers, start, ahead, max_crossings=9, active=DOUBLE.Bool(False))
    assert masked.status[0] == trace.NOT_TRACED


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_wavy_rays_stay_in_the_pane_that_they_are_said_to_be_in(types: field.Types) -> None:
    """Waves throw grazing rays either way: every ray still ends, at unit length, on its side."""
    heights = np.linspace(0, 2, 201)
    layers = field.Layers.from_profile(
        heights, 2.7e-4 - 2e-5 * np.exp(-heights / 0.1), 30, types,
        waviness_amplitude=0.002, waviness_length=3.0, waviness_seed=4,
    )  # fmt: skip
    angles = np.linspace(-0.002, 0.02, 2000)
    end = trace.cross_layers(
        layers, types.Array3f(0, 0, 1.5), falling(types, angles), max_crossings=2000,
        surface=trace.ground_plane(0.0), max_distance=5000.0,
    )  # fmt: skip
    got, z = np.array(end.status), np.array(end.position.z)
    assert set(got) == {trace.HIT, trace.STOPPED}
    assert np.all(np.abs(z[got == trace.HIT]) < 1e-6)
    assert np.all(z[got == trace.STOPPED] > 0)
    assert np.allclose(np.linalg.norm(np.array(end.direction), axis=0), 1, atol=1e-6)


def test_waves_are_reproducible_and_drift() -> None:
    def normals(**waves: Any) -> np.ndarray:
        layers = field.Layers([0.0, 1.0], [1e-4, 2e-4, 3e-4], DOUBLE, **waves)
        points = np.random.default_rng(1).uniform(-500, 500, (3, 40_000))
        return np.array(layers.normal(DOUBLE.UInt32(0), DOUBLE.Array3f(points)))

    waves: dict[str, Any] = {"waviness_amplitude": 0.01, "waviness_length": 2.0}
    one = normals(**waves, waviness_seed=1)
    assert np.array_equal(one, normals(**waves, waviness_seed=1))
    assert not np.allclose(one, normals(**waves, waviness_seed=2))
    assert np.allclose(np.linalg.norm(one, axis=0), 1)
    # rms slope: amplitude × rms wave number; wavelengths between half and twice 2 m
    slope = np.sqrt(np.mean((one[:2] / one[2]) ** 2 * 2))
    assert 2 * np.pi * 0.01 / 4 < slope < 2 * np.pi * 0.01 / 1
    # Carried by (3, −1) m, the waves are where they were, as seen by one who is carried too.
    points = np.random.default_rng(2).uniform(-5, 5, (3, 100))
    still = field.Layers([0.0], [0, 1e-4], DOUBLE, **waves)
    carried = field.Layers([0.0], [0, 1e-4], DOUBLE, **waves, waviness_drift=(3.0, -1.0))
    there = points + np.array([[3.0], [-1.0], [0.0]])
    zero = DOUBLE.UInt32(0)
    assert np.allclose(
        np.array(still.normal(zero, DOUBLE.Array3f(points))),
        np.array(carried.normal(zero, DOUBLE.Array3f(there))),
    )


def test_panes_of_a_profile() -> None:
    z = np.linspace(0, 1, 1001)
    layers = field.Layers.from_profile(z, 1e-4 * z**2, 4, DOUBLE, spacing="equal-index")
    bounds = np.array(layers.boundary_height(DOUBLE.UInt32([0, 1, 2])))
    assert np.allclose(bounds, np.sqrt([0.25, 0.5, 0.75]), rtol=0, atol=1e-5)
    indices = np.array(layers.index(DOUBLE.UInt32([0, 1, 2, 3])))
    assert np.allclose(indices - 1, 1e-4 * np.array([0.125, 0.375, 0.625, 0.875]), rtol=0, atol=1e-9)
    heights = DOUBLE.Float([-5.0, 0.5, 0.6, 0.8, 0.9, 5.0])
    assert list(layers.pane_at(heights)) == [0, 1, 1, 2, 3, 3]
    even = field.Layers.from_profile(z, 1e-4 * z**2, 4, DOUBLE, spacing="equal-height")
    assert np.allclose(np.array(even.boundary_height(DOUBLE.UInt32([0, 1, 2]))), [0.25, 0.5, 0.75])
    still = field.Layers.from_profile(z, 0 * z + 1e-4, 5, DOUBLE)
    assert np.all(np.diff(np.array(still.boundary_height(DOUBLE.UInt32([0, 1, 2, 3])))) > 0.1)


@pytest.mark.parametrize(
    ("boundaries", "panes"),
    [([0.0, 1.0], [1e-4, 2e-4]), ([1.0, 0.0], [0, 0, 0]), ([0.0], [0, np.nan]), ([], [0])],
)
def test_bad_panes_are_refused(boundaries: list[float], panes: list[float]) -> None:
    with pytest.raises(InputError):
        field.Layers(boundaries, panes, DOUBLE)


def test_straight_rays() -> None:
    ahead = falling(DOUBLE, [0.01, -0.01])
    end = trace.straight(DOUBLE, DOUBLE.Array3f(0, 0, 1), ahead, surface=trace.ground_plane(0), details=True)
    assert list(np.array(end.status)) == [trace.HIT, trace.ESCAPED]
    assert abs(float(end.path_length[0]) - 1 / np.sin(0.01)) < 1e-10
    assert abs(float(end.position.z[0])) < 1e-12
    stopped = trace.straight(DOUBLE, DOUBLE.Array3f(0, 0, 1), ahead, max_distance=10.0)
    assert set(np.array(stopped.status)) == {trace.STOPPED}
    assert np.allclose(np.array(stopped.position.z), 1 + np.array([-10, 10]) * np.sin(0.01))


def test_nearer_of_two_surfaces_counts() -> None:
    both = trace.combine(trace.ground_plane(0.0), trace.ground_plane(0.5))
    other = trace.combine(trace.ground_plane(0.5), trace.ground_plane(0.0))
    for surface in (both, other):
        end = trace.straight(DOUBLE, DOUBLE.Array3f(0, 0, 1), falling(DOUBLE, 0.3), surface=surface)
        assert abs(float(end.position.z[0]) - 0.5) < 1e-12
