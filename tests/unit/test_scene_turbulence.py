"""Turbulence in a scene: added where light passes, the same whenever an instant is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nigemizu.errors import InputError
from nigemizu.heat import TurbulentField
from nigemizu.progress import SILENT
from nigemizu.scene import Scene
from nigemizu.scene.running import air_instants

SMALL = {
    "grid.x": [0.0, 64.0],
    "grid.y": [-8.0, 8.0],
    "grid.cells": [16, 32, 20],
    "initial.unevenness": [],
    "time.duration": 1.0,
    "time.picture": 1.0,
    "film.start": 0.0,
    "film.duration": 0.5,
}
ROUGH = {"turbulence.ct2": 0.4, "turbulence.outer_scale": 12.0, "turbulence.constant_below": 0.1}


def scene(**overrides: Any) -> Scene:
    return Scene.load("pyramid", SMALL | overrides)


def test_fluctuations_have_the_strength_that_was_asked_for() -> None:
    """σ_n = (n − 1)/T σ_T, with the variance that the field expects of its cells.

    Negative control: four times the structure parameter gives twice the fluctuations.
    """
    air = {strength: scene(**ROUGH | {"turbulence.ct2": strength}).air_at(1.0) for strength in (0.4, 1.6)}
    still = scene().air_at(1.0)
    assert air[0.4].temperature is not None
    level = int(np.argmin(np.abs(air[0.4].z - 1.0)))
    spread = {ct2: float((a.refractivity[level] - still.refractivity[level]).std()) for ct2, a in air.items()}
    rough = scene(**ROUGH)
    assert rough.turbulence is not None
    variance = TurbulentField(rough.grid.build(), rough.turbulence, rough.wind).variance[level - 1]
    expected = np.sqrt(variance) * still.refractivity[level].mean() / air[0.4].temperature[level]
    assert 0.75 < spread[0.4] / expected < 1.3
    assert variance < 0.154 * 0.4 * 12.0 ** (2 / 3)  # the cells leave some out
    assert 1.99 < spread[1.6] / spread[0.4] < 2.01
    # the skin of the ground is a node of its own
    assert np.array_equal(air[0.4].refractivity[0], still.refractivity[0])


def test_an_instant_is_the_same_whenever_it_is_asked_for() -> None:
    """Alone, in a film, or from a dataset: the bits of the turbulence depend on seed and time alone."""
    rough = scene(**ROUGH)
    alone = rough.air_at(0.5).refractivity
    film = [air.refractivity for air in air_instants(rough, (0.25, 0.5, 0.75), None, SILENT)]
    last = list(air_instants(rough, (0.25, 0.5, 0.75), None, SILENT, first=2))
    assert np.allclose(film[1], alone, rtol=0, atol=1e-12)
    assert len(last) == 1
    assert np.array_equal(last[0].refractivity, film[2])
    stored = rough.simulate([0.25, 0.5, 0.75])
    assert np.allclose(rough.air_at(0.5, air=stored).refractivity, film[1], rtol=0, atol=1e-12)
    # the dataset itself holds the air without it
    assert float(stored["air_temperature"].isel(time=0, z=5).std()) < 1e-6
    assert not np.allclose(film[0], film[1], rtol=0, atol=1e-8)


def test_a_dataset_of_refractivity_alone_cannot_fluctuate() -> None:
    stored = scene().simulate([0.5])[["air_refractivity"]]
    with pytest.raises(InputError, match="turbulence needs the temperature"):
        scene(**ROUGH).air_at(0.5, air=stored)
