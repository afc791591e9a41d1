"""Films of all kinds, and what the scene of our own ones says of the camera."""

from __future__ import annotations

import math

import netCDF4
import numpy as np
import pytest
from PIL import Image

from nigemizu.errors import InputError
from nigemizu.measure import Film, open_film, optics_of
from nigemizu.output import FrameFolder, Provenance, write_exr, write_film

HEIGHT, WIDTH, COUNT = 24, 32, 5

SCENE = """
[camera]
eye = [0.0, 0.0, 2.0]
target = [1000.0, 0.0, 2.0]
field_of_view = "none"
focal_length = 0.5
pixel_pitch = 5e-6
f_number = 10.0
focus_distance = "infinity"
width = 32
height = 24
something_new = [1, 2]
[air]
wavelength = 6e-7
[film]
duration = 2.0
frames = 5
fps = 25
[turbulence]
cn2 = 1e-13
exponent = 0.0
reference_height = 2.0
inner_scale = 0.004
outer_scale = 3.0
unheard_of = true
"""


def frames():
    rng = np.random.default_rng(1)
    return [rng.integers(30, 220, (HEIGHT, WIDTH, 3), dtype=np.uint8) for _ in range(COUNT)]


def luma(pixels):
    return pixels.astype(np.float64) @ [0.2126, 0.7152, 0.0722] / 255


@pytest.mark.parametrize(("name", "bound"), [("f.mp4", 0.2), ("f.gif", 0.2), ("f.webp", 0.2)])
def test_films_are_read_frame_by_frame(tmp_path, name, bound):
    smooth = [np.full((HEIGHT, WIDTH, 3), 40 + 40 * n, dtype=np.uint8) for n in range(COUNT)]
    film = open_film(write_film(tmp_path / name, smooth, fps=20))
    assert film.shape == (HEIGHT, WIDTH)
    assert film.interval == pytest.approx(0.05)
    assert film.scene is None
    for _ in range(2):  # as often as one likes
        means = [float(frame.mean()) for frame in film.frames()]
        assert np.diff(means) == pytest.approx(40 / 255, rel=0.1)


def test_folders_of_pictures(tmp_path):
    for number, pixels in enumerate(frames()):
        Image.fromarray(pixels).save(tmp_path / f"shot_{number + 7}.png")
    read = list(open_film(tmp_path).frames())
    assert [frame == pytest.approx(luma(p), abs=1e-6) for frame, p in zip(read, frames(), strict=True)]
    (tmp_path / "shot_9.png").unlink()
    with pytest.raises(InputError, match="frame 9 is missing"):
        open_film(tmp_path)


def test_deep_and_linear_pictures(tmp_path):
    for folder in ("deep", "linear"):
        (tmp_path / folder).mkdir()
    deep = np.arange(HEIGHT * WIDTH, dtype=np.uint16).reshape(HEIGHT, WIDTH) * 80
    Image.fromarray(deep).save(tmp_path / "deep" / "0.tif")
    assert next(open_film(tmp_path / "deep").frames()) == pytest.approx(deep / 65535, abs=1e-6)
    radiance = np.repeat(np.linspace(0, 50, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH, 1), 3, axis=2)
    write_exr(tmp_path / "linear" / "0000.exr", radiance)
    grey = next(open_film(tmp_path / "linear").frames())
    assert grey.max() == pytest.approx(1.0, abs=0.01)
    assert grey[12, 16] == pytest.approx((radiance[12, 16, 0] / 50) ** (1 / 2.2), rel=0.01)


@pytest.mark.parametrize("colour", [False, True])
def test_netcdf(tmp_path, colour):
    values = np.array(frames(), dtype=np.float32) if colour else np.array([luma(p) for p in frames()])
    with netCDF4.Dataset(tmp_path / "f.nc", "w") as data:
        for name, size in (("time", COUNT), ("y", HEIGHT), ("x", WIDTH), ("rgb", 3)):
            data.createDimension(name, size)
        time = data.createVariable("time", "f8", ("time",))
        time.units = "milliseconds"
        time[:] = 20.0 * np.arange(COUNT)
        film = data.createVariable("intensity", "f4", ("time", "y", "x", "rgb")[: values.ndim])
        film[:] = values
    opened = open_film(tmp_path / "f.nc")
    assert opened.interval == pytest.approx(0.02)
    read = list(opened.frames())
    assert len(read) == COUNT
    scale = read[0][0, 0] / luma(frames()[0])[0, 0]
    assert read[3] == pytest.approx(scale * luma(frames()[3]), rel=1e-5)


def test_what_is_no_film(tmp_path):
    text = tmp_path / "notes.txt"
    text.write_text("not a film")
    for name in ("broken.mp4", "broken.gif", "broken.nc", "broken.avi"):
        (tmp_path / name).write_bytes(b"not a film at all" * 50)
        with pytest.raises(InputError, match=name):
            open_film(tmp_path / name)
    with pytest.raises(InputError, match=r"notes\.txt.*is no film.*expected a film \(\.mp4"):
        open_film(text)
    with pytest.raises(InputError, match="no such film"):
        open_film(tmp_path / "missing.mp4")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no numbered frames"):
        open_film(tmp_path / "empty")
    with netCDF4.Dataset(tmp_path / "two.nc", "w") as data:
        for name in ("time", "y", "x"):
            data.createDimension(name, 4)
        for name in ("a", "b"):
            data.createVariable(name, "f4", ("time", "y", "x"))
    with pytest.raises(InputError, match="which variable"):
        open_film(tmp_path / "two.nc")


