"""Turbulence in a scene: added where light passes, the same whenever an instant is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nigemizu.errors import InputError, NigemizuWarning
from nigemizu.heat import TurbulentField
from nigemizu.progress import SILENT
from nigemizu.scene import Scene
from nigemizu.scene.running import air_instants
from nigemizu.scene.turbulent import Division

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


@pytest.mark.parametrize("spacing", [0.3, 0.1, 5.0])
def test_intervals_are_divided_until_they_are_short_enough(spacing: float) -> None:
    nodes = np.array([0.0, 0.005, 0.02, 0.2, 1.0, 2.0])
    division = Division.of(nodes, spacing)
    assert set(nodes) <= set(division.nodes)
    parts = np.searchsorted(division.nodes, nodes)
    for first, last, width in zip(parts[:-1], parts[1:], np.diff(nodes), strict=True):
        inner = np.diff(division.nodes[first : last + 1])
        assert inner.max() <= spacing * (1 + 1e-9)
        assert len(inner) == 1 or width / (len(inner) - 1) > spacing * (1 - 1e-9)  # no more than needed
        assert np.ptp(inner) < 1e-12
    values = np.random.default_rng(5).standard_normal((3, 6, 2))
    filled = division.fill(values, 1)
    expected = np.stack(
        [[np.interp(division.nodes, nodes, values[i, :, j]) for j in (0, 1)] for i in range(3)]
    )
    assert np.max(np.abs(filled - expected.transpose(0, 2, 1))) < 1e-14


def test_a_mesh_of_its_own_holds_smaller_eddies() -> None:
    """Ten times as many cells across: more of the spectrum, and the same air between the nodes.

    What bends light is the gradient across. Negative control: that of the air's own cells is much smaller.
    """
    own = {"turbulence.largest": 6.0}
    fine = own | {"turbulence.spacing": [4.0, 0.05, 0.1]}
    smooth, coarse = scene().air_at(1.0), scene(**ROUGH | own).air_at(1.0)
    rough, faint = (scene(**ROUGH | fine | {"turbulence.ct2": c}).air_at(1.0) for c in (0.4, 1e-9))
    assert (rough.x.size, rough.y.size) == (16, 311)
    assert rough.z.size > smooth.z.size
    assert np.allclose(np.diff(rough.y), 0.05, atol=1e-12)
    assert np.array_equal(rough.z[np.isin(rough.z, smooth.z)], smooth.z)
    # without its turbulence it is the air between the nodes
    between = np.interp(faint.z, smooth.z, smooth.refractivity[:, 5, 7])
    assert np.max(np.abs(faint.refractivity[:, 50, 7] - between)) < 1e-9

    def gradient(air: Any) -> float:
        level = int(np.argmin(np.abs(air.z - 1.0)))
        return float(
            np.sqrt(np.mean((np.diff(air.refractivity[level], axis=0) / np.diff(air.y)[:, None]) ** 2))
        )

    # ∫ k² k^(-8/3) dk over the band along y grows as k^(1/3): by 10^(1/3) from cell to cell, and more near 0
    assert 1.7 < gradient(rough) / gradient(coarse) < 3.0
    assert gradient(smooth) < 1e-3 * gradient(coarse)


def test_turbulence_over_a_flow_leaves_large_eddies_to_it() -> None:
    changes = {"process": "convection", "ground.kind": "held", "ground.temperature": 320.0}
    with pytest.warns(NigemizuWarning, match="set turbulence.largest"):
        Scene.load("shimmer", {"turbulence": {"ct2": 1.0, "outer_scale": 6.0}} | changes).check()
    Scene.load("shimmer").check()  # says nothing
