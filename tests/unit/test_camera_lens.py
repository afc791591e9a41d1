"""The camera as photographers state it: lens, sensor, aperture, focus and exposure time."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import ValidationError

from nigemizu.errors import InputError
from nigemizu.render import Camera, Noise
from nigemizu.scene import Scene

FULL_FRAME = {"focal_length": 0.4, "sensor_width": 0.036}


def test_angle_of_view_of_known_lenses() -> None:
    """2 arctan(w / 2f): 39.6° of a 50 mm lens on full frame, 5.15° of 400 mm, as lens makers state them."""
    for focal, degrees in ((50e-3, 39.6), (400e-3, 5.15), (800e-3, 2.58)):
        camera = Camera(focal_length=focal, sensor_width=36e-3)
        assert camera.angle_of_view == pytest.approx(degrees, abs=0.005 * degrees)
        assert camera.angle_of_view == pytest.approx(math.degrees(2 * math.atan(0.018 / focal)), rel=1e-12)
        assert camera.pixel_angle == pytest.approx(0.036 / focal / 960, rel=1e-12)


def test_pixel_pitch_keeps_the_pixel_and_sensor_width_keeps_the_view() -> None:
    by_pitch = [Camera(focal_length=0.4, pixel_pitch=6e-6, width=width) for width in (6000, 600)]
    assert by_pitch[0].angle_of_view == pytest.approx(5.1527, abs=1e-3)
    assert by_pitch[0].pixel_angle == pytest.approx(15e-6, rel=1e-12)
    assert by_pitch[1].pixel_angle == pytest.approx(15e-6, rel=1e-12)
    by_width = [Camera(**FULL_FRAME, width=width) for width in (6000, 600)]
    assert by_width[1].angle_of_view == by_width[0].angle_of_view
    assert by_width[1].pixel_angle == pytest.approx(10 * by_width[0].pixel_angle)


def test_a_lens_that_focuses_close_sees_less() -> None:
    """1/v = 1/f − 1/s: at s = 2f the sensor stands at 2f and the angle is that of twice the focal length."""
    close = Camera(focal_length=0.1, sensor_width=0.036, focus_distance=0.2)
    assert close.angle_of_view == pytest.approx(Camera(focal_length=0.2, sensor_width=0.036).angle_of_view)
    far = Camera(focal_length=0.1, sensor_width=0.036, focus_distance=700.0)
    assert 0.9997 < far.angle_of_view / Camera(focal_length=0.1, sensor_width=0.036).angle_of_view < 0.9999


def test_a_stated_field_of_view_is_kept_bit_for_bit() -> None:
    for degrees in (0.4, 2.6, 6.0, 90.0):
        camera = Camera(field_of_view=degrees)
        assert camera.angle_of_view == degrees
        assert camera.pixel_angle == 2.0 * math.tan(math.radians(degrees) / 2.0) / 960
    assert Camera().angle_of_view == Camera(field_of_view=None).angle_of_view == 6.0
    assert Camera().aperture_diameter == 0
    assert Camera().instants(3.0) == (3.0,)


def test_the_aperture_follows_from_the_f_number() -> None:
    assert Camera(**FULL_FRAME, f_number=4).aperture_diameter == pytest.approx(0.1)
    assert Camera(aperture=0.07).aperture_diameter == 0.07
    # λN in pixels: 0.55 µm at f/8 is 4.4 µm, on pixels of 4 µm.
    fine = Camera(focal_length=0.4, pixel_pitch=4e-6, f_number=8)
    assert fine.airy_scale(550e-9) == pytest.approx(1.1, rel=1e-9)


def test_units_and_words_of_photographers() -> None:
    camera = Camera.model_validate(
        {
            "focal_length": "400 mm",
            "pixel_pitch": "4 um",
            "f_number": 5.6,
            "focus_distance": "0.7 km",
            "shutter": "2 ms",
            "noise": {"full_well": "20000 electrons"},
        }
    )
    assert (camera.focal_length, camera.focus, camera.shutter) == pytest.approx((0.4, 700.0, 0.002))
    assert camera.pixel_pitch == pytest.approx(4e-6)
    assert camera.noise == Noise(full_well=20000.0)
    for word in ("infinity", "inf", math.inf):
        assert Camera.model_validate({"focus_distance": word}).focus == math.inf


def test_a_scene_takes_the_lens_from_the_command_line_and_reads_back() -> None:
    lens = {"camera.field_of_view": "none", "camera.focal_length": "400 mm", "camera.sensor_width": "36 mm"}
    scene = Scene.load("pyramid", lens | {"camera.f_number": 4, "camera.noise.full_well": 9000})
    assert scene.camera.field_of_view is None
    again = Scene.from_toml(scene.to_toml())
    assert again == scene
    assert again.camera.aperture_diameter == pytest.approx(0.1)
    assert again.with_changes({"camera.samples": 3}).camera.angle_of_view == scene.camera.angle_of_view
    back = again.with_changes({"camera.focal_length": "none", "camera.sensor_width": "none",
                               "camera.f_number": "none", "camera.field_of_view": 2.6})  # fmt: skip
    assert back.camera.angle_of_view == 2.6


def test_instants_are_the_middles_of_equal_parts() -> None:
    camera = Camera(shutter=0.02, shutter_instants=4, samples=64)
    assert camera.instants(5.0) == pytest.approx((5.0025, 5.0075, 5.0125, 5.0175), rel=1e-12)
    # Each has a sample at least.
    assert len(Camera(shutter=0.02, samples=3).instants(0.0)) == 3
    assert Camera(shutter=0.02, samples=1).instants(1.0) == pytest.approx((1.01,))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"focal_length": 0.4, "sensor_width": 0.036, "field_of_view": 6.0}, "field_of_view: follows from"),
        ({"focal_length": 0.4}, "focal_length: needs pixel_pitch or sensor_width"),
        ({"sensor_width": 0.036}, "sensor_width: says nothing without focal_length"),
        ({"pixel_pitch": 4e-6}, "pixel_pitch: says nothing without focal_length"),
        (FULL_FRAME | {"pixel_pitch": 4e-6}, "sensor_width: follows from pixel_pitch"),
        ({"f_number": 8}, "f_number: needs focal_length"),
        (FULL_FRAME | {"f_number": 8, "aperture": 0.05}, "aperture: follows from f_number"),
        (FULL_FRAME | {"focus_distance": 0.3}, "focus_distance: a lens of 0.4 m cannot focus this close"),
        (FULL_FRAME | {"focus_distance": "400 mm"}, "cannot focus this close"),
        ({"focal_length": 1e-3, "sensor_width": 0.036}, "focal_length: is too short for the sensor"),
        ({"diffraction": True}, "diffraction: needs the size of the aperture"),
        ({"f_number": 0}, "greater than 0"),
        ({"aperture": -0.1}, "greater than or equal to 0"),
        ({"focus_distance": 0}, "greater than 0"),
        ({"shutter": -0.01}, "greater than or equal to 0"),
        ({"shutter": math.inf}, "finite"),
        ({"shutter_instants": 0}, "greater than or equal to 1"),
        ({"noise": {"full_well": 0}}, "greater than or equal to 1"),
        ({"noise": {"read_noise": -1}}, "greater than or equal to 0"),
    ],
)
def test_what_makes_no_camera_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError) as refused:
        Camera.model_validate(given)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({"camera.f_number": 8}, "camera.f_number: needs focal_length"),
        ({"camera.focal_length": "400 mm", "camera.sensor_width": "36 mm"}, "camera.field_of_view: follows"),
        ({"camera.shutter": -1}, "camera.shutter: out of range"),
        ({"camera.focus_distance": "far"}, "camera.focus_distance"),
        ({"camera.focal_length": "400 kg"}, "camera.focal_length: wrong unit"),
    ],
)
def test_a_scene_names_the_key_in_one_line(given: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError) as refused:
        Scene.load("pyramid", given)
    assert key in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_schema_knows_the_lens() -> None:
    found = Scene.json_schema()["$defs"]["Camera"]["properties"]
    assert found["focal_length"]["unit"] == found["focus_distance"]["unit"] == "m"
    assert "Length" not in Scene.json_schema()["$defs"]
    assert {"f_number", "shutter", "diffraction", "noise"} <= set(found)
