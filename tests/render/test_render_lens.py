"""Pictures through an aperture: blur without air by the thin-lens formula, and with air by its pinholes."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from render_scenes import bar, types

from nigemizu import field, render
from nigemizu.errors import InputError
from nigemizu.render.passes import Shot
from nigemizu.render.sensors import sensor
from nigemizu.trace import Tracer

TELEPHOTO = {"focal_length": 0.4, "pixel_pitch": 6e-6, "f_number": 4.0, "focus_distance": 400.0}


def lone_bar(camera: render.Camera, distance: float, half_size: float) -> mi.Scene:
    """A small luminous square straight ahead, without air, through stock Mitsuba's integrator."""
    x, y, z = camera.eye
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": sensor(camera),
            "bar": bar(x + distance, z, half_size, half_size, y),
        }
    )


def spread_of(picture: np.ndarray) -> tuple[float, float, float, float]:
    """Middle [pixels] and variance [pixels²] of what is bright, across and down."""
    light = picture[..., 0].astype(float)
    y, x = np.mgrid[: light.shape[0], : light.shape[1]]
    middle = [float((light * axis).sum() / light.sum()) for axis in (x, y)]
    around = [
        float((light * (axis - m) ** 2).sum() / light.sum()) for axis, m in zip((x, y), middle, strict=True)
    ]
    return (*middle, *around)


@pytest.mark.parametrize("lens_points", [0, 256])
@pytest.mark.parametrize(("distance", "pixels"), [(100.0, 50.05), (1600.0, 12.51), (400.0, 0.0)])
def test_circle_of_confusion(distance: float, pixels: float, lens_points: int) -> None:
    """c = A f |d − s| / (d (s − f)): 0.3003 mm at 100 m for 400 mm f/4 focused at 400 m, 50 pixels of 6 µm.

    A disc of the diameter c has the variance c²/16 along each axis, to which a square of the side a adds
    a²/12, and pixels up to 1/12. Bounds are four standard deviations of so many rays.
    """
    camera = render.Camera(**TELEPHOTO, width=96, height=80, samples=1024, lens_points=lens_points)
    formula = 0.1 * 0.4 * abs(distance - 400) / (distance * (400 - 0.4))
    assert formula / 6e-6 == pytest.approx(pixels, abs=0.01)
    side = 6.0  # pixels
    half = side * camera.pixel_angle * distance / 2
    scene = lone_bar(camera, distance, half)
    shots = [Shot(4, lens) for lens in render.lens_sensors(camera)] or None
    taken = render.picture(scene, samples=1024, shots=shots)
    across, down, *variances = spread_of(taken.radiance)
    expected = pixels**2 / 16 + side**2 / 12
    for variance in variances:
        assert variance == pytest.approx(expected, rel=0.022, abs=0.1)
    assert (across, down) == pytest.approx((47.5, 39.5), abs=0.3)
    # No light is lost to the blur.
    assert taken.radiance[..., 0].sum() == pytest.approx(side**2, rel=0.021)


def test_the_blurred_disc_is_even_and_round() -> None:
    camera = render.Camera(**TELEPHOTO, width=80, height=80)
    half = 2.0 * camera.pixel_angle * 100.0 / 2
    light = render.picture(lone_bar(camera, 100.0, half), samples=2048).radiance[..., 0]
    y, x = np.mgrid[:80, :80] - 39.5
    radius = np.hypot(x, y)
    inside, outside = light[radius < 23], light[radius > 27]
    assert outside.max() == 0
    expected = 4 / (np.pi * 25.02**2)  # of the square's light, spread over the disc
    assert inside.mean() == pytest.approx(expected, rel=0.02)
    quarters = [light[(np.sign(x) == i) & (np.sign(y) == j)].sum() for i in (-1, 1) for j in (-1, 1)]
    np.testing.assert_allclose(quarters, np.mean(quarters), rtol=0.03)


# ---------------------- with air ----------------------


def hot_road() -> field.StratifiedVolume:
    z = np.concatenate([[0.0], np.geomspace(0.005, 3.0, 40)])
    refractivity = 0.0797 / (303.0 + 25.0 * np.exp(-z / 0.2))
    data = np.broadcast_to(refractivity[:, None, None], (z.size, 3, 3))
    return field.StratifiedVolume([-10, 500, 1500], [-9, 0, 9], z, data, types(), "extend")


