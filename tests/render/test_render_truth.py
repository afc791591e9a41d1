"""Ground truth per pixel against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from render_scenes import types

from nigemizu import field, render
from nigemizu.errors import InputError
from nigemizu.render.truth import ground_truth
from nigemizu.render.variant import current_backend
from nigemizu.trace import RayStatus, Tracer

WALL = 700.0
EYE = 2.0


def truth_of(gradient, method="bent", objects=None):
    """Through air whose index falls by `gradient` (1/m) with height: a wall at 700 m behind a ground."""
    z = np.linspace(0.0, 60.0, 61)
    axes = np.array([-10.0, 1000.0]), np.array([-100.0, 100.0]), z
    index = np.broadcast_to((2.7e-4 - gradient * z)[:, None, None], (61, 2, 2))
    double = field.types(current_backend(), "double", differentiable=True)
    camera = render.Camera(eye=(0, 0, EYE), field_of_view=1.6, width=48, height=32, pitch=0.2)
    things = objects or [
        render.Ground(),
        render.Box(size=(2, 100, 50), position=(WALL + 1, 0, 0)),
    ]
    integrator = render.integrator(settings=render.Settings(tracer=Tracer(method=method)))
    if method == "bent":
        integrator.set_medium(
            field.StratifiedVolume(*axes, index, types()),
            lambda: field.StratifiedVolume(*axes, index, double),
        )
    scene = render.build(camera, render.Light(), things, integrator=integrator)
    render.picture(scene, samples=1)
    return ground_truth(integrator.bending, scene, scene.sensors()[0]), camera


@pytest.mark.parametrize("gradient", [2e-5, -1e-5])
def test_displacement_through_a_constant_gradient(gradient):
    """A ray of curvature g meets a wall at the distance L by an angle g L/2 lower than it set out.

    Expected: what is seen appears higher by g L/2, here 12 and 6 pixels, to 0.5 % (rays are not quite
    level); not beside its place. Negative control: the other sign.
    """
    truth, camera = truth_of(gradient)
    on_wall = (truth.status == int(RayStatus.HIT)) & (np.abs(truth.path_length - WALL) < 5)
    assert on_wall.sum() > 200
    expected = -gradient * WALL / 2 / camera.pixel_angle
    assert np.all(np.abs(truth.displacement_y[on_wall] / expected - 1) < 5e-3)
    assert np.all(np.abs(truth.displacement_x[on_wall]) < 1e-3)
    assert not np.any(np.abs(-truth.displacement_y[on_wall] / expected - 1) < 1)
    # optical path: (n − 1) at the heights on the way, about that of the eye
    excess = truth.optical_path_excess[on_wall] / truth.path_length[on_wall]
    assert np.all(np.abs(excess - 2.7e-4) < abs(gradient) * 20)
    # straight on, some of these pixels show the ground before the wall
    assert np.all(truth.straight_distance[on_wall] < WALL + 5)
    assert np.sum(np.abs(truth.straight_distance[on_wall] - WALL) < 5) > 200


def test_without_air_nothing_is_displaced():
    truth, _ = truth_of(0.0, method="straight")
    assert np.nanmax(np.abs(truth.displacement_x)) < 1e-3
    assert np.nanmax(np.abs(truth.displacement_y)) < 1e-3
    assert np.array_equal(truth.path_length, truth.straight_distance)
    assert np.all(np.isnan(truth.turning_height))
    assert {int(status) for status in np.unique(truth.status)} <= {int(RayStatus.HIT), int(RayStatus.ESCAPED)}


def test_a_ray_that_turns_says_where():
    """Under air that grows denser upwards rays turn at (1 − cos θ)/g below the eye: θ²/2g."""
    gradient = -4e-6
    truth, camera = truth_of(gradient)
    turned = np.isfinite(truth.turning_height)
    assert turned.sum() > 50
    rows = np.nonzero(turned)[0]
    elevation = np.radians(0.2) + (15.5 - rows) * camera.pixel_angle
    falling = elevation < -2 * camera.pixel_angle
    expected = EYE - elevation**2 / (2 * -gradient)
    assert np.all(np.abs(truth.turning_height[turned] - expected)[falling] < 0.02 * EYE)
    assert falling.sum() > 20


def test_rays_that_do_not_meet_in_a_point_have_no_truth():
    import mitsuba as mi

    integrator = render.integrator(settings=render.Settings(tracer=Tracer(method="straight")))
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": integrator,
            "sensor": {"type": "orthographic"},
            "ball": {"type": "sphere"},
        }
    )
    with pytest.raises(InputError, match="meet in one point"):
        ground_truth(integrator.bending, scene, scene.sensors()[0])
