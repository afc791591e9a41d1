"""Rays through layered air, layer by layer, against closed forms and against the march."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from nigemizu import field, trace
from nigemizu.errors import InputError
from nigemizu.trace.columns import column_rays

FloatArray = NDArray[np.float64]

R = 6371e3


def linear(z: FloatArray, rate: float = 2e-7) -> FloatArray:
    """n′ with n′² = 1 + rate z."""
    return np.sqrt(1 + rate * z)


def test_linear_air_is_exact() -> None:
    """n′² = 1 + a z: x = 2p (q − q₀)/a, whatever the layers; a ray turns at q₀²/a below the eye."""
    rate, top, eye = 2e-7, 1000.0, 120.0
    z = np.unique(np.concatenate([np.random.default_rng(1).uniform(0, top, 40), [0.0, top]]))
    angle = np.array([-0.004, -1e-3, 0.0, 1e-3, 0.3])
    rays = column_rays(
        z, linear(z), eye=eye, elevation=angle, radius=math.inf, coefficients=[np.full(len(z), 1.0)]
    )
    n0 = 1 + rate * eye
    p, q0 = np.sqrt(n0) * np.cos(angle), np.sqrt(n0) * np.sin(angle)
    q1 = np.sqrt(q0**2 + rate * (top - eye))
    np.testing.assert_allclose(rays.distance[0], 2 * p * (q1 - q0) / rate, rtol=1e-9)
    np.testing.assert_allclose(rays.elevation[0], np.arctan2(q1, p), rtol=1e-9)
    np.testing.assert_array_equal(rays.true_elevation, rays.elevation)
    np.testing.assert_allclose(rays.lowest[0], np.where(angle < 0, eye - q0**2 / rate, eye), atol=1e-5)
    assert rays.escaped.all()
    assert not rays.grounded.any()


def test_ground_and_length() -> None:
    """Without air: straight lines, their lengths and where they meet the ground."""
    z = np.linspace(0, 500.0, 11)
    angle = np.array([-np.pi / 2, -0.5, -0.01, 0.01, np.pi / 2])
    rays = column_rays(
        z, np.ones(11), eye=30.0, elevation=angle, radius=math.inf, coefficients=[np.ones(11), 2 + z]
    )
    ways = np.where(angle < 0, 30.0, 470.0) / np.abs(np.sin(angle))
    np.testing.assert_array_equal(rays.grounded[0], angle < 0)
    assert rays.depth.shape == (2, 5)
    np.testing.assert_allclose(rays.depth[0], ways, rtol=1e-12)
    np.testing.assert_allclose(rays.depth[1], ways * (2 + np.where(angle < 0, 15.0, 265.0)), rtol=1e-12)
    np.testing.assert_allclose(rays.distance[0], ways * np.cos(angle), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(rays.elevation[0], angle, rtol=1e-12)
    assert np.isnan(rays.true_elevation[0, :3]).all()
    np.testing.assert_array_equal(rays.lowest[0, :3], 0.0)


def test_straight_lines_over_a_round_earth() -> None:
    """Without air over a sphere: the true elevation is the apparent one, and lengths are chords."""
    z = np.linspace(0, R * math.log1p(80e3 / R), 20001)
    angle = np.array([-0.01, 0.0, 0.02, 1.0])
    eye_height = 2e3
    eye = R * math.log1p(eye_height / R)
    rays = column_rays(
        z, np.exp(z / R), eye=eye, elevation=angle, radius=R, coefficients=np.ones((1, len(z)))
    )
    r0, r1 = R + eye_height, R + 80e3
    chord = np.sqrt(r1**2 - (r0 * np.cos(angle)) ** 2) - r0 * np.sin(angle)
    assert rays.escaped.all()
    np.testing.assert_allclose(rays.depth[0], chord, rtol=1e-7)
    np.testing.assert_allclose(rays.true_elevation[0], angle, atol=2e-8)
    np.testing.assert_allclose(rays.lowest[0, 0], R * math.log(r0 * math.cos(0.01) / R), atol=1e-2)
    # negative control: one that forgets the Earth's turn under the ray
    assert np.abs(rays.elevation[0] - angle).max() > 0.1


@pytest.mark.parametrize(("angles", "order"), [((0.001, 0.02), 2.0), ((-0.017, -0.005), 1.5)])
def test_order(angles: tuple[float, float], order: float) -> None:
    """n′² = A + C e^(−z/h), C < 0: ∫dz/q = h/√a ln((√a + q)/(√a − q)) with a = A − p², q < √a.

    Where a ray turns, q² is off by O(Δz²) over a layer in which q is O(√Δz): order 3/2, scattered by where in
    its layer the turn lies, and so for the root mean square over many rays.
    """
    scale, lift, eye, top = 40.0, -5.0e-4, 60.0, 300.0
    angle = np.linspace(*angles, 60)

    def square(height: FloatArray | float) -> FloatArray:
        return np.asarray(1 + lift * np.exp(-np.asarray(height) / scale))

    p = np.sqrt(square(eye)) * np.cos(angle)

    def integral(height: float) -> FloatArray:
        a, q = np.sqrt(1 - p * p), np.sqrt(np.maximum(square(height) - p * p, 0.0))
        return np.asarray(scale / a * np.log((a + q) / (a - q)))

    exact = p * (integral(top) - integral(eye)) + np.where(angle < 0, 2 * p * integral(eye), 0.0)
    errors = []
    for count in (200, 400, 800, 1600):
        z = np.linspace(0, top, count + 1)
        rays = column_rays(z, np.sqrt(square(z)), eye=eye, elevation=angle, radius=math.inf)
        assert rays.escaped.all()
        errors.append(float(np.sqrt(np.mean((rays.distance[0] / exact - 1) ** 2))))
    slopes = [math.log2(a / b) for a, b in pairwise(errors)]
    assert errors[-1] < 1e-4
    assert abs(sum(slopes) / len(slopes) - order) < 0.2, slopes


def test_a_duct_keeps_its_rays() -> None:
    """n′ falls between 50 m and 80 m: level rays inside it neither leave nor land; those from below land."""
    z = np.array([0.0, 50.0, 80.0, 1000.0])
    index = 1 + 1e-6 * np.array([3.0, 8.0, 2.0, 140.0])
    rays = column_rays(z, index, eye=50.0, elevation=[-1e-3, 0.0, 1e-3, 0.01], radius=R)
    np.testing.assert_array_equal(rays.escaped[0], [False, False, False, True])
    np.testing.assert_array_equal(rays.grounded[0], [False] * 4)
    assert np.isnan(rays.distance[0, :3]).all()
    low = column_rays(
        z, index, eye=30.0, elevation=[2.65e-3, -5e-3, 1e-2], radius=R, coefficients=np.ones((1, 4))
    )
    np.testing.assert_array_equal(low.grounded[0], [True, True, False])
    assert low.distance[0, 0] > low.distance[0, 1]  # first up, under the lid, and then down
    # both branches of a parabola, closed: up to 50 m with one slope, to the lid with another, and back
    assert low.depth[0, 0] == pytest.approx(low.distance[0, 0], rel=1e-4)
    assert low.elevation[0, 0] == pytest.approx(-math.sqrt(2.65e-3**2 - 2 * 3e-6), rel=1e-3)


def test_agrees_with_the_march() -> None:
    """The engine of the renderer, in double, on the same column of air."""
    z = np.concatenate([[0.0], np.cumsum(np.geomspace(0.05, 12.0, 400))])
    bare = 2.7e-4 * np.exp(-z / 8e3) - 1.2e-5 * np.exp(-z / 3.0)
    index = (1 + bare) * np.exp(z / R)
    angle = np.array([-2.0e-3, -1e-3, 0.0, 5e-3])
    rays = column_rays(z, index, eye=5.0, elevation=angle, radius=R)
    types = field.types("llvm", "double")
    air = field.StratifiedVolume(
        [0, 1.5e5, 3e5], [-1e3, 0, 1e3], z, np.broadcast_to((index - 1)[:, None, None], (len(z), 3, 3)), types
    )
    end = trace.march(
        air,
        types.Array3f(1e-3, 0, 5.0),
        types.Array3f(np.array([np.cos(angle), 0 * angle, np.sin(angle)])),
        step=2.0,
        max_steps=200_000,
        surface=trace.ground_plane(0),
        details=True,
    )
    x, way = np.array(end.position)[0], np.array(end.direction)
    assert rays.grounded[0].tolist() == [status == trace.HIT for status in np.array(end.status)]
    np.testing.assert_allclose(rays.distance[0], x, rtol=2e-4)
    np.testing.assert_allclose(rays.elevation[0], np.arctan2(way[2], way[0]), atol=2e-7)


def growing(count: int, top: float) -> FloatArray:
    """Heights [m] of layers that grow two hundredfold from the ground to the top."""
    steps = np.cumsum(np.geomspace(1, 200, count))
    return np.asarray(np.concatenate([[0.0], steps]) * (top / steps[-1]))


def test_horizontal_refraction_of_exponential_air() -> None:
    """n = 1 + 2.9e-4 e^(−h/8 km): 2354.1230″ at the horizon, by the integral of Auer and Standish."""

    def air(height: FloatArray) -> tuple[FloatArray, FloatArray]:
        excess = 2.9e-4 * np.exp(-height / 8e3)
        return excess, -excess / 8e3

    h = growing(2000, 120e3)
    z = R * np.log1p(h / R)
    angle, second = np.array([0.0, 0.02, 0.5]), math.radians(1 / 3600)
    rays = column_rays(z, (1 + air(h)[0]) * np.exp(z / R), eye=0.0, elevation=angle, radius=R)
    lifted = (angle - rays.true_elevation[0]) / second
    integral = trace.astronomical_refraction(air, angle, radius=R, top=120e3) / second
    assert integral[0] == pytest.approx(2354.1230, abs=1e-3)
    np.testing.assert_allclose(lifted, integral, rtol=0, atol=5e-3)
    # negative control: a hundredth less air is far outside
    less = column_rays(z, (1 + 0.99 * air(h)[0]) * np.exp(z / R), eye=0.0, elevation=[0.0], radius=R)
    assert lifted[0] + less.true_elevation[0, 0] / second > 20


def test_air_mass_of_chapman() -> None:
    """Columns along straight lines through e^(−h/8 km), over that to the zenith.

    Chapman's grazing-incidence function for R/H = 796.375, by adaptive quadrature along the line itself.
    """
    h = growing(2000, 400e3)
    z = R * np.log1p(h / R)
    rays = column_rays(
        z,
        np.exp(z / R),
        eye=0.0,
        elevation=np.radians([30.0, 10.0, 5.0, 0.0]),
        radius=R,
        coefficients=[np.exp(-h / 8e3) / 8e3],
    )
    exact = [1.992576764804709, 5.5505200396358685, 10.140026354817039, 35.385319517709895]
    np.testing.assert_allclose(rays.depth[0], exact, rtol=3e-6)


def test_wavelengths_and_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    from nigemizu.trace import columns

    z = np.linspace(0, 50e3, 300)
    index = (1 + np.array([[2.7e-4], [2.9e-4]]) * np.exp(-z / 8e3)) * np.exp(z / R)
    beta = np.stack([np.exp(-z / 8e3) * np.array([[1e-5], [2e-5]]), np.ones((2, 300))])
    angle = np.linspace(-0.02, 1.0, 37)
    call = {"eye": 100.0, "elevation": angle, "radius": R, "coefficients": beta}
    whole = column_rays(z, index, **call)
    monkeypatch.setattr(columns, "_AT_ONCE", 3000)
    parts = column_rays(z, index, **call)
    assert whole.depth.shape == (2, 2, 37)
    for name in ("distance", "true_elevation", "depth", "escaped"):
        np.testing.assert_allclose(getattr(whole, name), getattr(parts, name), rtol=1e-12)
    alone = column_rays(z, index[1], **{**call, "coefficients": beta[:, 1:]})
    np.testing.assert_allclose(alone.depth[:, 0], whole.depth[:, 1], rtol=1e-12)
    # one index for all wavelengths
    shared = column_rays(z, index[0], **call)
    assert shared.distance.shape == (1, 37)
    assert shared.depth.shape == (2, 2, 37)
    np.testing.assert_allclose(shared.depth[:, 0], whole.depth[:, 0], rtol=1e-12)
    assert np.nanmax(np.abs(whole.true_elevation[0] - whole.true_elevation[1])) > 1e-4


@pytest.mark.parametrize(
    "change",
    [
        {"z": [0.0, 2.0, 1.0]},
        {"index": [[1.0, 1.0]]},
        {"index": [[1.0, np.nan, 1.0]]},
        {"eye": -1.0},
        {"elevation": [90.0]},
        {"elevation": [np.nan]},
        {"coefficients": [1.0, 2.0, 3.0]},
    ],
)
def test_what_is_refused(change: dict) -> None:
    good = {"z": [0.0, 1.0, 2.0], "index": [[1.0, 1.0, 1.0]], "eye": 1.0, "elevation": [0.1], "radius": R}
    given = good | change
    with pytest.raises(InputError):
        column_rays(given.pop("z"), given.pop("index"), **given)
