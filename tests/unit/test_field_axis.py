"""Cells of an axis, against numpy.searchsorted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nigemizu import field
from nigemizu.errors import InputError
from nigemizu.field.axis import BucketAxis, UniformAxis, make_axis

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")

spacings = st.lists(st.floats(1e-3, 10.0), min_size=1, max_size=60)


def oracle(nodes: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The cell that holds x: the last one that begins at or before it; the outermost cells for the rest."""
    return np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)


def probes(nodes: np.ndarray, seed: int) -> np.ndarray:
    """Every node, its neighbours in floating point, points within, and points beyond both ends."""
    random = np.random.default_rng(seed)
    span = nodes[-1] - nodes[0]
    within = random.uniform(nodes[0], nodes[-1], 300).astype(nodes.dtype)
    beyond = np.array([nodes[0] - span, nodes[-1] + span], dtype=nodes.dtype)
    below, above = (np.nextafter(nodes, nodes.dtype.type(side)) for side in (-np.inf, np.inf))
    return np.concatenate([nodes, below, above, within, beyond])


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
@settings(deadline=None, max_examples=60)
@given(first=st.floats(-100, 100), widths=spacings, seed=st.integers(0, 2**31))
def test_any_axis_finds_the_cell_of_searchsorted(
    types: field.Types, first: float, widths: list[float], seed: int
) -> None:
    dtype = np.float32 if types is SINGLE else np.float64
    nodes = (first + np.concatenate([[0.0], np.cumsum(widths)])).astype(dtype)
    axis = BucketAxis(nodes.astype(np.float64), types)
    x = probes(nodes, seed)
    index, fraction, inverse_width = axis.locate(types.Float(x))
    expected = oracle(nodes, x)
    assert np.array_equal(np.array(index), expected)
    assert np.all((np.array(fraction) >= 0) & (np.array(fraction) <= 1))
    assert np.allclose(np.array(inverse_width), 1 / np.diff(nodes.astype(np.float64))[expected], rtol=1e-6)


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_stretched_axis_needs_one_correction_and_no_more(types: field.Types) -> None:
    nodes = np.concatenate([[0.0], np.cumsum(0.001 * 1.06 ** np.arange(120))])
    axis = make_axis(nodes, types, key="z")
    assert isinstance(axis, BucketAxis)
    assert axis.corrections == 1
    x = np.linspace(-0.1, nodes[-1] + 0.1, 200_001).astype(np.float32)
    stored = nodes.astype(np.float32 if types is SINGLE else np.float64)
    index = np.array(axis.locate(types.Float(x))[0])
    assert np.array_equal(index, oracle(stored, x.astype(stored.dtype)))


def test_uniform_axis_is_recognised_and_clamped() -> None:
    axis = make_axis(np.linspace(-3, 5, 17), DOUBLE, key="x")
    assert isinstance(axis, UniformAxis)
    index, fraction, inverse_width = axis.locate(DOUBLE.Float([-9.0, -3.0, -2.75, 0.0, 4.99, 5.0, 9.0]))
    assert list(index) == [0, 0, 0, 6, 15, 15, 15]
    assert np.allclose(np.array(fraction), [0, 0, 0.5, 0, 0.98, 1, 1], rtol=0, atol=1e-12)
    assert inverse_width == 2.0


@pytest.mark.parametrize(
    "nodes", [[1.0], [0.0, 1.0, 1.0], [0.0, 2.0, 1.0], [0.0, float("nan"), 1.0], [[0.0, 1.0]]]
)
def test_bad_axes_are_refused(nodes: list[float]) -> None:
    with pytest.raises(InputError, match=r"^z: "):
        make_axis(nodes, DOUBLE, key="z")


def test_cells_too_thin_for_single_precision_are_refused() -> None:
    nodes = 1000.0 + np.array([0.0, 1e-6, 1.0, 5.0])
    with pytest.raises(InputError, match="use double precision"):
        make_axis(nodes, SINGLE, key="z")
    assert make_axis(nodes, DOUBLE, key="z").cells == 3
