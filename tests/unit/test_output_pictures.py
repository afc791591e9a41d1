"""Pictures: the transfer curve, what is inside the files, and what is refused."""

import errno
import os
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from nigemizu.errors import InputError, MachineError
from nigemizu.output import Provenance, encoded, read_picture, write_exr, write_picture, write_png

MADE = Provenance(
    scene='title = "Wüste"\n[camera]\nsamples = 4\n', command="nigemizu render pyramid -o a.png"
)
RAMP = np.linspace(0.0, 1.5, 5 * 7 * 3, dtype=np.float32).reshape(5, 7, 3)


def even(value):
    """Enough pixels of one brightness for their mean to be known to 0.01 of a step."""
    return np.full((128, 128, 3), value)


@pytest.mark.parametrize(
    ("linear", "expected"),
    # IEC 61966-2-1: 18 % grey is 117.65, 50 % is 187.52, the straight part ends at 0.0031308 (10.31)
    [(0.0031308, 10.31), (0.001, 3.295), (0.18, 117.65), (0.5, 187.52)],
)
def test_srgb(linear, expected):
    steps = encoded(even(linear))
    assert steps.mean() == pytest.approx(expected, abs=0.02)
    assert set(np.unique(steps)) == {int(expected), int(expected) + 1}


@pytest.mark.parametrize(("linear", "expected"), [(0.0, 0), (-1.0, 0), (1.0, 255), (7.0, 255)])
def test_black_and_white_stay_pure(linear, expected):
    assert (encoded(even(linear)) == expected).all()


def test_exposure_is_counted_in_stops():
    assert np.array_equal(encoded(even(0.09), exposure=1.0), encoded(even(0.18)))
    assert np.array_equal(encoded(even(0.36), exposure=-1.0), encoded(even(0.18)))


def sky(rows=200, columns=1200):
    """A slow ramp: three steps of 8 bits from left to right, as linear radiance and in steps."""
    steps = np.broadcast_to(np.linspace(150.2, 153.2, columns)[None, :, None], (rows, columns, 3))
    return ((steps / 255.0 + 0.055) / 1.055) ** 2.4, steps


def longest_contour(picture):
    """Longest straight piece of an edge along which a picture steps up, in pixels."""
    up = np.diff(picture.astype(int), axis=1) > 0
    longest = run = np.zeros(up.shape[1:], int)
    for row in up:
        run = (run + 1) * row
        longest = np.maximum(longest, run)
    return int(longest.max())


def test_dither_keeps_the_mean():
    linear, steps = sky()
    # 720 000 pixels, each off by half a step at most: a standard error of at most 0.0006
    assert encoded(linear).mean() == pytest.approx(steps.mean(), abs=1e-3)
    halves = encoded(linear).astype(float).reshape(200, 12, 100, 3).mean(axis=(0, 2, 3))
    assert halves == pytest.approx(steps.reshape(200, 12, 100, 3).mean(axis=(0, 2, 3)), abs=0.01)


def test_smooth_skies_have_no_contours():
    linear, steps = sky()
    rounded = (steps + 0.5).astype(np.uint8)
    assert longest_contour(rounded) == 200  # rounding draws a line from top to bottom
    # An edge goes on with a chance of 1/4 at most per row: 12 rows by chance once in 70 such pictures.
    assert longest_contour(encoded(linear)) < 12


def test_dither_is_the_same_in_every_picture():
    tall, wide = encoded(even(0.3)), encoded(np.full((128, 200, 3), 0.3))
    assert np.array_equal(tall, wide[:, :128])
    colours = tall.astype(float) - tall.mean()
    between = [np.mean(colours[..., a] * colours[..., b]) for a, b in ((0, 1), (0, 2), (1, 2))]
    assert max(np.abs(between)) < 0.05 * colours.var()


def test_soft_highlights_leave_the_rest_alone():
    """Unchanged up to 0.8, one slope there, monotonic, 1 is reached only at infinity (up to rounding)."""
    values = np.linspace(0.0, 3.0, 301)
    pixels = np.broadcast_to(values[None, :, None], (2000, 301, 3))
    clipped, soft = (encoded(pixels, highlights=kind).mean(axis=(0, 2)) for kind in ("clip", "soft"))
    assert np.array_equal(clipped[:81], soft[:81])
    assert np.all(np.diff(soft) > -0.05)
    assert soft[100] < 255 == clipped[100]
    # 0.8 + 0.2 (1 - exp(-1)) = 0.9264 at a value of one, 246.57 in sRGB
    assert soft[100] == pytest.approx(246.57, abs=0.05)
    assert soft[-1] == pytest.approx(255, abs=0.01)


