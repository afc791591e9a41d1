"""The built shapes as arrays; no renderer."""

import math

import numpy as np
import pytest

from nigemizu.render import Camera, Hills, Pyramid
from nigemizu.render.meshes import Triangles, box, cylinder, ellipsoid, hills, pyramid
from nigemizu.render.vehicle import LENGTH, car


def volume(mesh):
    """Signed volume inside a closed mesh (Gauss): positive when all faces look outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def is_closed(mesh):
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    forward = {tuple(edge) for edge in edges.tolist()}
    return len(forward) == len(edges) and all((b, a) in forward for a, b in forward)


def test_box_cylinder_and_ellipsoid_have_their_volumes():
    assert volume(box((2, 3, 4))) == pytest.approx(24)
    bar = cylinder(np.zeros(3), np.array([0.0, 0.0, 5.0]), 0.5, around=64)
    assert volume(bar) == pytest.approx(5 * math.pi * 0.25, rel=2e-3)
    assert volume(bar) < 5 * math.pi * 0.25
    assert volume(ellipsoid((1, 2, 3), (0.5, 1, 2))) == pytest.approx(4 / 3 * math.pi, rel=0.06)
    for mesh in (box((1, 1, 1)), bar, ellipsoid((0, 0, 0), (1, 1, 1))):
        assert is_closed(mesh)


def test_pyramid_smooth_and_stepped():
    shape = Pyramid(base=60, height=38)
    smooth = pyramid(shape, None, 0)
    assert volume(smooth) == pytest.approx(60 * 60 * 38 / 3, rel=1e-3)
    stepped = pyramid(shape, 1.0, 0)
    # Steps of constant width over a slope fill half a step more.
    assert volume(stepped) == pytest.approx(60 * 60 * 38 / 3 * (1 + 1.5 / 38), rel=0.02)
    for mesh in (smooth, stepped):
        assert is_closed(mesh)
        assert mesh.vertices[:, 2].min() == 0
        assert mesh.vertices[:, 2].max() == pytest.approx(38)


def test_turning_is_anticlockwise():
    point = Triangles(np.array([[1.0, 0.0, 0.0]]), np.zeros((0, 3), int)).moved((10, 0, 0), 90)
    np.testing.assert_allclose(point.vertices, [[10, 1, 0]], atol=1e-12)


def test_hills_have_their_height_and_natural_outline():
    shape = Hills(distance=8000, height=200, spread=30, seed=4)
    mesh = hills(shape)
    assert mesh.vertices[:, 2].max() == pytest.approx(200, rel=0.02)
    np.testing.assert_array_equal(mesh.vertices, hills(shape).vertices)
    assert (
        np.abs(mesh.vertices - hills(Hills(distance=8000, height=200, spread=30, seed=5)).vertices).max() > 1
    )
    outline = mesh.vertices.reshape(25, 1024, 3)[..., 2].max(axis=0)
    middle = outline[200:-200]
    # No saw: slopes of hills (columns are 4.1 m apart), which go on over many columns.
    slope = np.diff(middle) / 4.1
    assert np.abs(slope).max() < 1.5
    assert 0.05 < slope.std() < 0.6
    assert np.corrcoef(slope[:-1], slope[1:])[0, 1] > 0.8
    assert middle.std() > 5.0
    azimuth = np.degrees(np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0]))
    assert azimuth.min() == pytest.approx(-15)
    assert azimuth.max() == pytest.approx(15)


def test_car_has_the_size_of_a_car():
    parts = [part for group in car().values() for part in group]
    points = np.concatenate([part.vertices for part in parts])
    size = np.ptp(points, axis=0)
    assert size[0] == pytest.approx(LENGTH, abs=0.06)
    assert 1.7 < size[1] < 2.2  # with mirrors
    assert 1.40 < size[2] < 1.55
    assert -0.01 < points[:, 2].min() < 0.02  # wheels stand on the ground
    # The windscreen slopes: the cabin's front is farther back at the roof.
    glass = car()["glass"][0].vertices
    assert glass[glass[:, 2] > 1.3][:, 0].max() < glass[glass[:, 2] < 0.95][:, 0].max() - 0.5


def test_camera_direction():
    assert Camera(heading=90).direction == pytest.approx((0, 1, 0), abs=1e-12)
    assert Camera(pitch=30).direction == pytest.approx((math.cos(math.pi / 6), 0, 0.5))
    assert Camera(eye=(0, 0, 2), target=(3, 0, 6)).direction == pytest.approx((0.6, 0, 0.8))
    assert Camera(field_of_view=90, width=100).pixel_angle == pytest.approx(0.02)
