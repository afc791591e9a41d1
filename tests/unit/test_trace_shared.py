"""Shared paths against rays that are marched one by one."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest
from numpy.typing import NDArray
from shared_rays import (
    ACCURACY,
    EYE,
    PIXEL,
    SIZE,
    TYPES,
    VILLAGE,
    Film,
    apart,
    assert_alike,
    directions_in,
    follow,
    hot_air,
    march,
    neighbours_differ,
    objects,
    rectangle,
)

from nigemizu import field, trace
from nigemizu.trace import shared
from nigemizu.trace.scout import BLOCK, scout

FloatArray = NDArray[np.float64]

# ---------------------------------------------------------------- the tests


def test_elevations_serve_every_azimuth() -> None:
    """Stratified air without sides: one table of elevations, whatever way a ray looks."""
    air, scene = hot_air(), objects()
    view = trace.ElevationView(EYE, (-0.02, 0.01), PIXEL)
    paths = trace.share_paths(air, view, scene.boxes, accuracy=ACCURACY, max_steps=20_000)
    directions = directions_in(view, 3000, azimuths=True)
    end, errors = assert_alike(air, view, paths, scene.surface, directions)
    assert paths.report.shared > 0.7
    assert np.median(errors) < 0.3 * ACCURACY
    assert errors.max() > 1e-12  # shared indeed
    assert {trace.HIT, trace.ESCAPED} == set(np.array(end.status).tolist())
    # The same elevation at other azimuths is the same ray.
    turned = np.stack([np.full(5, 0.999), np.zeros(5), np.full(5, -0.006)], axis=1)
    for ray, azimuth in enumerate(np.linspace(0, 5, 5)):
        turned[ray, :2] = 0.999 * np.cos(azimuth), 0.999 * np.sin(azimuth)
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    same = follow(paths, air, scene.surface, turned)
    assert np.ptp(np.array(same.position.z)) < 1e-9
    assert np.ptp(np.array(same.path_length)) < 1e-6
    # What the table saves: from the eye, every ray would cross dozens of cells.
    single = march(air, view, scene.surface, directions)
    assert np.mean(np.array(end.steps)) < 0.5 * np.mean(np.array(single.steps))


@pytest.mark.parametrize("depth", [0.2, 0.8])
def test_film_over_uneven_air_with_walls(depth: float) -> None:
    air, scene, view = hot_air(uneven=0.2, depth=depth), objects(*VILLAGE), Film()
    paths = trace.share_paths(air, view, scene.boxes, accuracy=ACCURACY, max_steps=20_000)
    directions = directions_in(view, 4000)
    end, errors = assert_alike(air, view, paths, scene.surface, directions)
    assert paths.report.shared > 0.3
    assert errors.max() > 1e-12
    met = np.array(end.position)[:, np.array(end.hit)]
    for x, *_ in VILLAGE:
        assert np.sum(np.abs(met[0] - x) < 1e-6) > 10, x  # each wall is seen, the one beyond the air too
    assert np.sum(np.abs(met[2]) < 1e-9) > 100
    assert np.sum(np.array(end.status) == trace.ESCAPED) > 100


@pytest.mark.parametrize("where", ["low wall in the air", "ground beyond the air"])
def test_what_is_met_within_a_fold(where: str) -> None:
    """At the fold of a mirage the corners of a block all rise, sky above and mirage below; rays between them
    pass lower, and meet what the corners fly over: a low wall, or the ground kilometres behind the air."""
    air, view = hot_air(uneven=0.2), Film()
    low = where == "low wall in the air"
    scene = objects((400.0, -30.0, 30.0, 0.3)) if low else objects(*VILLAGE)
    paths = trace.share_paths(air, view, scene.boxes, accuracy=ACCURACY, max_steps=20_000)
    directions = directions_in(view, 4000)
    shared = follow(paths, air, scene.surface, directions)
    single = march(air, view, scene.surface, directions)
    edge = neighbours_differ(air, view, scene.surface, directions)
    x = np.array(single.position.x)
    chosen = np.array(single.hit) & ~edge & (np.abs(x - 400) < 1e-6 if low else x > 1000)
    assert chosen.sum() > (40 if low else 20)
    assert np.all(np.array(shared.hit)[chosen])
    assert np.max(np.abs(np.array(shared.position.x) / x - 1)[chosen]) < (1e-6 if low else 0.3)


def test_a_coarse_table_would_be_seen() -> None:
    """Negative control: what 0.1 pixel keeps, 30 pixels do not."""
    air, scene, view = hot_air(uneven=0.2), objects(*VILLAGE), Film()
    paths = trace.share_paths(air, view, scene.boxes, accuracy=300 * ACCURACY, max_steps=20_000)
    directions = directions_in(view, 2000)
    shared = follow(paths, air, scene.surface, directions)
    single = march(air, view, scene.surface, directions)
    edge = neighbours_differ(air, view, scene.surface, directions)
    assert apart(shared, single, view.eye)[~edge].max() > 3 * ACCURACY


def test_rays_that_meet_nothing() -> None:
    """Nothing in the way, or no boxes at all: the rays end on their last straight lines."""
    air, view = hot_air(uneven=0.2), Film()
    directions = directions_in(view, 1000)
    for boxes in (np.zeros((0, 2, 3)), np.array([[[-50.0, -1, 0], [-40.0, 1, 5]]])):
        surface = None if not len(boxes) else rectangle(-45.0, -1.0, 1.0, 5.0)
        paths = trace.share_paths(air, view, boxes, accuracy=ACCURACY, max_steps=20_000)
        end = follow(paths, air, surface, directions)
        single = march(air, view, surface, directions)
        assert np.all(np.array(end.status) == trace.ESCAPED)
        assert apart(end, single, view.eye).max() <= 1.5 * ACCURACY


def test_masked_rays_are_not_traced() -> None:
    air, scene, view = hot_air(uneven=0.2), objects(), Film()
    paths = trace.share_paths(air, view, scene.boxes, accuracy=ACCURACY, max_steps=20_000)
    directions = directions_in(view, 8)
    end = paths.follow(
        air, TYPES.Array3f(np.ascontiguousarray(directions.T)), accuracy=ACCURACY, max_steps=20_000,
        chord_tolerance=ACCURACY, surface=scene.surface, active=TYPES.Bool([True, False] * 4),
    )  # fmt: skip
    assert list(np.array(end.status)[1::2]) == [trace.NOT_TRACED] * 4
    assert trace.NOT_TRACED not in np.array(end.status)[::2]


def test_blocks_that_are_not_smooth_are_marched_one_by_one() -> None:
    """White noise in cells of 2 m: neighbouring rays have nothing in common."""
    rng = np.random.default_rng(np.random.SeedSequence(23))
    x, y, z = np.linspace(-2, 300, 150), np.linspace(-6, 6, 25), np.linspace(0, 3, 20)
    data = 2.7e-4 + 1.5e-6 * rng.standard_normal((20, 25, 150))
    air = field.TrilinearVolume(x, y, z, data, TYPES)
    scene, view = objects((250.0, -3.0, 1.0, 2.0)), Film(size=(32.0, 32.0))
    paths = trace.share_paths(air, view, scene.boxes, accuracy=0.01 * ACCURACY, max_steps=20_000)
    assert paths.report.shared < 0.2
    assert not paths.everywhere
    directions = directions_in(view, 500)
    shared, single = (
        follow(paths, air, scene.surface, directions),
        march(air, view, scene.surface, directions),
    )
    edge = neighbours_differ(air, view, scene.surface, directions)
    assert np.all((np.array(shared.status) == np.array(single.status)) | edge)
    assert apart(shared, single, view.eye)[~edge].max() <= 1.5 * ACCURACY


def test_eye_outside_the_volume() -> None:
    """Straight to the air, with a wall before it."""
    air, scene = hot_air(uneven=0.2), objects((-60.0, -2.0, 0.5, 1.2), *VILLAGE)
    view = Film(eye=np.array([-150.0, 0.3, 1.3]))
    paths = trace.share_paths(air, view, scene.boxes, accuracy=ACCURACY, max_steps=20_000)
    end, _ = assert_alike(air, view, paths, scene.surface, directions_in(view, 3000))
    assert np.sum(np.abs(np.array(end.position.x) + 60) < 1e-9) > 10


def test_ground_that_does_not_cover_the_floor() -> None:
    """A ground below the air, and none at all: rays leave through the floor and go straight on."""
    air = hot_air(uneven=0.2, floor=0.4)
    for boxes_of in (objects(*VILLAGE), objects(*VILLAGE, ground=None)):
        view = Film()
        paths = trace.share_paths(air, view, boxes_of.boxes, accuracy=ACCURACY, max_steps=20_000)
        assert trace.grounded(air, boxes_of.boxes) is air
        assert_alike(air, view, paths, boxes_of.surface, directions_in(view, 2000))


def test_nothing_slips_between_the_last_segment_and_the_straight_piece_behind_it() -> None:
    """Rays that meet the ground as near to that seam as the two pieces lie apart.

    Negative control: without the look back from the beginning of the last piece some of them are lost.
    """
    air, scene, view = hot_air(uneven=0.2, floor=0.4), objects(*VILLAGE), Film()
    paths = trace.share_paths(air, view, scene.boxes, accuracy=ACCURACY, max_steps=20_000)
    rng = np.random.default_rng(np.random.SeedSequence(23))
    x, y = rng.uniform(0, view.size[0], 20_000), rng.uniform(44.6, 44.8, 20_000)
    directions = view.directions(x, y)
    alone = np.array(march(air, view, scene.surface, directions).hit)
    assert np.all(np.array(follow(paths, air, scene.surface, directions).hit) == alone)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shared, "_SEAM", 0.0)
        assert np.sum(np.array(follow(paths, air, scene.surface, directions).hit) != alone) > 10


def test_a_ground_on_the_floor_continues_the_air_below() -> None:
    air = hot_air(uneven=0.2)
    assert isinstance(trace.grounded(air, objects().boxes), field.Bottomless)
    assert trace.grounded(air, objects(*VILLAGE, ground=None).boxes) is air
    assert trace.grounded(air, np.zeros((0, 2, 3))) is air
    small = np.array([[[0.0, -20, 0], [300, 20, 0]]])
    assert trace.grounded(air, small) is air


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_segments_contain_every_hit(seed: int) -> None:
    """Random boxes along the way: no ray is in one (places 4 m apart) outside the segments of its block."""
    rng = np.random.default_rng(np.random.SeedSequence([29, seed]))
    air, view = hot_air(uneven=0.2), Film()
    middle = np.stack([rng.uniform(20, 700, 12), rng.uniform(-6, 6, 12), rng.uniform(0, 2, 12)], axis=1)
    half = np.stack([rng.uniform(0, 8, 12), rng.uniform(0.05, 1.5, 12), rng.uniform(0.05, 0.6, 12)], axis=1)
    boxes = np.stack([middle - half, middle + half], axis=1)
    segments = scout(air, view, boxes, accuracy=0.05 * ACCURACY, max_steps=20_000, farthest=760.0)
    count = 1500
    x, y = rng.uniform(0, SIZE[0], count), rng.uniform(0, SIZE[1], count)
    block = (y // BLOCK[1]).astype(int) * segments.columns + (x // BLOCK[0]).astype(int)
    u, v = (x / BLOCK[0]) % 1, (y / BLOCK[1]) % 1
    corner = segments.start[block]  # (rays, segments, 4)
    upper = corner[..., 0] + (corner[..., 1] - corner[..., 0]) * u[:, None]
    lower = corner[..., 2] + (corner[..., 3] - corner[..., 2]) * u[:, None]
    start = upper + (lower - upper) * v[:, None]
    end, used = segments.end[block], np.arange(start.shape[1]) < segments.count[block][:, None]
    directions = TYPES.Array3f(np.ascontiguousarray(view.directions(x, y).T))
    hits = 0
    for s in np.linspace(1.0, 755.0, 189):
        at = trace.march(
            air, TYPES.Array3f(*EYE.tolist()), directions, accuracy=dr.opaque(TYPES.Float, 0.01 * ACCURACY),
            max_steps=20_000, max_distance=dr.opaque(TYPES.Float, float(s)),
        )  # fmt: skip
        place = np.array(at.position).T[:, None, :]
        inside = np.any(np.all((place >= boxes[:, 0]) & (place <= boxes[:, 1]), axis=2), axis=1)
        covered = np.any(used & (s >= start - 1e-6) & (s <= end + 1e-6), axis=1)
        covered |= (s >= segments.last[block]) & segments.looks[block]
        assert np.all(covered[inside])
        hits += int(inside.sum())
    assert hits > 200
    covered_share = np.sum(np.where(used, end - start, 0), axis=1).mean() / 760
    assert covered_share < 0.6  # not simply everything


@pytest.mark.parametrize("y0", np.linspace(2.4, 3.5, 9).round(3).tolist())
def test_deep_objects_are_met_at_their_front(y0: float) -> None:
    """A ray at a block's corner enters the box by its side, metres later than its neighbours by the front."""
    air, view = hot_air(uneven=0.05), Film()
    front = rectangle(180.0, y0, y0 + 3.0, 2.0)
    boxes = np.array([[[180.0, y0, 0.0], [200.0, y0 + 3.0, 2.0]]])
    paths = trace.share_paths(air, view, boxes, accuracy=ACCURACY, max_steps=20_000)
    directions = directions_in(view, 4000)
    shared, single = follow(paths, air, front, directions), march(air, view, front, directions)
    edge = neighbours_differ(air, view, front, directions)
    assert np.array_equal(np.array(shared.status)[~edge], np.array(single.status)[~edge])
    assert np.sum(np.array(single.status) == trace.HIT) > 50
