"""Panes of constant index converge to the bent ray as they become many."""

from __future__ import annotations

from typing import Any

import numpy as np

from nigemizu import field, trace

TYPES = field.types("llvm", "double")
A, AMPLITUDE, H = 1.00027**2, 5e-5, 0.2
HEIGHTS = np.linspace(0, 3, 60_001)
PROFILE = np.sqrt(A - AMPLITUDE * np.exp(-HEIGHTS / H)) - 1


def slope(counts: list[int], errors: list[float]) -> float:
    return float(-np.polyfit(np.log(counts), np.log(errors), 1)[0])


def ahead(launch: float) -> Any:
    return TYPES.Array3f(float(np.cos(launch)), 0, float(np.sin(launch)))


def test_ray_to_the_ground_is_second_order_in_the_panes() -> None:
    """Without a turn x is a midpoint sum of ∫ p_x/p_z dz: second order. −9 mrad meets the ground."""
    launch = -0.009
    air = field.ExponentialSquare(TYPES, A, AMPLITUDE, H)
    bent = trace.march(
        air, TYPES.Array3f(0, 0, 1.5), ahead(launch), step=0.01, max_steps=30_000,
        surface=trace.ground_plane(0),
    )  # fmt: skip
    counts = [32, 64, 128, 256]
    errors = []
    for count in counts:
        layers = field.Layers.from_profile(HEIGHTS, PROFILE, count, TYPES, spacing="equal-height")
        end = trace.cross_layers(
            layers, TYPES.Array3f(0, 0, 1.5), ahead(launch), max_crossings=1000,
            surface=trace.ground_plane(0),
        )  # fmt: skip
        assert end.status[0] == trace.HIT
        errors.append(abs(float(end.position.x[0] - bent.position.x[0])))
    assert abs(slope(counts, errors) - 2) < 0.2


def test_mirage_of_the_panes_approaches_the_bent_ray() -> None:
    """With a turn the last pane decides: the integrand is singular there, the order one half."""
    launch = -0.003
    n2 = A - AMPLITUDE * np.exp(-1.5 / H)
    p_far2 = A - n2 * np.cos(launch) ** 2
    turn = -H * np.log(p_far2 / AMPLITUDE)
    counts = [2**k for k in range(5, 14)]
    errors = []
    for count in counts:
        layers = field.Layers.from_profile(HEIGHTS, PROFILE, count, TYPES, spacing="equal-height")
        end = trace.cross_layers(
            layers, TYPES.Array3f(0, 0, 1.5), ahead(launch), max_crossings=40_000, details=True
        )
        assert end.status[0] == trace.ESCAPED
        # The pane in which light turns back is the one that holds the turning point: half a pane at most.
        assert abs(float(end.turning_height[0]) - turn) < 3 / count
        errors.append(abs(float(end.turning_height[0]) - turn))
    assert errors[-1] < 4e-4
    assert errors[0] > 10 * errors[-1]
