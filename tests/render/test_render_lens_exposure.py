"""Exposure time, diffraction and noise of whole scenes."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from nigemizu.errors import InputError
from nigemizu.render import diffract
from nigemizu.scene import Scene
from nigemizu.scene.rendering import Studio
from nigemizu.scene.running import AirVolume

SMALL: dict[str, Any] = {
    "camera.width": 64,
    "camera.height": 36,
    "camera.samples": 8,
    "grid.cells": [12, 6, 24],
    "initial.unevenness": [],
    "time.duration": 30.0,
}


def scene(**camera: Any) -> Scene:
    return Scene.load("pyramid", SMALL | {f"camera.{key}": value for key, value in camera.items()})


@functools.cache
def airs() -> tuple[AirVolume, AirVolume]:
    """Air as it comes, and with its bending turned up."""
    calm = scene().air_at(30.0)
    hot = calm._replace(refractivity=calm.refractivity * 1.0 - 2e-5 * np.exp(-calm.z / 0.3)[:, None, None])
    return calm, hot


def assert_same(found: np.ndarray, expected: np.ndarray) -> None:
    """To the last digits, which depend on the order in which a pixel's samples are added up."""
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_a_picture_of_moving_air_is_the_mean_of_its_instants() -> None:
    """Exactly: each instant draws the same random numbers whatever is shown at the others."""
    studio = Studio(scene(shutter=0.02, shutter_instants=2), "auto")
    both = studio.shoot(airs(), frame=5)
    alone = [studio.shoot(airs(), weights=weights, frame=5).pixels for weights in ([1.0, 0.0], [0.0, 1.0])]
    mean = (alone[0].astype(float) + alone[1]) / 2
    assert_same(both.pixels, mean)
    # Negative control: the instants differ by far more than that.
    assert np.abs(alone[0] - alone[1]).max() > 0.05
    assert np.abs(both.pixels - alone[0]).max() > 0.02
    three = studio.shoot(airs(), weights=[3.0, 1.0], frame=5).pixels
    assert_same(three, 0.75 * alone[0].astype(float) + 0.25 * alone[1])
    assert sum(both.statuses.values()) == 8 * 64 * 36
    assert both.report is not None


def test_frames_repeat_whatever_was_rendered_before() -> None:
    camera = {"shutter": 0.02, "shutter_instants": 2, "aperture": 0.05, "lens_points": 4, "diffraction": True,
              "noise.full_well": 1000.0}  # fmt: skip
    first = Studio(scene(**camera), "auto").shoot(airs(), frame=3)
    studio = Studio(scene(**camera), "auto")
    other = studio.shoot(airs(), frame=2)
    again = studio.shoot(iter(airs()), frame=3)
    assert_same(first.pixels, again.pixels)
    assert_same(first.noiseless, again.noiseless)
    assert np.abs(other.noiseless - again.noiseless).max() > 0.01


def test_air_that_stands_still_is_seen_through_once() -> None:
    """A pinhole without exposure time, given one air, is what it was before there were lenses."""
    calm, _ = airs()
    plain = Studio(scene(), "auto").shoot(calm)
    still = Studio(scene(shutter=0.02), "auto").shoot(calm)
    listed = Studio(scene(), "auto").shoot([calm])
    assert_same(plain.pixels, still.pixels)
    assert_same(plain.pixels, listed.pixels)
    assert plain.noiseless is plain.pixels


def test_diffraction_and_noise_come_after_the_light() -> None:
    calm, _ = airs()
    plain = Studio(scene(aperture=0.02), "auto").shoot(calm)
    camera = scene(aperture=0.02, diffraction=True, **{"noise.full_well": 500.0, "noise.read_noise": 2.0})
    seen = Studio(camera, "auto").shoot(calm)
    scales = [camera.camera.airy_scale(wavelength) for wavelength in (610e-9, 540e-9, 460e-9)]
    assert_same(seen.noiseless, diffract(plain.pixels, scales))
    total = plain.pixels.sum(axis=(0, 1), dtype=float)
    np.testing.assert_allclose(seen.noiseless.sum(axis=(0, 1), dtype=float), total, rtol=1e-6)
    dim = seen.noiseless < 0.8
    wrong = ((seen.pixels - seen.noiseless) * 500.0)[dim].astype(float)
    expected = seen.noiseless[dim] * 500.0 + 4.0
    assert np.mean(wrong**2 / expected) == pytest.approx(1.0, abs=5 * np.sqrt(2 / dim.sum()) + 0.01)


def test_a_scene_runs_its_air_through_the_exposure() -> None:
    moving = scene(shutter=2.0, shutter_instants=3)
    taken = moving.render(20.0)
    airs_then = [moving.air_at(time) for time in moving.camera.instants(20.0)]
    np.testing.assert_allclose(Studio(moving, "auto").shoot(airs_then).pixels, taken.pixels, atol=2e-3)


@pytest.mark.parametrize(
    ("count", "weights", "message"),
    [
        (3, [1.0, 1.0], "air: one air per instant is needed"),
        (1, [1.0, 1.0], "air: one air per instant is needed"),
        (2, [1.0, -1.0], "weights: no shares"),
        (2, [0.0, 0.0], "weights: no shares"),
        (0, None, "weights: no shares"),
    ],
)
def test_airs_and_weights_that_do_not_fit(count: int, weights: list[float] | None, message: str) -> None:
    calm, _ = airs()
    with pytest.raises(InputError, match=message):
        Studio(scene(), "auto").shoot([calm] * count, weights=weights)
