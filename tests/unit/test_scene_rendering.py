"""What a person is told about a picture before it is made."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from nigemizu.errors import NigemizuWarning
from nigemizu.scene import Scene
from nigemizu.scene.rendering import warn_of_long_steps
from nigemizu.scene.running import AirVolume


def layer(gradient: float, thickness: float = 0.01) -> AirVolume:
    """A linear layer at the ground under air of constant index."""
    height = np.array([0.0, thickness, 5.0])
    index = 2.7e-4 + gradient * np.minimum(height - thickness, 0.0)
    return AirVolume(np.zeros(1), np.zeros(1), height, np.tile(index[:, None, None], (1, 2, 3)))


# In a linear layer rays are parabolas, turned over 2 θ / g: 4.5 m at half the largest angle, √(2 · 1e-5).
@pytest.mark.parametrize(("step", "ragged"), [(4.0, True), (2.0, True), (1.0, False), (0.5, False)])
def test_steps_too_long_for_steep_air(step: float, ragged: bool) -> None:
    scene = Scene.load("pyramid", {"tracer.step": step})
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warn_of_long_steps(layer(gradient=1e-3), scene)
    assert [entry.category for entry in said] == [NigemizuWarning] * ragged
    assert all("tracer.step to" in str(entry.message) for entry in said)


def test_air_that_bends_gently_or_upwards_asks_for_no_shorter_steps() -> None:
    scene = Scene.load("pyramid", {"tracer.step": 4.0})
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for gradient in (1e-5, 0.0, -1e-3):  # the last one is cold ground: nothing is turned back up
            warn_of_long_steps(layer(gradient), scene)
    assert said == []