def test_frames_of_different_size(tmp_path):
    for number, height in enumerate((24, 24, 20)):
        Image.new("RGB", (32, height)).save(tmp_path / f"{number:04d}.png")
    with pytest.raises(InputError, match="frame 2 has another size"):
        list(open_film(tmp_path).frames())


@pytest.mark.parametrize("kind", ["folder", "beside", "inside"])
def test_our_own_films_know_their_optics(tmp_path, kind):
    provenance = Provenance(scene=SCENE, command="nigemizu animate mine.toml")
    if kind == "inside":
        path = write_film(tmp_path / "mine.mp4", frames(), fps=25, provenance=provenance)
    else:
        folder = FrameFolder(tmp_path / "mine_frames", COUNT, provenance)
        for number, pixels in enumerate(frames()):
            folder.write(number, pixels)
        path = folder.path
        if kind == "beside":
            path = write_film(tmp_path / "mine.gif", frames(), fps=25)
    film = open_film(path)
    assert film.interval == pytest.approx(0.4)  # in the scene, whatever the speed of the film
    o = optics_of(film)
    assert o.pixel_angle == pytest.approx(1e-5)
    assert o.aperture == pytest.approx(0.05)
    assert o.distance == pytest.approx(1000.0)
    assert (o.wavelength, o.inner_scale) == (6e-7, 0.004)
    assert o.outer_scale == pytest.approx(3.0)
    assert o.cn2 / 1e-13 == pytest.approx(1.0, rel=1e-9)
    assert o.origin["aperture"] == "the scene's camera"
    typed = optics_of(film, distance=500.0, cn2=None)
    assert (typed.distance, typed.origin["distance"]) == (500.0, "typed")


def film_of(scene, width=WIDTH):
    blank = Film.from_frames([np.zeros((HEIGHT, width))])
    return Film(blank.path, blank.shape, None, scene, blank.reader)


def test_scenes_say_it_in_several_ways():
    view = {"camera": {"field_of_view": 4.0, "width": 64, "aperture": "60 mm", "focus_distance": "0.8 km"}}
    o = optics_of(film_of(view))
    # the film has half of the camera's pixels, so that each is twice as wide
    assert o.pixel_angle == pytest.approx(2 * math.tan(math.radians(2)) / 32)
    assert (o.aperture, o.distance) == (0.06, 800.0)
    sensor = {
        "focal_length": 0.5,
        "sensor_width": "36 mm",
        "f_number": 8,
        "focus_distance": 100.0,
        "width": 32,
    }
    assert optics_of(film_of({"camera": sensor})).pixel_angle == pytest.approx(
        0.036 * (1 / 0.5 - 1 / 100) / 32
    )
    only = {"camera": {"aperture": 0.1}, "objects": [{"kind": "box", "position": [300.0, 400.0, 1.7]}]}
    assert optics_of(film_of(only)).distance == pytest.approx(500.0)
    # an odd width that H.264 completed is not a film that was scaled
    odd = optics_of(film_of({"camera": {**view["camera"], "width": 31}}))
    assert odd.pixel_angle == pytest.approx(2 * math.tan(math.radians(2)) / 31)


def test_turbulence_that_falls_with_height_is_weighted_along_the_path():
    scene = {
        "camera": {"eye": [0.0, 0.0, 1.0], "target": [1000.0, 0.0, 10.0], "aperture": 0.05},
        "turbulence": {"cn2": 1e-13, "exponent": -4 / 3, "outer_scale_per_height": 1.0},
    }
    o = optics_of(film_of(scene))
    w = (np.arange(10000) + 0.5) / 10000
    z = 10 - 9 * w
    assert o.cn2 / 1e-13 == pytest.approx(np.average(z ** (-4 / 3), weights=w ** (5 / 3)), rel=1e-3)
    assert o.outer_scale == pytest.approx(np.average(z, weights=w ** (5 / 3)), rel=1e-3)


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ({}, ["--distance", "is missing", "--distance 1km"]),
        ({"distance": 1e3}, ["--aperture", "is missing"]),
        ({"distance": 1e3, "aperture": 0.1}, ["--pixel-angle", "is missing", "--focal-length"]),
        ({"distance": 1e3, "aperture": 0.1, "focal_length": 0.5}, ["--focal-length", "--pixel-pitch"]),
        ({"distance": 1e3, "aperture": 0.1, "pixel_pitch": 5e-6}, ["--pixel-pitch", "--focal-length"]),
        ({"distance": 1e3, "pixel_angle": 1e-5, "pixel_pitch": 5e-6}, ["--pixel-angle", "one of them"]),
        ({"distance": 1e3, "aperture": 0.0, "pixel_angle": 1e-5}, ["--inner-scale", "pinhole"]),
    ],
)
def test_optics_that_are_missing(typed, words):
    with pytest.raises(InputError) as raised:
        optics_of(film_of(None), **typed)
    assert all(word in str(raised.value) for word in words)
    assert "\n" not in str(raised.value)


def test_focal_length_and_pitch_make_the_angle():
    o = optics_of(film_of(None), distance=1e3, aperture=0.1, focal_length=0.5, pixel_pitch=5e-6)
    assert o.pixel_angle == pytest.approx(1e-5)
