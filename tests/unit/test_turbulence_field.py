"""The field at an instant is a function of the seed and the time, and of nothing else."""

import pickle

import numpy as np
import pytest

from nigemizu.heat import GridSpec, Wind
from nigemizu.heat.turbulence import Turbulence, TurbulentField

GRID = GridSpec(x=(0, 4), y=(-1, 1), height=1.0, cells=(32, 17, 6), first_cell=0.07).build()
WIND = Wind(speed=1.5, direction=20.0, shear="log")


def make(workers=None, **changed):
    settings = {"ct2": 0.1, "outer_scale": 1.0, "eddy_lifetime": 0.5, "seed": 3} | changed
    return TurbulentField(GRID, Turbulence(**settings), WIND, workers=workers)


@pytest.mark.parametrize("unresolved", ["left out", "folded"])
def test_same_bits_in_any_order_from_any_worker(unresolved):
    times = [0.0, 0.04, 3.0, 0.08, -7.5, 4000.0]
    first = make(unresolved=unresolved)
    forwards = [first.at(time).tobytes() for time in times]
    assert [first.at(time).tobytes() for time in reversed(times)] == forwards[::-1]
    other = make(workers=1, unresolved=unresolved)
    assert [other.at(time).tobytes() for time in times] == forwards
    sent = pickle.loads(pickle.dumps(first))
    assert sent.at(3.0).tobytes() == forwards[2]


def test_memory_does_not_grow_with_the_film():
    field = make()
    sizes = []
    for time in np.arange(0.0, 40.0, 2.0):
        field.at(time)
        sizes.append(sum(kept.nbytes for kept in field._kept.values()))
    assert len(set(sizes)) == 1
    assert sizes[0] <= 2 * 8 * np.prod(GRID.shape)


def test_every_level_has_no_mean_and_the_right_shape():
    field = make().at(12.3)
    assert field.shape == GRID.shape
    assert field.dtype == np.float64
    np.testing.assert_allclose(field.mean(axis=(1, 2)), 0.0, atol=1e-12)
    assert np.all(field.std(axis=(1, 2)) > 0.01)


def test_seeds_are_independent():
    volumes = [make(seed=seed).at(1.0) for seed in range(12)]
    normed = [(v / np.sqrt(np.mean(v**2, axis=(1, 2), keepdims=True))).ravel() for v in volumes]
    pairs = [float(np.mean(a * b)) for i, a in enumerate(normed) for b in normed[:i]]
    # 66 pairs: their mean is zero within four standard errors, and none is alike
    assert abs(np.mean(pairs)) < 4 * np.std(pairs) / len(pairs) ** 0.5
    assert max(map(abs, pairs)) < 0.6
    assert not np.array_equal(volumes[0], volumes[1])


def test_the_field_has_no_jump_in_time():
    field = make()
    times = np.arange(0.0, 3.0, 0.01)
    changes = [np.sqrt(np.mean((field.at(t + 1e-5) - field.at(t)) ** 2)) for t in times]
    # wind of 1.5 m/s over eddies of centimetres: under 100 kelvin per second, everywhere about the same
    assert max(changes) < 3 * np.median(changes)


@pytest.mark.parametrize("cells", [(32, 1, 6), (1, 32, 6), (3, 3, 1)])
def test_sections_and_small_grids_work(cells):
    grid = GridSpec(x=(0, 2), y=(0, 2), height=1.0, cells=cells).build()
    field = TurbulentField(grid, Turbulence(ct2=0.1, outer_scale=1.5)).at(5.0)
    assert np.all(np.isfinite(field))
    assert field.std() > 0.01
