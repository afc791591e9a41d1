"""Order of convergence of the controlled steps: slope ± 0.2.

Steps of equal length by way of a field whose cells reach no farther than they shall: nothing but Nyström's
rule errs. Left to themselves, steps whose local errors are of fifth order grow by the fifth root of the
accuracy.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nigemizu import field, trace
from nigemizu.field import Cell
from nigemizu.trace.controlled import ControlledSteps
from nigemizu.trace.march import run
from nigemizu.trace.stepping import Flight

TYPES = field.types("llvm", "double")


class Measured(field.UnboundedField):
    """A field whose cells reach so far [m] that each step is `interval` [m] of σ."""

    def __init__(self, inner: field.Field, interval: float) -> None:
        super().__init__(inner.types)
        self._inner = inner
        self._interval = dr.opaque(inner.types.Float, interval)

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        return self._inner.value_and_gradient(position, active)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        return Cell(self._inner.value_and_gradient, reach=self._interval * dr.norm(direction))


def equal_steps(air: field.Field, start: Any, ahead: Any, sigma: float, count: int) -> Flight:
    """The flight after `count` steps that together are `sigma` long, whatever their errors."""
    measured = Measured(air, sigma / count)
    x, d = (TYPES.Array3f(np.array(values, dtype=np.float64)[:, None]) for values in (start, ahead))
    rule = ControlledSteps(
        measured, accuracy=TYPES.Float(1e9), max_steps=TYPES.UInt32(count), limit=None, chord_tolerance=None,
        max_chord_steps=1, details=True,
    )  # fmt: skip
    flight = Flight.begin(measured, x, d, TYPES.Float(0), TYPES.Bool(True), sigma)
    return run(rule, flight, TYPES.Bool(True))


def slope(steps: Any, errors: Any) -> float:
    return float(-np.polyfit(np.log(steps), np.log(errors), 1)[0])


def test_nystroem_is_of_fourth_order_in_the_fisheye() -> None:
    """Position, direction, path and optical path in n = 2/(1 + r²), and |p|² = n², against DOP853."""

    def rates(_: float, state: Any) -> Any:
        x, p = state[:3], state[3:6]
        n = 2 / (1 + x @ x)
        return [*p, *(-(n**3) * x), n, n * n]

    start, ahead = np.array([0.5, 0.1, 0.2]), np.array([0.3, 0.8, -0.4])
    ahead /= np.linalg.norm(ahead)
    momentum = ahead * 2 / (1 + start @ start)
    exact = solve_ivp(rates, (0, 2.0), [*start, *momentum, 0, 0], method="DOP853", rtol=1e-13, atol=1e-15).y[
        :, -1
    ]
    steps = [20, 40, 80, 160]
    errors: dict[str, list[float]] = {"position": [], "momentum": [], "path": [], "optical": [], "square": []}
    for count in steps:
        flight = equal_steps(field.Fisheye(TYPES), start, ahead, 2.0, count)
        assert int(flight.steps[0]) == count
        x, p = (np.array(values)[:, 0] for values in (flight.position, flight.momentum))
        errors["position"].append(float(np.linalg.norm(x - exact[:3])))
        errors["momentum"].append(float(np.linalg.norm(p - exact[3:6])))
        errors["path"].append(abs(float(flight.path[0]) - exact[6]))
        errors["optical"].append(abs(float(flight.optical[0]) - exact[7]))
        errors["square"].append(abs(float(p @ p - (2 / (1 + x @ x)) ** 2)))
    for name, values in errors.items():
        assert abs(slope(steps, values) - 4) < 0.2, (name, values)
    assert errors["position"][-1] < 1e-5


def test_the_estimate_is_of_the_order_of_the_error() -> None:
    """|e|²/(h|k₁|) is h⁵ per step: h⁴ in the sum, like the error (against 1600 steps).

    A layer bends rays apart, so that what errs early is magnified: the sum of the estimates is about half of
    the error here.
    """
    air = field.ExponentialSquare(TYPES, 1.00027**2, 5e-5, 0.2)
    start, ahead = [0.0, 0.0, 0.4], [np.cos(0.003), 0.0, -np.sin(0.003)]
    exact = np.array(equal_steps(air, start, ahead, 120.0, 1600).momentum)[:, 0]
    steps = [12, 24, 48, 96]
    flights = [equal_steps(air, start, ahead, 120.0, count) for count in steps]
    wrong = [float(np.linalg.norm(np.array(flight.momentum)[:, 0] - exact)) for flight in flights]
    estimated = [float(flight.error[0]) for flight in flights]
    assert abs(slope(steps, wrong) - 4) < 0.2, wrong
    assert abs(slope(steps, estimated) - 4) < 0.2, estimated
    ratio = np.array(estimated) / wrong
    assert np.all((ratio > 0.3) & (ratio < 1)), ratio


@pytest.mark.parametrize("height", [0.5, 0.8])
def test_the_estimate_of_one_step_is_right_to_a_factor_of_a_few(height: float) -> None:
    """One step against 100 that are shorter: estimate and error are of fifth order, and alike."""
    air = field.ExponentialSquare(TYPES, 1.00027**2, 5e-5, 0.2)
    start, ahead = [0.0, 0.0, height], [np.cos(0.003), 0.0, -np.sin(0.003)]
    lengths = np.array([4.0, 8.0, 16.0])
    wrong, estimated = [], []
    for length in lengths:
        one, many = (equal_steps(air, start, ahead, float(length), count) for count in (1, 100))
        wrong.append(float(np.linalg.norm(np.array(one.momentum) - np.array(many.momentum))))
        estimated.append(float(one.error[0]))
    assert abs(slope(1 / lengths, wrong) - 5) < 0.3, wrong
    assert abs(slope(1 / lengths, estimated) - 5) < 0.3, estimated
    ratio = np.array(estimated) / wrong
    assert np.all((ratio > 0.2) & (ratio < 8)), ratio


def test_order_over_a_hot_layer_against_the_log_cosh_ray() -> None:
    """n² = a − A exp(−z/h): z = z_t + 2h ln cosh(p∞ (σ − σ_t)/2h); turning height too (closed form)."""
    a, amplitude, h, launch = 1.00027**2, 5e-5, 0.2, -0.003
    n2 = a - amplitude * np.exp(-0.4 / h)
    p_x, p_z = np.sqrt(n2) * np.cos(launch), np.sqrt(n2) * np.sin(launch)
    p_far = np.sqrt(a - p_x**2)
    z_turn = -h * np.log(p_far**2 / amplitude)
    sigma_turn = 2 * h / p_far * np.arctanh(-p_z / p_far)
    exact = z_turn + 2 * h * np.log(np.cosh(p_far * (120.0 - sigma_turn) / (2 * h)))
    air = field.ExponentialSquare(TYPES, a, amplitude, h)
    steps = [12, 24, 48, 96]
    heights, turns = [], []
    for count in steps:
        flight = equal_steps(air, [0.0, 0.0, 0.4], [np.cos(launch), 0.0, np.sin(launch)], 120.0, count)
        heights.append(abs(float(flight.position.z[0]) - exact))
        turns.append(abs(float(flight.turning[0]) - z_turn))
    assert abs(slope(steps, heights) - 4) < 0.2, heights
    # Where in a step the turn falls is chance: all that counts is that it is far better than second order.
    assert slope(steps, turns) > 3.3, turns


@pytest.mark.parametrize("name", ["fisheye", "fibre"])
def test_accuracy_buys_steps_by_its_fifth_root(name: str) -> None:
    """Steps are as few as the accuracy allows: N ∝ accuracy^(−1/5), and the error ∝ N⁻⁴."""
    if name == "fisheye":
        air: field.Field = field.Fisheye(TYPES)
        start, angle, length = [0.5, 0.0, 0.0], np.pi / 3, 2.0
    else:
        air = field.ParabolicGrin(TYPES, 1.5, 0.3)
        start, angle, length = [0.0, 0.4, 0.0], 0.2, 10.0
    accuracies = 10.0 ** -np.arange(7.0, 13.0)
    count = len(accuracies)
    end = trace.march(
        air,
        TYPES.Array3f(np.tile(np.array(start)[:, None], (1, count))),
        TYPES.Array3f(np.tile(np.array([[np.cos(angle)], [np.sin(angle)], [0.0]]), (1, count))),
        accuracy=TYPES.Float(accuracies),
        max_steps=100_000,
        max_distance=length,
    )
    finest = equal_end(air, start, angle, length)
    errors = np.linalg.norm(np.array(end.position)[:2] - finest[:2, None], axis=0)
    steps = np.array(end.steps, dtype=np.float64)
    growth = float(np.polyfit(np.log(1 / accuracies), np.log(steps), 1)[0])
    assert abs(growth - 0.2) < 0.03
    assert abs(slope(steps, errors) - 4) < 0.4, errors


def equal_end(air: field.Field, start: Any, angle: float, length: float) -> Any:
    """Position at the path length by 40 000 equal steps of fourth order."""
    end = trace.march(
        air,
        TYPES.Array3f(np.array(start)[:, None]),
        TYPES.Array3f(np.array([[np.cos(angle)], [np.sin(angle)], [0.0]])),
        accuracy=1e-16,
        max_steps=1_000_000,
        max_distance=length,
    )
    return np.array(end.position)[:, 0]
