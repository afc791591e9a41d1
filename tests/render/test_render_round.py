"""Pictures over a round Earth: the sea's horizon, the Sun's place, colours, what does not fit together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nigemizu import InputError, NigemizuWarning
from nigemizu.air import Atmosphere
from nigemizu.scene import Scene
from nigemizu.scene.far_air import FarAir
from nigemizu.trace import astronomical_refraction, horizon

PLAIN = {"light.sky": "sunsky", "light.sun_elevation": 40.0}


def scene(name: str, **changes: Any) -> Scene:
    sections = {key.replace("__", "."): value for key, value in changes.items()}
    return Scene.load(name, {"camera.width": 16, "camera.samples": 4, **sections})


def rows_of(picture: Any) -> np.ndarray[Any, Any]:
    """Elevation [degrees] of the rows of a picture."""
    camera = picture.scene.camera
    rows = np.arange(camera.height) + 0.5
    pixel = camera.field_of_view / camera.width
    return np.asarray(camera.pitch + (camera.height / 2 - rows) * pixel)


@pytest.mark.parametrize("name", ["sunset-mock", "lake", "fata-morgana"])
def test_shared_rays_meet_what_single_rays_meet(name: str) -> None:
    """Over a round Earth the ground below the horizon comes nearer like a root, over a flat one like 1/θ."""
    narrow = {"camera__height": 540, "camera__field_of_view": 16 / 960, "camera__samples": 1}
    shared = scene(name, **narrow, **{"light__sky": "sunsky", "light__sun_elevation": 40.0}).render()
    single = shared.scene.with_changes({"tracer.sharing": False}).render()
    assert shared.report is not None
    assert shared.report.worst < 0.1  # pixel, the bound for single precision
    assert shared.statuses["hit"] == pytest.approx(
        single.statuses["hit"], abs=24
    )  # of 8640: a row and a half


@pytest.mark.parametrize("height", [1.5, 10.0, 100.0])
def test_the_horizon_of_a_picture_is_that_of_the_invariant(height: float) -> None:
    """Dip from Bouguer's invariant (`nigemizu.trace.horizon`, tested against published numbers)."""
    seen = Scene.load(
        "moonrise",
        {
            **PLAIN, "camera.eye": [0.0, 0.0, height], "camera.width": 8, "camera.height": 400,
            "camera.field_of_view": 0.01, "camera.samples": 4, "camera.pitch": -0.0293 * height**0.5,
            "light.visibility": 1e6,
        },
    )  # fmt: skip
    picture = seen.render()
    brightness = picture.pixels.mean(axis=(1, 2))
    edge = int(np.argmax(np.abs(np.diff(brightness))))
    far = FarAir.of(seen)
    dip = np.degrees(horizon(far.profile.index(seen.air), height, radius=far.earth.radius).dip)
    middle = rows_of(picture)[edge : edge + 2].mean()
    assert middle == pytest.approx(-float(dip), abs=0.00125 * 1.5)


def test_the_sun_stands_where_refraction_lifts_it() -> None:
    """The brightest rows are within the Sun's disc, lifted by the integral of refraction."""
    pytest.importorskip("mitsuba")
    seen = Scene.load(
        "moonrise",
        {
            "light": {"sky": "physical", "sun_azimuth": 0.0, "sun_elevation": 1.0, "wavelengths": 8},
            "camera.pitch": 1.3, "camera.field_of_view": 0.02, "camera.width": 8, "camera.height": 400,
            "camera.samples": 8, "camera.exposure": 0.0,
        },
    )  # fmt: skip
    picture = seen.render()
    bright = picture.pixels[..., 1].mean(axis=1)
    inside = bright > 0.02 * bright.max()  # the sky is a thousand times darker
    elevation = rows_of(picture)
    far = FarAir.of(seen)
    index = far.profile.index(Atmosphere(wavelength=560e-9))
    lifted = np.radians(np.linspace(0.2, 3.0, 561))
    true = (
        lifted - astronomical_refraction(index, lifted, radius=far.earth.radius, observer_height=10.0).ravel()
    )
    lower, upper = (
        float(np.degrees(np.interp(np.radians(1.0 + edge), true, lifted))) for edge in (-0.2666, 0.2666)
    )
    assert elevation[inside].min() == pytest.approx(lower, abs=0.006)
    assert elevation[inside].max() == pytest.approx(upper, abs=0.006)
    # Flattened: the vertical diameter is clearly less than 0.533 degrees. A control against no refraction.
    assert 0.40 < upper - lower < 0.51


def test_grey_things_stay_grey_in_every_wavelength() -> None:
    """Without dispersion to speak of, sixteen wavelengths together are the colour that three were."""
    box = {"kind": "box", "position": [60.0, 0.0, -5.0], "size": [2.0, 80.0, 80.0],
           "material": {"kind": "colour", "colour": [0.5, 0.5, 0.5]}}  # fmt: skip
    changes = {
        "objects": [box], "camera.width": 8, "camera.height": 8, "camera.samples": 256,
        "light": {"sky": "physical", "sun_azimuth": 180.0, "sun_elevation": 50.0,
                  "extinction": {"aerosol_depth": 0.0}},
        "camera.exposure": 0.0,
    }  # fmt: skip
    colour = Scene.load("moonrise", changes).render().pixels.mean(axis=(0, 1))
    red = {**changes, "objects": [{**box, "material": {"kind": "colour", "colour": [0.5, 0.1, 0.1]}}]}
    tinted = Scene.load("moonrise", red).render().pixels.mean(axis=(0, 1))
    np.testing.assert_allclose(tinted / colour, [1.0, 0.2, 0.2], rtol=0.04)
    assert colour[0] / colour[2] == pytest.approx(1.2, abs=0.25)  # sunlight and blue sky on D65


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tracer.method": "layered"}, "tracer.method"),
        ({"tracer.interpolation": "trilinear"}, "tracer.interpolation"),
        ({"tracer.step": 5.0}, "tracer.step"),
        ({"light.sun_elevation": -12.0}, "night"),
    ],
)
def test_what_does_not_go_with_a_round_earth(changes: dict[str, Any], words: str) -> None:
    with pytest.raises((InputError, ValueError), match=words):
        Scene.load("moonrise", changes).check()


