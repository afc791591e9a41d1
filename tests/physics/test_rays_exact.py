"""Rays through fields in closed form, against the exact rays.

Every number stands beside the closed form that it comes from. The integration runs in double precision with
the fourth-order stepper, in the parameter σ (ds = n dσ), for which most of the closed forms are written.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nigemizu import field, trace

TYPES = field.types("llvm", "double")


@dr.syntax
def _loop(stepper: Any, air: Any, x: Any, p: Any, sigma: Any, steps: Any) -> Any:
    k, optical = type(steps)(0), type(sigma)(0)
    while dr.hint(k < steps, exclude=[stepper]):
        after = stepper.advance(air, x, p, sigma)
        x, p = after.position, after.momentum
        optical += after.optical_path
        k += 1
    return x, p, optical


def follow(air: field.Field, origin: Any, angles: Any, sigma: float, steps: int, plane: str = "xz") -> Any:
    """Position, momentum (columns) and optical path after σ, launched at `angles` in a plane."""
    angles = np.atleast_1d(angles).astype(np.float64)
    rise = np.sin(angles)
    still = np.zeros_like(angles)
    columns = [np.cos(angles), rise, still] if plane == "xy" else [np.cos(angles), still, rise]
    start = np.broadcast_to(np.asarray(origin, dtype=np.float64)[:, None], (3, len(angles)))
    x = TYPES.Array3f(np.ascontiguousarray(start))
    n, _ = air.value_and_gradient(x)
    p = TYPES.Array3f(np.array(columns)) * n
    x, p, optical = _loop(
        trace.SUZUKI4, air, x, TYPES.Array3f(p), TYPES.Float(sigma / steps), TYPES.UInt32(steps)
    )
    return np.array(x), np.array(p), np.array(optical)


def test_parabola_in_a_linear_square() -> None:
    """n² = 2.25 − z/2, launched at 45° from 0: z = x − x²/9, apex 2.25 at x = 4.5 (closed form)."""
    air = field.LinearSquare(TYPES, 2.25, -0.5)
    p_x = 1.5 * np.cos(np.pi / 4)
    x, p, optical = follow(air, [0, 0, 0], np.pi / 4, 3 / p_x, 60)
    assert abs(x[2, 0] - 2.0) < 1e-12
    assert abs(x[0, 0] - 3.0) < 1e-12
    assert abs(np.arctan2(p[2, 0], p[0, 0]) - 0.3217505543966422) < 1e-12
    assert abs(optical[0] - 4.714045207910317) < 1e-12
    x, p, _ = follow(air, [0, 0, 0], np.pi / 4, 4.5 / p_x, 60)
    assert abs(x[2, 0] - 2.25) < 1e-12
    assert abs(p[2, 0]) < 1e-12


def test_parabolic_mirage_turns_and_comes_back_up() -> None:
    """n² = 1.00026² + 2e-6 z, from 1.5 m at −1.5 mrad (closed form)."""
    air = field.LinearSquare(TYPES, 1.00026**2, 2e-6)
    p_x = np.sqrt(1.00026**2 + 3e-6) * np.cos(-0.0015)
    x, p, _ = follow(air, [0, 0, 1.5], -0.0015, 2000 / p_x, 2000)
    assert abs(x[2, 0] - 0.49895665936550354) < 1e-11
    assert abs(np.arctan2(p[2, 0], p[0, 0]) - 0.0004989577429598668) < 1e-11
    start = TYPES.Array3f(0, 0, 1.5)
    ahead = TYPES.Array3f(float(np.cos(-0.0015)), 0, float(np.sin(-0.0015)))
    end = trace.march(air, start, ahead, step=1.0, max_steps=3000, max_distance=2500.0, details=True)
    assert abs(end.turning_height[0] - 0.37441239314108504) < 1e-11


@pytest.mark.parametrize(
    ("launch", "turn_height", "height", "angle"),
    [
        (-0.002, 0.1262595025263739, 0.6138936891052358, 0.001999941860884912),
        (-0.004, 0.05694498447055655, 2.4752818662995835, 0.004000000000000585),
    ],
)
def test_log_cosh_mirage(launch: float, turn_height: float, height: float, angle: float) -> None:
    """n² = 1.00027² − 5e-5 exp(−z/0.05): z = z_t + 2h ln cosh(p∞ (σ − σ_t)/2h) (closed form)."""
    air = field.ExponentialSquare(TYPES, 1.00027**2, 5e-5, 0.05)
    p_x = np.sqrt(1.00027**2 - 5e-5 * np.exp(-1.5 / 0.05)) * np.cos(launch)
    x, p, _ = follow(air, [0, 0, 1.5], launch, 1000 / p_x, 4000)
    assert abs(x[2, 0] - height) < 1e-9
    assert abs(np.arctan2(p[2, 0], p[0, 0]) - angle) < 1e-11
    ahead = TYPES.Array3f(float(np.cos(launch)), 0, float(np.sin(launch)))
    end = trace.march(
        air,
        TYPES.Array3f(0, 0, 1.5),
        ahead,
        step=0.02,
        max_steps=60_000,
        max_distance=1000.0,
        stepper=trace.SUZUKI4,
        details=True,
    )
    assert abs(end.turning_height[0] - turn_height) < 1e-8


def test_wrong_sign_of_the_gradient_is_noticed() -> None:
    """Light bends towards the denser air: over a hot ground upwards. The opposite field sends it down."""
    right = field.ExponentialSquare(TYPES, 1.00027**2, 5e-5, 0.05)
    wrong = field.ExponentialSquare(TYPES, 1.00027**2, -5e-5, 0.05)
    kept, _, _ = follow(right, [0, 0, 1.5], -0.002, 720, 720)
    lost, _, _ = follow(wrong, [0, 0, 1.5], -0.002, 720, 720)
    assert 0.12 < kept[2, 0] < 0.13
    assert lost[2, 0] < 1.5 - 0.002 * 720  # below the straight line


def test_parabolic_fibre() -> None:
    """n² = 1.5² (1 − 0.09 y²): y = y₀ cos kx + tan θ₀/k sin kx, k = g n₀/(n(y₀) cos θ₀)."""
    air = field.ParabolicGrin(TYPES, 1.5, 0.3)
    p_x = 1.5 * np.sqrt(1 - 0.09 * 0.4**2) * np.cos(0.2)
    x, p, _ = follow(air, [0, 0.4, 0], 0.2, 10 / p_x, 2000, plane="xy")
    assert abs(x[1, 0] - -0.3610158349138426) < 1e-11
    assert abs(np.arctan2(p[1, 0], p[0, 0]) - -0.2065624607935103) < 1e-11


def test_fisheye_images_a_point() -> None:
    """Every ray from (½, 0) meets again at (−2, 0) after the optical path π; ours is a circle on the way."""
    air = field.Fisheye(TYPES)
    # σ to the image: ∮ dσ = ∫ ds/n over the arc, from the circle's own geometry by quadrature
    centre, radius = np.array([-0.75, 0.7216878364870322]), 1.4433756729740643
    begin = np.arctan2(-centre[1], 0.5 - centre[0])
    end = np.arctan2(-centre[1], -2.0 - centre[0]) % (2 * np.pi)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    angle = begin + (nodes + 1) / 2 * (end - begin)
    r2 = (centre[0] + radius * np.cos(angle)) ** 2 + (centre[1] + radius * np.sin(angle)) ** 2
    sigma = float(weights @ ((1 + r2) / 2) * radius * (end - begin) / 2)
    x, _, optical = follow(air, [0.5, 0, 0], np.deg2rad(60), sigma, 16_000, plane="xy")
    assert np.allclose(x[:, 0], [-2.0, 0.0, 0.0], rtol=0, atol=1e-10)
    assert abs(optical[0] - np.pi) < 1e-10
    half, _, _ = follow(air, [0.5, 0, 0], np.deg2rad(60), sigma / 2, 8000, plane="xy")
    assert abs(np.hypot(half[0, 0] - centre[0], half[1, 0] - centre[1]) - radius) < 1e-10


def test_luneburg_lens_focuses() -> None:
    """n² = 2 − r²: x = x₀ cos σ + sin σ, y = y₀ cos σ; parallel light meets at (1, 0), leaving at −30°."""
    air = field.Luneburg(TYPES)
    start = [-np.sqrt(0.75), 0.5, 0.0]
    x, _, _ = follow(air, start, 0.0, np.pi / 4, 400, plane="xy")
    assert abs(x[0, 0] - 0.094734345490753) < 1e-11
    assert abs(x[1, 0] - 0.3535533905932738) < 1e-11
    x, p, optical = follow(air, start, 0.0, np.pi / 2, 400, plane="xy")
    assert np.allclose(x[:, 0], [1.0, 0.0, 0.0], rtol=0, atol=1e-10)
    assert abs(np.arctan2(p[1, 0], p[0, 0]) - -0.5235987755982989) < 1e-10
    # from the plane x = −1: 1 + π/2 for every ray
    assert abs(optical[0] + (1 - np.sqrt(0.75)) - 2.5707963267948966) < 1e-10


def test_gaussian_blob_deflects() -> None:
    """n = 1 − 8.9e-6 exp(−r²/2s²), s = b = 2 cm: full deflection by DOP853, 1.353108741880697e-05 rad."""
    air = field.GaussianBlob(TYPES, 8.9e-6, 0.02)
    _, p, _ = follow(air, [-0.2, 0.02, 0], 0.0, 0.4, 2000, plane="xy")
    deflection = np.arctan2(p[1, 0], p[0, 0])
    assert abs(deflection / 1.353108741880697e-05 - 1) < 1e-8
    assert deflection > 0  # away from the hot axis


def test_rays_against_an_independent_integrator() -> None:
    """A ray that is in no plane of symmetry, against SciPy's DOP853 on d²x/dσ² = ∇n²/2."""
    s2 = 0.02**2

    def rates(_: float, state: Any) -> Any:
        x, y = state[:2]
        less = 8.9e-2 * np.exp(-(x * x + y * y) / (2 * s2))
        return [*state[3:], (1 - less) * less * x / s2, (1 - less) * less * y / s2, 0.0]

    n = 1 - 8.9e-2 * np.exp(-(0.03**2 + 0.01**2) / (2 * s2))
    launch = 0.3
    start = [-0.03, 0.01, 0.0, n * np.cos(launch), 0.0, n * np.sin(launch)]
    exact = solve_ivp(rates, (0, 0.08), start, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    air = field.GaussianBlob(TYPES, 8.9e-2, 0.02)
    x, p, _ = follow(air, [-0.03, 0.01, 0], launch, 0.08, 1000)
    assert np.allclose(np.concatenate([x[:, 0], p[:, 0]]), exact, rtol=0, atol=1e-11)
    assert abs(exact[4]) > 1e-2  # the blob did bend it out of its plane


def test_snell_and_hamilton_are_kept() -> None:
    """In stratified air p_x is constant to round-off, and |p|² = n² to the integrator's order."""
    air = field.ExponentialSquare(TYPES, 1.00027**2, 5e-5, 0.05)
    x, p, _ = follow(air, [0, 0, 1.5], [-0.002, -0.004, -0.001], 1000, 4000)
    n = np.array(air.value_and_gradient(TYPES.Array3f(x))[0])
    n_start = np.sqrt(1.00027**2 - 5e-5 * np.exp(-30))
    launched = n_start * np.cos([-0.002, -0.004, -0.001])
    assert np.max(np.abs(p[0] - launched)) < 1e-14
    assert np.max(np.abs(p[1])) == 0
    assert np.max(np.abs((p**2).sum(axis=0) - n**2)) < 1e-12


@pytest.mark.parametrize("stepper", [trace.LEAPFROG, trace.YOSHIDA4, trace.SUZUKI4], ids=lambda s: s.name)
def test_march_is_reversible(stepper: trace.Stepper) -> None:
    """Marched to the end and back, a ray is where it started, whatever the step."""
    air = field.Fisheye(TYPES)
    x, p = TYPES.Array3f(0.5, 0.1, 0.2), TYPES.Array3f(0.3, 1.2, -0.4)
    y, q, _ = _loop(stepper, air, TYPES.Array3f(x), TYPES.Array3f(p), TYPES.Float(0.05), TYPES.UInt32(200))
    y, q, _ = _loop(stepper, air, y, -q, TYPES.Float(0.05), TYPES.UInt32(200))
    assert np.max(np.abs(np.array(y - x))) < 1e-12
    assert np.max(np.abs(np.array(q + p))) < 1e-12


def test_euler_is_undone_by_its_reverse() -> None:
    air = field.Fisheye(TYPES)
    x, p = TYPES.Array3f(0.5, 0.1, 0.2), TYPES.Array3f(0.3, 1.2, -0.4)
    one = trace.EULER.advance(air, x, p, TYPES.Float(0.05))
    back = trace.EULER.reversed.advance(air, one.position, one.momentum, TYPES.Float(-0.05))
    assert np.max(np.abs(np.array(back.position - x))) < 1e-15
    same = trace.EULER.advance(air, one.position, one.momentum, TYPES.Float(-0.05))
    assert np.max(np.abs(np.array(same.position - x))) > 1e-6


def test_single_precision_over_a_kilometre() -> None:
    """At 2 m steps single precision is within 50 µm of the closed form of the log-cosh mirage.

    n² = 1.00027² − 5e-5 exp(−z/0.2) from 1.5 m at −3 mrad, compared where the ray ends.
    """
    single = field.types("llvm", "single")
    a, amplitude, h, launch = 1.00027**2, 5e-5, 0.2, -0.003
    air = field.ExponentialSquare(single, a, amplitude, h)
    end = trace.march(
        air,
        single.Array3f(0, 0, 1.5),
        single.Array3f(float(np.cos(launch)), 0, float(np.sin(launch))),
        step=2.0,
        max_steps=500,
    )
    x, z = float(end.position.x[0]), float(end.position.z[0])
    n2 = a - amplitude * np.exp(-1.5 / h)
    p_x, p_z = np.sqrt(n2) * np.cos(launch), np.sqrt(n2) * np.sin(launch)
    p_far = np.sqrt(a - p_x**2)
    z_turn = -h * np.log(p_far**2 / amplitude)
    sigma_turn = 2 * h / p_far * np.arctanh(-p_z / p_far)
    exact = z_turn + 2 * h * np.log(np.cosh(p_far * (x / p_x - sigma_turn) / (2 * h)))
    assert abs(x - 1000) < 0.5
    assert abs(z - exact) < 50e-6
    assert z_turn < 0.6 < exact  # it did turn on the way
