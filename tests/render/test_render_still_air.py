"""Rationale: with n = 1 nothing may differ from Mitsuba's own path tracer.

Expected: block means of independent renderings agree (Welch's test, Šidák's correction over all blocks and
channels); the same test sees a change of reflectance by 3 %.
"""

import mitsuba as mi
import numpy as np
import pytest
from render_scenes import sensor, still_air
from scipy import stats

from nigemizu import render
from nigemizu.trace import Tracer

SIGNIFICANCE = 0.01
RENDERINGS = 12


def room(reflectance=0.5):
    """An area light, an environment, a rough conductor and matt walls within the still air's box."""
    transform = mi.ScalarTransform4f
    return {
        "type": "scene",
        "sensor": sensor(eye=(-2.5, 0, 0.8), direction=(1, 0, -0.2), fov=60, width=32, height=32),
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(sky_image())},
        "floor": {
            "type": "rectangle",
            "to_world": transform().scale([4, 4, 1]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [reflectance, 0.4, 0.3]}},
        },
        "metal": {
            "type": "sphere",
            "center": [0.5, 0.6, 0.5],
            "radius": 0.5,
            "bsdf": {"type": "roughconductor", "material": "Au", "alpha": 0.15},
        },
        "glass": {
            "type": "sphere",
            "center": [-0.3, -0.6, 0.4],
            "radius": 0.4,
            "bsdf": {"type": "dielectric"},
        },
        "lamp": {
            "type": "sphere",
            "center": [1.5, -0.8, 1.6],
            "radius": 0.25,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [9, 8, 6]}},
        },
    }


def sky_image():
    rows = np.linspace(1.5, 0.3, 32)[:, None, None]
    return np.asarray(rows * np.array([0.4, 0.6, 1.0]) * np.ones((32, 64, 1)), dtype=np.float32)


def blocks(scene, first_seed):
    """Block means (4×4 pixels) of independent renderings: (renderings, blocks · channels)."""
    found = []
    for seed in range(first_seed, first_seed + RENDERINGS):
        image = np.asarray(mi.render(scene, seed=seed, spp=64), dtype=np.float64)
        found.append(image.reshape(8, 4, 8, 4, 3).mean(axis=(1, 3)).ravel())
    return np.array(found)


def least_p(scene, reference):
    """Least p-value over all blocks, of means and of variances, against Mitsuba's `path`."""
    mine, theirs = blocks(scene, 100), blocks(reference, 900)
    of_means = stats.ttest_ind(mine, theirs, equal_var=False).pvalue
    of_variances = stats.levene(mine.std(axis=0), theirs.std(axis=0)).pvalue
    return np.nanmin(of_means), of_variances, of_means.size


def scene_with(integrator, **options):
    return mi.load_dict({**room(**options), "integrator": integrator})


def threshold(tests):
    return 1 - (1 - SIGNIFICANCE) ** (1 / tests)


@pytest.mark.parametrize("max_depth", [2, 5])
@pytest.mark.parametrize("hide", [False, True])
def test_equals_path_without_air(max_depth, hide):
    options = {"max_depth": max_depth, "rr_depth": 3, "hide_emitters": hide}
    p, p_spread, tests = least_p(
        scene_with({"type": "nigemizu", **options}), scene_with({"type": "path", **options})
    )
    assert p > threshold(tests)
    assert p_spread > SIGNIFICANCE


@pytest.mark.parametrize("tracer", [Tracer(step=0.3), Tracer(sharing=False), Tracer()])
def test_equals_path_through_a_volume_of_index_one(tracer):
    settings = render.Settings(tracer=tracer, max_depth=5)
    integrator = render.integrator(still_air(), settings)
    p, p_spread, tests = least_p(scene_with(integrator), scene_with({"type": "path", "max_depth": 5}))
    assert p > threshold(tests)
    assert p_spread > SIGNIFICANCE
    assert np.asarray(integrator.counts)[2] == 0


def test_sees_a_wrong_reflectance():
    """Negative control: the floor 3 % brighter in one channel."""
    p, _, tests = least_p(
        scene_with({"type": "nigemizu", "max_depth": 5}, reflectance=0.515),
        scene_with({"type": "path", "max_depth": 5}),
    )
    assert p < threshold(tests)
