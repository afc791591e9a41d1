"""Order of convergence of the steppers in the step, in closed-form fields: slope ± 0.2."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nigemizu import field, trace

TYPES = field.types("llvm", "double")
STEPPERS = list(trace.STEPPERS.values())


@dr.syntax
def _loop(stepper: Any, air: Any, x: Any, p: Any, sigma: Any, steps: Any) -> Any:
    k, optical = type(steps)(0), type(sigma)(0)
    while dr.hint(k < steps, exclude=[stepper]):
        after = stepper.advance(air, x, p, sigma)
        x, p = after.position, after.momentum
        optical += after.optical_path
        k += 1
    return x, p, optical


def slope(steps: list[int], errors: list[float]) -> float:
    return float(-np.polyfit(np.log(steps), np.log(errors), 1)[0])


@pytest.mark.parametrize("stepper", STEPPERS, ids=lambda s: s.name)
def test_order_in_the_step_in_the_fisheye(stepper: trace.Stepper) -> None:
    """Rays of n = 2/(1 + r²), against DOP853."""

    def rates(_: float, state: Any) -> Any:
        x, p = state[:3], state[3:6]
        n = 2 / (1 + x @ x)
        return [*p, *(-(n**3) * x), n * n]

    start, ahead = np.array([0.5, 0.1, 0.2]), np.array([0.3, 0.8, -0.4])
    momentum = ahead / np.linalg.norm(ahead) * 2 / (1 + start @ start)
    exact = solve_ivp(rates, (0, 2.0), [*start, *momentum, 0], method="DOP853", rtol=1e-13, atol=1e-15).y[
        :, -1
    ]
    air = field.Fisheye(TYPES)
    steps = {1: [400, 800, 1600], 2: [100, 200, 400], 4: [60, 120, 240]}[stepper.order]
    errors, paths, invariants = [], [], []
    for count in steps:
        x, p, optical = _loop(
            stepper, air, TYPES.Array3f(*start.tolist()), TYPES.Array3f(*momentum.tolist()),
            TYPES.Float(2.0 / count), TYPES.UInt32(count),
        )  # fmt: skip
        n, _ = air.value_and_gradient(x)
        errors.append(float(np.linalg.norm(np.array(x)[:, 0] - exact[:3])))
        paths.append(abs(float(optical[0]) - exact[6]))
        invariants.append(abs(float((dr.squared_norm(p) - n * n)[0])))
    assert abs(slope(steps, errors) - stepper.order) < 0.2
    assert abs(slope(steps, paths) - stepper.order) < 0.2
    assert abs(slope(steps, invariants) - stepper.order) < 0.2


@pytest.mark.parametrize("stepper", STEPPERS, ids=lambda s: s.name)
def test_order_of_a_whole_march_over_a_hot_layer(stepper: trace.Stepper) -> None:
    """`march` to a given path length in n² = a − A exp(−z/h), against the log-cosh ray at the same x.

    The ray starts inside the layer: with both ends in still air Euler's first-order error, a shift of the
    kicks by half a step, would all but vanish.
    """
    a, amplitude, h, launch = 1.00027**2, 5e-5, 0.2, -0.003
    air = field.ExponentialSquare(TYPES, a, amplitude, h)
    n2 = a - amplitude * np.exp(-0.4 / h)
    p_x, p_z = np.sqrt(n2) * np.cos(launch), np.sqrt(n2) * np.sin(launch)
    p_far = np.sqrt(a - p_x**2)
    z_turn = -h * np.log(p_far**2 / amplitude)
    sigma_turn = 2 * h / p_far * np.arctanh(-p_z / p_far)
    steps = [16, 32, 64] if stepper.order == 4 else [64, 128, 256]
    errors = []
    for count in steps:
        end = trace.march(
            air,
            TYPES.Array3f(0, 0, 0.4),
            TYPES.Array3f(float(np.cos(launch)), 0, float(np.sin(launch))),
            step=120 / count,
            max_steps=count,
            stepper=stepper,
        )
        sigma = float(end.position.x[0]) / p_x
        exact = z_turn + 2 * h * np.log(np.cosh(p_far * (sigma - sigma_turn) / (2 * h)))
        errors.append(abs(float(end.position.z[0]) - exact))
    assert abs(slope(steps, errors) - stepper.order) < 0.2


def test_turning_height_is_second_order() -> None:
    """Between steps p_z is taken as linear; in n² = a − A exp(−z/h) the true height is known."""
    a, amplitude, h, launch = 1.00027**2, 5e-5, 0.2, -0.003
    air = field.ExponentialSquare(TYPES, a, amplitude, h)
    p_x = np.sqrt(a - amplitude * np.exp(-2.5 / h)) * np.cos(launch)
    exact = -h * np.log((a - p_x**2) / amplitude)
    steps = [8.0, 4.0, 2.0, 1.0]
    worst = []
    for step in steps:
        # Starts along the same straight line: where in a step the turn falls is chance, the largest
        # error is not. (Up there the layer bends nothing yet.)
        begin = np.linspace(0, 8, 33)
        fall = 2.5 + begin * np.tan(launch)
        end = trace.march(
            air,
            TYPES.Array3f(begin, 0 * begin, fall),
            TYPES.Array3f(float(np.cos(launch)), 0, float(np.sin(launch))),
            step=step,
            max_steps=int(1400 / step),
            details=True,
        )
        worst.append(float(np.max(np.abs(np.array(end.turning_height) - exact))))
    order = slope([round(64 / step) for step in steps], worst)
    assert abs(order - 2) < 0.2, worst