def test_png_reads_back_with_its_provenance(tmp_path):
    path = write_png(tmp_path / "a.png", RAMP, provenance=MADE)
    assert np.array_equal(read_picture(path), encoded(RAMP))
    with Image.open(path) as image:
        assert image.text["Scene"] == MADE.scene
        assert image.text["Command"] == MADE.command
        assert image.text["Software"].startswith("nigemizu ")
        assert "srgb" in image.info


def test_first_row_is_the_top(tmp_path):
    pixels = np.zeros((3, 2, 3), np.float32)
    pixels[0, 1, 0] = 1.0
    with Image.open(write_png(tmp_path / "a.png", pixels)) as image:
        assert image.getpixel((1, 0)) == (255, 0, 0)
    assert read_picture(write_exr(tmp_path / "a.exr", pixels))[0, 1, 0] == 1.0


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_equal_work_gives_equal_bytes(tmp_path, name):
    first = write_picture(tmp_path / name, RAMP, provenance=MADE).read_bytes()
    assert write_picture(tmp_path / name, RAMP, provenance=MADE).read_bytes() == first
    assert write_picture(tmp_path / name, RAMP * 0.9, provenance=MADE).read_bytes() != first


def test_exr_keeps_every_bit(tmp_path):
    bright = RAMP * 1e4
    path = write_exr(tmp_path / "a.exr", bright, provenance=MADE)
    assert np.array_equal(read_picture(path), bright)
    with OpenEXR.File(str(path)) as file:
        assert file.header()["scene"] == MADE.scene
        assert file.header()["software"].startswith("nigemizu ")


def test_half_precision_keeps_three_digits_and_stays_finite(tmp_path):
    path = write_exr(tmp_path / "a.exr", RAMP * 1e5, half=True)
    values = read_picture(path)
    assert values.dtype == np.float16
    assert np.isfinite(values).all()
    inside = (RAMP > 0.01) & (RAMP * 1e5 < 65504)
    assert values[inside].astype(float) == pytest.approx(RAMP[inside] * 1e5, rel=2.0**-11)


def test_exposure_scales_an_exr(tmp_path):
    assert np.array_equal(read_picture(write_picture(tmp_path / "a.exr", RAMP, exposure=2.0)), 4 * RAMP)


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (np.zeros((4, 4)), r"not a picture \(got \(4, 4\)\); expected the shape"),
        (np.zeros((0, 4, 3)), "not a picture"),
        (
            np.where(np.arange(12).reshape(2, 2, 3) == 7, np.nan, 0.0),
            "1 values are not finite.*row 1, column 0",
        ),
    ],
)
@pytest.mark.parametrize("write", [write_png, write_exr])
def test_what_is_no_picture(tmp_path, write, pixels, words):
    with pytest.raises(InputError, match=words):
        write(tmp_path / "a.png", pixels)
    assert list(tmp_path.iterdir()) == []


def test_bytes_must_be_a_picture_too(tmp_path):
    with pytest.raises(InputError, match="not a picture"):
        write_png(tmp_path / "a.png", np.zeros((4, 4, 2), np.uint8))


def test_unknown_kind(tmp_path):
    with pytest.raises(InputError, match=r"'\.jpg'.*\.png or \.exr"):
        write_picture(tmp_path / "a.jpg", RAMP)


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_full_disk_leaves_nothing(tmp_path, name, monkeypatch):
    def full(path, content):
        with open(path, "wb") as file:
            file.write(content[:10])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(MachineError, match=f"{name}: the disk is full"):
        write_picture(tmp_path / name, RAMP)
    assert list(tmp_path.iterdir()) == []


def test_folder_that_is_a_file(tmp_path):
    (tmp_path / "folder").write_text("a file")
    with pytest.raises(InputError, match="Not a directory"):
        write_png(tmp_path / "folder" / "a.png", RAMP)


def test_reading_what_is_not_there(tmp_path):
    with pytest.raises(InputError, match="no such picture"):
        read_picture(tmp_path / "a.png")
    for name in ("a.png", "a.exr"):
        (tmp_path / name).write_text("no picture")
        with pytest.raises(InputError, match="not a picture that can be read"):
            read_picture(tmp_path / name)
