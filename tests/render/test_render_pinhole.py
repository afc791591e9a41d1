"""The pinhole camera is found again in Mitsuba's sensors, and maps directions to the film and back."""

import math

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import nigemizu
from nigemizu import field, render
from nigemizu.render.pinhole import Pinhole
from nigemizu.render.variant import current_backend

EYE = (10.0, 20.0, 3.0)
OBLIQUE = (1.0, 0.7, -0.1)


def sensor(kind="perspective", *, direction=OBLIQUE, eye=EYE, film=None, **more):
    target = [e + d for e, d in zip(eye, direction, strict=True)]
    return mi.load_dict(
        {
            "type": kind,
            "to_world": mi.ScalarTransform4f().look_at(origin=list(eye), target=target, up=[0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 960, "height": 540, **(film or {})},
            **more,
        }
    )


def positions(size, count=500):
    return np.random.default_rng(7).uniform(0, 1, (2, count)) * np.reshape(size, (2, 1))


def own_rays(found, x, y):
    """Origins and directions (N, 3) of the sensor's rays through pixel positions."""
    width, height = found.film().crop_size()
    place = mi.Point2f(mi.Float(x / width), mi.Float(y / height))
    ray, _ = found.sample_ray(0.0, 0.5, place, mi.Point2f(0.3, 0.8))
    return ray.o.numpy().T.astype(float), ray.d.numpy().T.astype(float)


def check_agreement(found, angle=3e-7):
    """The pinhole's rays are the sensor's own, to the rounding of single precision."""
    pinhole = Pinhole.of(found)
    assert pinhole is not None
    assert pinhole.size == tuple(found.film().crop_size())
    x, y = positions(pinhole.size)
    start, own = own_rays(found, x, y)
    directions = pinhole.directions(x, y)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-14)
    assert np.abs(directions - own).max() < angle
    offset = start - pinhole.origin
    beside = np.linalg.norm(np.cross(offset, directions), axis=1)
    assert beside.max() < 1e-6 * (np.linalg.norm(pinhole.origin) + np.linalg.norm(offset, axis=1).max())
    return pinhole


@pytest.mark.parametrize("name", ["pyramid", "road"])
def test_built_in_scenes(name):
    scene = nigemizu.load(name)
    built = render.build(scene.camera, scene.light, scene.objects, integrator={"type": "direct"})
    pinhole = check_agreement(built.sensors()[0])
    np.testing.assert_allclose(pinhole.origin, scene.camera.eye, atol=1e-6)
    assert pinhole.pixel_angle == pytest.approx(scene.camera.pixel_angle, rel=1e-5)
    # (0, 0) is up and to the left.
    corner, middle = pinhole.directions([0, scene.camera.width / 2], [0, scene.camera.height / 2])
    assert corner[2] > middle[2]
    assert corner[1] > middle[1]
    np.testing.assert_allclose(middle, scene.camera.direction, atol=1e-6)


@pytest.mark.parametrize("fov", [0.05, 0.5, 40.0, 120.0])
@pytest.mark.parametrize("near_clip", [0.01, 25.0])
def test_fields_of_view(fov, near_clip):
    pinhole = check_agreement(sensor(fov=fov, near_clip=near_clip))
    np.testing.assert_allclose(pinhole.origin, EYE, atol=1e-5)
    expected = 2 * math.atan(math.tan(math.radians(fov) / 2) / 960)
    assert pinhole.pixel_angle == pytest.approx(expected, rel=1e-3)


def test_a_cropped_film_counts_from_its_own_corner():
    crop = {"crop_width": 100, "crop_height": 60, "crop_offset_x": 300, "crop_offset_y": 70}
    part, whole = check_agreement(sensor(fov=20.0, film=crop)), check_agreement(sensor(fov=20.0))
    assert part.size == (100, 60)
    x, y = positions(part.size)
    np.testing.assert_allclose(part.directions(x, y), whole.directions(x + 300, y + 70), atol=3e-7)


def test_principal_point_offset():
    shifted = check_agreement(sensor(fov=20.0, principal_point_offset_x=0.2, principal_point_offset_y=-0.1))
    straight = Pinhole.of(sensor(fov=20.0))
    middle = straight.directions(480, 270)[0]
    x, y = shifted.film_position(mi.Vector3f(*middle.tolist()))
    assert abs(abs(float(x[0]) - 480) - 0.2 * 960) < 0.01
    assert abs(abs(float(y[0]) - 270) - 0.1 * 540) < 0.01


