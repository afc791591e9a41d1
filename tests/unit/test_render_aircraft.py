"""The shape of the airliner; no renderer."""

import numpy as np
import pytest

from nigemizu.render import Aircraft
from nigemizu.render.aircraft import LENGTH, NOZZLES, airliner
from nigemizu.render.meshes import box, merged


def volume(mesh):
    """Signed volume inside a closed mesh (Gauss): positive when all faces look outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_an_airliner_has_its_size():
    """Of an airliner of 150 seats: 37.6 m long, 34 m to 36 m across with winglets, 11.8 m high."""
    points = np.concatenate([part.vertices for group in airliner().values() for part in group])
    length, span, height = np.ptp(points, axis=0)
    assert length == pytest.approx(LENGTH, abs=0.1)
    assert 33.0 < span < 36.0
    assert 11.0 < height < 12.5
    assert points[:, 2].min() == pytest.approx(0.0, abs=0.01)
    assert points[:, 0].max() == pytest.approx(-points[:, 0].min(), abs=0.1)
    assert Aircraft(position=(0, 0, 0)).length == LENGTH


def test_all_faces_of_closed_parts_look_outwards():
    groups = airliner()
    for name in ("paint", "fin", "grey", "metal", "rubber", "lamp"):
        assert all(volume(part) > 0 for part in groups[name]), name


def test_it_is_alike_on_both_sides():
    points = np.concatenate([part.vertices for group in airliner().values() for part in group])
    for axis, sign in ((0, 1), (2, 1), (1, -1)):
        assert points[points[:, 1] > 0.5][:, axis].mean() == pytest.approx(
            sign * points[points[:, 1] < -0.5][:, axis].mean(), abs=0.05
        )


def test_the_jet_pipes_are_where_the_documentation_says():
    core = airliner()["metal"][0].vertices
    x, y, z = NOZZLES[0]
    assert core[:, 0].min() == pytest.approx(x, abs=0.01)
    assert core[:, 1].mean() == pytest.approx(y, abs=0.01)
    assert core[:, 2].mean() == pytest.approx(z, abs=0.01)
    assert (x / LENGTH, y / LENGTH, z / LENGTH) == pytest.approx((0.008, 0.153, 0.047), abs=5e-4)


def test_merging_keeps_every_face():
    parts = [box((1, 1, 1)), box((2, 1, 1)).moved((5, 0, 0))]
    one = merged(parts)
    assert len(one.faces) == sum(len(part.faces) for part in parts)
    assert volume(one) == pytest.approx(3.0)
