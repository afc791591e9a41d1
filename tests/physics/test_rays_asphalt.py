"""The road mirage over asphalt: heights, ground hits and the critical angle.

Air: T = 308.168 + 6.37 exp(−10.08 h) K, the 'conventional' fit of measurements over asphalt, with
n = 1 + 7.86e-4·101/T, seen from 1.2 m. Expected numbers: two independent integrators that agree to
3e-10 m; the critical angle from Snell's law.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nigemizu import field, trace

TYPES = field.types("llvm", "double")
ARCMIN = np.pi / 180 / 60

HEIGHT_AT_500_M = {
    -2: 0.9092409349804159,
    -4: 0.6189739252595535,
    -6: 0.3336197571947891,
    -8: 0.09430189437829967,
    -10: 0.06417386919454562,
}
GROUND_HIT_M = {
    -12: 365.154000310489,
    -14: 305.37817750549135,
    -16: 264.3289758952179,
    -18: 233.49241138439015,
    -20: 209.291456283213,
}
CRITICAL_ARCMIN = 11.103074315640116


def launch(types: field.Types, arcminutes: Any) -> tuple[Any, Any]:
    angle = np.asarray(arcminutes, dtype=np.float64) * ARCMIN
    direction = np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)])
    return types.Array3f(0, 0, 1.2), types.Array3f(direction)


def wall(distance: float) -> trace.Surface:
    """The vertical plane x = distance."""

    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        t = (distance - origin.x) / direction.x
        return active & (t > 0) & (t <= length), t

    return surface


SCENE = trace.combine(wall(500.0), trace.ground_plane(0.0))


@pytest.mark.parametrize(("stepper", "height_error"), [(trace.LEAPFROG, 1e-7), (trace.SUZUKI4, 1e-8)])
def test_heights_at_the_wall_and_ground_hits(stepper: trace.Stepper, height_error: float) -> None:
    air = field.ExponentialTemperature(TYPES)
    angles = [*HEIGHT_AT_500_M, *GROUND_HIT_M]
    end = trace.march(air, *launch(TYPES, angles), step=0.1, max_steps=10_000, stepper=stepper, surface=SCENE)
    assert np.all(np.array(end.status) == trace.HIT)
    heights, distances = np.array(end.position.z), np.array(end.position.x)
    assert np.allclose(heights[:5], list(HEIGHT_AT_500_M.values()), rtol=0, atol=height_error)
    assert np.allclose(distances[5:], list(GROUND_HIT_M.values()), rtol=0, atol=1e-3)
    assert np.max(np.abs(heights[5:])) < 1e-12


def test_image_is_inverted_below_the_fold() -> None:
    """Of two rays that turn before the ground, the one seen lower ends higher at the wall."""
    air = field.ExponentialTemperature(TYPES)
    end = trace.march(
        air, *launch(TYPES, [-10.0, -11.0]), step=0.1, max_steps=10_000, surface=SCENE, details=True
    )
    heights = np.array(end.position.z)
    assert heights[1] > heights[0]  # seen lower, ends higher: the inverted image
    assert np.all(np.isfinite(np.array(end.turning_height)))


def test_chords_shared_by_steps_stay_within_the_tolerance() -> None:
    air = field.ExponentialTemperature(TYPES)
    angles = [*HEIGHT_AT_500_M, *GROUND_HIT_M]
    tolerance = 1e-5
    every = trace.march(air, *launch(TYPES, angles), step=0.1, max_steps=10_000, surface=SCENE)
    shared = trace.march(
        air,
        *launch(TYPES, angles),
        step=0.1,
        max_steps=10_000,
        surface=SCENE,
        chord_tolerance=tolerance,
        max_chord_steps=64,
    )
    across = np.abs(np.array(shared.position.z - every.position.z))[:5]
    assert np.all(across <= tolerance * 500)
    along = (
        np.abs(np.array(shared.position.x - every.position.x))[5:] * np.abs(np.array(shared.direction.z))[5:]
    )
    assert np.all(along <= tolerance * 400)
    # The chords were in fact longer than a step, and the hit lies on the chord that was reported.
    assert np.median(np.array(shared.chord_length)) > 2.0
    on_chord = shared.chord_origin + shared.chord_direction * (shared.path_length - shared.chord_start)
    assert np.max(np.abs(np.array(on_chord - shared.position))) < 1e-9


def test_critical_angle_by_bisection() -> None:
    """The flattest ray that still meets the ground is 11.103′ below the horizon (Snell)."""
    air = field.ExponentialTemperature(TYPES)
    flat, steep = 10.0, 13.0
    for _ in range(4):
        angles = np.linspace(flat, steep, 65)
        end = trace.march(
            air, *launch(TYPES, -angles), step=0.25, max_steps=20_000, surface=trace.ground_plane(0.0),
            max_distance=2000.0,
        )  # fmt: skip
        grounded = np.array(end.status) == trace.HIT
        first = int(np.argmax(grounded))
        assert grounded[first:].all()
        assert not grounded[:first].any()
        flat, steep = angles[first - 1], angles[first]
    assert abs(0.5 * (flat + steep) - CRITICAL_ARCMIN) < 1e-3


@pytest.mark.parametrize(
    ("excess_kelvin", "delta_n", "arcmin"),
    [
        (5, 4.385516411131718e-06, 10.179852265652235),
        (20, 1.6715149574464405e-05, 19.87406403608685),
        (50, 3.8187612524387404e-05, 30.03956101450159),
    ],
)
def test_vanishing_angle_over_a_hot_road(excess_kelvin: float, delta_n: float, arcmin: float) -> None:
    """Rays flatter than 2 asin √(δn/2n) turn before they reach a road `excess_kelvin` hotter than the air.

    Air at 300 K, 101 325 Pa, 550 nm (Ciddor 1996): n − 1 = 2.6734e-4 above, δn less at the road; the angle by
    Snell's law. The layer thins out over 10 cm; the angle does not depend on its shape.
    """
    n_air = 1 + 2.6734e-4
    amplitude = n_air**2 - (n_air - delta_n) ** 2
    air = field.ExponentialSquare(TYPES, n_air**2, amplitude, 0.1)
    angles = -arcmin * (1 + np.array([-1e-3, 1e-3]))
    end = trace.march(
        air, *launch(TYPES, angles), step=0.05, max_steps=20_000, surface=trace.ground_plane(0.0),
        max_distance=800.0,
    )  # fmt: skip
    assert list(np.array(end.status)) == [trace.STOPPED, trace.HIT]


def test_the_same_road_from_voxels() -> None:
    """The stretched mesh with 2 mm cells at the ground gives the same heights to 5 mm of 50 cm."""
    z = np.concatenate([[0.0], np.cumsum(0.002 * 1.03 ** np.arange(160))])
    z = z[z < 6]
    profile = 7.86e-4 * 101 / (308.168 + 6.37 * np.exp(-10.08 * z))
    data = np.broadcast_to(profile[:, None, None], (len(z), 2, 2))
    air = field.TrilinearVolume([-1, 600], [-5, 5], z, data, TYPES)
    angles = [*HEIGHT_AT_500_M, *GROUND_HIT_M]
    end = trace.march(air, *launch(TYPES, angles), step=0.1, max_steps=10_000, surface=SCENE)
    assert np.allclose(np.array(end.position.z)[:5], list(HEIGHT_AT_500_M.values()), rtol=0, atol=5e-3)
    assert np.allclose(np.array(end.position.x)[5:], list(GROUND_HIT_M.values()), rtol=0, atol=0.5)