@pytest.mark.parametrize(
    "other",
    [
        lambda: sensor("thinlens", fov=20.0, aperture_radius=0.05, focus_distance=50.0),
        # Focused at infinity, its rays differ by their origins only.
        lambda: sensor("thinlens", fov=20.0, aperture_radius=0.05, focus_distance=1e9),
        lambda: sensor("orthographic"),
        lambda: mi.load_dict({"type": "radiancemeter", "film": {"type": "hdrfilm", "width": 1, "height": 1}}),
        lambda: fisheye(math.radians(60.0)),
    ],
    ids=["thinlens", "thinlens far", "orthographic", "radiancemeter", "fisheye"],
)
def test_what_is_no_pinhole(other):
    assert Pinhole.of(other()) is None


def test_a_sensor_that_moves_while_it_exposes():
    assert Pinhole.of(fisheye(0.0, speed=(0.0, 0.1, 0.0))) is None
    # Negative control: the same at rest.
    assert Pinhole.of(fisheye(0.0)) is not None


def fisheye(angle, speed=(0.0, 0.0, 0.0)):
    """A sensor that spreads `angle` evenly over the film's width; 0: a perspective of 45 degrees."""

    class Fisheye(mi.Sensor):
        def sample_ray_differential(self, time, sample1, sample2, sample3, active=True):
            across, down = sample2.x - 0.5, sample2.y - 0.5
            if angle:
                direction = mi.Vector3f(dr.cos(angle * across), -dr.sin(angle * across), -down)
            else:
                direction = mi.Vector3f(1.0, -across, -down)
            start = mi.Point3f(*EYE) + mi.Vector3f(*speed) * time
            return mi.RayDifferential3f(start, dr.normalize(direction)), mi.Color3f(1.0)

    props = mi.Properties("fisheye")
    props["film"] = mi.load_dict({"type": "hdrfilm", "width": 64, "height": 48})
    props["shutter_open"], props["shutter_close"] = 0.0, 0.5
    return Fisheye(props)


@pytest.mark.parametrize(
    ("direction", "bound"),
    [
        ((1.0, 0.0, 0.0), 1e-3),
        ((0.0, -1.0, 0.0), 1e-3),
        # Rounding of two components of the unit vector: √2 · 2⁻²⁵ rad, seen by pixels of 9.1 µrad.
        (OBLIQUE, math.sqrt(2) * 2.0**-25 / 9.09e-6 * 1.2),
    ],
)
@pytest.mark.parametrize("differentiable", [True, False])
def test_round_trip(direction, bound, differentiable):
    pinhole = Pinhole.of(sensor(fov=0.5, direction=direction))
    x, y = positions(pinhole.size)
    directions = pinhole.directions(x, y)
    for precision, most in (("single", bound), ("double", 1e-6)):
        types = field.types(current_backend(), precision, differentiable=differentiable)
        back = pinhole.film_position(types.Array3f(directions.T))
        assert all(isinstance(axis, types.Float) for axis in back)
        assert np.abs(back[0].numpy() - x).max() < most
        assert np.abs(back[1].numpy() - y).max() < most


def test_length_does_not_matter_and_behind_is_nowhere():
    pinhole = Pinhole.of(sensor(fov=30.0))
    ahead = mi.Vector3f(*pinhole.directions(100.0, 200.0)[0].tolist())
    x, y = pinhole.film_position(7 * ahead)
    assert float(x[0]) == pytest.approx(100.0, abs=1e-2)
    assert float(y[0]) == pytest.approx(200.0, abs=1e-2)
    assert all(np.isnan(axis.numpy()).all() for axis in pinhole.film_position(-ahead))


def test_a_camera_that_moves_needs_no_new_kernel():
    def kernels(pinhole):
        directions = mi.Vector3f(pinhole.directions(*positions(pinhole.size)).T)
        dr.eval(directions)
        dr.kernel_history_clear()
        dr.eval(pinhole.film_position(directions))
        return [entry["hash"] for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]

    cameras = [Pinhole.of(sensor(fov=fov, eye=(fov, 0.0, 2.0))) for fov in (1.0, 2.0)]
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        first, second = (kernels(camera) for camera in cameras)
    assert len(first) == 1
    assert first == second


def test_values_do_not_change():
    pinhole = Pinhole.of(sensor(fov=30.0))
    with pytest.raises(ValueError, match="read-only"):
        pinhole.origin[0] = 1.0
    assert "size=(960, 540)" in repr(pinhole)