def test_an_earth_needs_air_and_a_physical_sky_too() -> None:
    with pytest.raises(InputError, match=r"profile"):
        Scene.load("pyramid", {"earth": {}}).check()
    with pytest.raises(InputError, match=r"light\.sky"):
        Scene.load("pyramid", {"light.sky": "physical"}).check()
    with pytest.raises((InputError, ValueError), match="grid"):
        Scene.from_toml("[camera]\nwidth = 10\n")


def test_a_sun_that_has_set_is_told() -> None:
    small = {"camera.width": 8, "camera.height": 8, "camera.samples": 4, "light.wavelengths": 4}
    with pytest.warns(NigemizuWarning, match="below the visible horizon"):
        Scene.load("sunset-inferior", {**small, "light.sun_elevation": -3.0}).render()


def test_data_that_end_below_what_is_looked_at() -> None:
    table = {"kind": "table", "heights": [0.0, 20.0], "temperatures": [280.0, 281.0]}
    with pytest.raises(InputError, match=r"ends at 20 m, below what is 25 m high"):
        FarAir.of(Scene.load("moonrise", {"profile": table, "camera.eye": [0.0, 0.0, 25.0]}))
    hills = {"kind": "hills", "distance": 9000.0, "height": 90.0}
    with pytest.raises(InputError, match=r"objects\.0"):
        FarAir.of(Scene.load("moonrise", {"profile": table, "objects": [hills]}))
    FarAir.of(Scene.load("moonrise", {"profile": table}))


def test_places_by_distance_bearing_and_height() -> None:
    box = {"kind": "box", "position": {"distance": "2 km", "bearing": 60.0, "height": 5.0}}
    placed = Scene.load("moonrise", {"objects": [box]}).objects[0]
    np.testing.assert_allclose(placed.position, [2000 * np.sin(np.pi / 3), 1000.0, 5.0])  # type: ignore[union-attr]
    for wrong, word in (
        ({"distnce": 3.0}, "distance"),
        ({"bearing": 3.0}, "distance"),
        ({"distance": -1.0}, "0"),
    ):
        with pytest.raises((InputError, ValueError), match=word):
            Scene.load("moonrise", {"objects": [{**box, "position": wrong}]})


def test_a_hot_road_under_layers_bends_near_by_and_far_away() -> None:
    """The mesh's mirage stays, and what leaves the air is lifted by the refraction of all of it."""
    changes = {
        "earth": {}, "profile": {"kind": "us1976", "surface_temperature": 309.0}, "grid.cells": [8, 4, 24],
        "initial.unevenness": [], "time.duration": 5.0, "camera.width": 32, "camera.height": 64,
        "objects": [{"kind": "ground"}],
    }  # fmt: skip
    both = Scene.load("road", changes)
    rays = both.trace([-0.2, 0.5, 2.0], paths=False)
    assert rays.turning_height[0] > 0  # the mirage
    assert rays.status == ("escaped",) * 3
    lifted = np.degrees(np.arcsin(rays.end_direction[1:, 2])) - np.degrees(
        np.hypot(rays.end[1:, 0] - both.camera.eye[0], rays.end[1:, 1] - both.camera.eye[1]) / 6_371_000.0
    )
    far = FarAir.of(both)
    refraction = astronomical_refraction(
        far.profile.index(both.air), np.radians([0.5, 2.0]), radius=6_371_000.0,
        observer_height=both.camera.eye[2],
    ).ravel()  # fmt: skip
    np.testing.assert_allclose(np.array([0.5, 2.0]) - lifted, np.degrees(refraction), rtol=0.06)
    alone = Scene.load(
        "road", {key: part for key, part in changes.items() if key not in ("earth", "profile")}
    )
    straight = alone.trace([0.5, 2.0], paths=False)
    assert np.all(np.abs(np.degrees(np.arcsin(straight.end_direction[:, 2])) - [0.5, 2.0]) < 0.01)


def test_ground_truth_over_a_round_earth() -> None:
    """Without air nothing is displaced; with it the far sea is lifted, by 1.76′ of dip for 1.92′ at 1 m."""
    changes = {
        **PLAIN, "camera.width": 4, "camera.height": 120, "camera.field_of_view": 4 / 120,
        "camera.pitch": -0.82,
        "camera.eye": [0.0, 0.0, 100.0], "camera.samples": 1,
    }  # fmt: skip
    seen = Scene.load("moonrise", changes)
    picture = seen.render(truth=True)
    assert picture.truth is not None
    shift, distance = picture.truth.layers.displacement_y, picture.truth.layers.path_length
    assert np.all(np.isfinite(distance))  # all of it is sea
    # A place at distance d is lifted by k d/2R, k = 0.17 (the standard of geodesists, within a tenth).
    pixel = np.radians(4 / 120 / 4)
    lifted = 0.17 * distance / (2 * 6_371_000.0) / pixel
    np.testing.assert_allclose(np.abs(shift), lifted, rtol=0.1)
    still = seen.with_changes({"tracer.method": "straight"}).render(truth=True)
    assert still.truth is not None
    assert np.abs(still.truth.layers.displacement_y).max() < 0.02
