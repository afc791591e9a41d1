"""Blocks whose paths are torn here and there: the rest of them is shared, and only what is smooth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from shared_rays import ACCURACY, EYE, TYPES, Film, apart, directions_in, follow, march, objects

from nigemizu import field, trace
from nigemizu.trace import sharing


def rough_air(strength: float = 4e-6) -> field.StratifiedVolume:
    """Air without layers, its index at random from column to column: kinks at every face across the view."""
    random = np.random.default_rng(np.random.SeedSequence(8))
    x, y, z = np.linspace(-10, 600, 62), np.linspace(-15, 15, 16), np.linspace(0, 8, 9)
    data = 2.7e-4 + strength * random.standard_normal((9, 16, 62))
    return field.StratifiedVolume(x, y, z, data, TYPES)


def lay(air: Any, view: Any, boxes: Any, rays: float = 16.0) -> trace.SharedPaths:
    return trace.share_paths(air, view, boxes, accuracy=ACCURACY, max_steps=20_000, rays=rays)


def test_torn_blocks_are_shared_where_they_are_smooth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most of the picture is shared that otherwise is not, and all of it is right to the accuracy.

    Negative control: without the marks of torn cells rays are wrong by several times that.
    """
    air, view, scene = rough_air(), Film(), objects()
    directions = directions_in(view, 6000)
    exact = march(air, view, scene.surface, directions)
    paths = lay(air, view, scene.boxes)
    errors = apart(follow(paths, air, scene.surface, directions), exact, EYE)
    assert np.mean(errors > 1.5 * ACCURACY) < 2e-3  # chords may add a half; kinks between two nodes
    assert np.median(errors) > 1e-9  # shared indeed
    assert paths.report.error <= ACCURACY

    unmarked: dict[str, Any] = {}

    def without_marks(*args: Any, **options: Any) -> Any:
        table, laid = laying(*args, **options)
        unmarked["share"] = table.torn_share
        records = table.records.reshape(-1, 8).copy()
        records[:, 3] = 0
        return replace(table, records=records.ravel()), laid[:0]  # nor are the blocks tested

    laying = sharing.lay_cellwise
    monkeypatch.setattr(sharing, "lay_cellwise", without_marks)
    wrong = apart(follow(lay(air, view, scene.boxes), air, scene.surface, directions), exact, EYE)
    assert 0.02 < unmarked["share"] < 0.6
    assert np.mean(wrong > 1.5 * ACCURACY) > 10 * max(np.mean(errors > 1.5 * ACCURACY), 1e-4)

    def nothing(*args: Any, **options: Any) -> Any:
        return laying(*args, **(options | {"rays": 0}))

    monkeypatch.setattr(sharing, "lay_cellwise", nothing)
    assert lay(air, view, scene.boxes).report.shared < paths.report.shared - 0.2


def test_few_rays_are_not_worth_a_grid() -> None:
    air, view, scene = rough_air(), Film(), objects()
    few, many = (lay(air, view, scene.boxes, rays) for rays in (1.0, 16.0))
    assert few.report.paths < many.report.paths
    assert few.report.shared < many.report.shared


def test_paths_of_rays_that_meet_the_ground_end_there() -> None:
    """Steep rays onto hot ground are followed a little way into it, not back out of the air below it."""
    z = np.concatenate([[0.0], np.cumsum(0.005 * 1.2 ** np.arange(30))])
    random = np.random.default_rng(np.random.SeedSequence(2))
    profile = 2.7e-4 - 3e-5 * np.exp(-z / 0.01)
    bumps = 1e-7 * random.standard_normal((len(z), 12, 50))
    air = field.StratifiedVolume(
        np.linspace(-10, 600, 50), np.linspace(-20, 20, 12), z, profile[:, None, None] + bumps, TYPES
    )
    scene, view = objects(), Film(size=(64.0, 96.0))
    paths = lay(air, view, scene.boxes)
    x, y = np.meshgrid(np.linspace(1, 63, 40), np.linspace(80, 95, 40))
    down = view.directions(x.ravel(), y.ravel())
    end, exact = follow(paths, air, scene.surface, down), march(air, view, scene.surface, down)
    assert np.all(np.array(end.status) == trace.HIT)
    assert np.max(apart(end, exact, EYE)) < 1.5 * ACCURACY
    # the table has states of these rays up to behind the ground, and no farther
    place = paths._find(TYPES.Array3f(np.ascontiguousarray(down.T)))
    last = np.array(dr.gather(TYPES.Float, paths._last, place.block))
    assert np.all(last < 1.5 * np.array(exact.path_length))
    assert np.all(last > np.array(exact.path_length))