def mirage_scene(camera: render.Camera) -> mi.Scene:
    """Luminous bars over a hot road, the one at 600 m mirrored below, and the sensor of `camera`."""
    bent = render.integrator(hot_road(), render.Settings(tracer=Tracer(beyond="extend"), max_depth=1))
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": bent,
            "sensor": sensor(camera),
            "bar": bar(600.0, 1.2, 0.25),
            "other": bar(300.0, 1.9, 0.06),
        }
    )


def rows(camera: render.Camera, shots: list[Shot] | None = None, seed: int = 1) -> np.ndarray:
    scene = mirage_scene(camera)
    return render.picture(scene, samples=camera.samples, seed=seed, shots=shots).radiance[..., 0].mean(axis=1)


def test_an_aperture_in_air_is_the_mean_of_its_pinholes() -> None:
    """Rationale: each point on the aperture looks through air of its own.

    Expected: the thin lens, whose rays are marched one by one, shows what 64 pinholes spread over the
    aperture show on average, their rays sharing paths: by shifted sensors, and, with the focus at infinity,
    by ordinary cameras that stand beside each other. A lone pinhole shows something else.
    """
    options = {"aperture": 0.3, "field_of_view": 0.2, "pitch": -0.2, "width": 24, "height": 64}
    finite = render.Camera(eye=(0, 0, 1.7), focus_distance=2000.0, samples=256, **options)
    lens = [rows(finite, seed=seed) for seed in (1, 2, 3)]
    noise = np.std(lens, axis=0, ddof=1).mean()
    assert noise < 0.01
    lens_mean = np.mean(lens, axis=0)
    points = finite.model_copy(update={"lens_points": 64})
    shared = rows(points, [Shot(4, pinhole) for pinhole in render.lens_sensors(points)])
    # The edge of a bar in 64 steps.
    assert np.abs(shared - lens_mean).max() < 0.03
    assert abs(np.mean(shared - lens_mean)) < 2e-3
    alone = rows(finite.model_copy(update={"aperture": 0.0}))
    assert np.abs(alone - lens_mean).max() > 0.3
    assert lens_mean[40:].max() > 0.9  # the mirage is in the picture

    endless = finite.model_copy(update={"focus_distance": "infinity"})
    places = (np.arange(10) - 4.5) * 0.03
    across, along = np.meshgrid(places, places)
    inside = np.hypot(across, along) < 0.15
    beside = []
    for a, b in zip(across[inside], along[inside] * np.cos(np.radians(0.2)), strict=True):
        pinhole = endless.model_copy(update={"aperture": 0.0, "eye": (0.0, a, 1.7 + b), "samples": 4})
        beside.append(rows(pinhole))
    assert np.abs(np.mean(beside, axis=0) - rows(endless)).max() < 0.03


def test_the_report_looks_through_the_whole_aperture() -> None:
    camera = render.Camera(
        eye=(0, 0, 1.7), aperture=0.3, field_of_view=0.2, pitch=-0.2, width=24, height=64, samples=8
    )
    taken = render.picture(mirage_scene(camera), samples=8)
    assert taken.report is not None
    assert taken.report.paths == 0
    assert 0 < taken.report.worst < 0.12
    points = camera.model_copy(update={"lens_points": 8})
    shots = [Shot(1, pinhole) for pinhole in render.lens_sensors(points)]
    shared = render.picture(mirage_scene(camera), samples=8, shots=shots)
    assert shared.report is not None
    assert shared.report.paths > 0
    assert 0 < shared.report.worst < 0.12
    assert sum(shared.statuses.values()) == 8 * 24 * 64


def test_an_aperture_that_reaches_into_the_ground_is_refused() -> None:
    camera = render.Camera(eye=(0, 0, 0.04), aperture=0.1)
    with pytest.raises(InputError, match=r"camera\.eye: the aperture reaches into the ground"):
        render.build(camera, render.Light(), [render.Ground()], integrator={"type": "direct"})
