"""``nigemizu measure`` as a person types it."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from nigemizu.output import write_film

Run = Callable[..., Any]

OPTICS = ("--distance", "1km", "--aperture", "50mm", "--pixel-angle", "1e-5")


@pytest.fixture
def film(run: Run) -> str:
    """A film of noise that jumps by 0.8 pixels (rms) as a whole, and where it lies."""
    rng = np.random.default_rng(1)
    f = np.fft.fftfreq(104)
    radius = np.hypot(f[:, None], f[None, :])
    band = np.where((radius > 1 / 40) & (radius < 1 / 4), 1 / np.maximum(radius, 1e-6), 0.0)
    spectrum = np.fft.fft2(rng.standard_normal((104, 104))) * band
    scale = 40 / np.fft.ifft2(spectrum).real.std()
    frames = []
    for x, y in 0.8 * rng.standard_normal((40, 2)):
        turned = np.exp(-2j * np.pi * (f[None, :] * x + f[:, None] * y))
        grey = 128 + scale * np.fft.ifft2(spectrum * turned).real
        frames.append(np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[..., None], 3, axis=2))
    write_film("shimmer.mp4", frames, fps=20)
    return "shimmer.mp4"


def test_the_table(run: Run, film: str) -> None:
    done = run("measure", film, *OPTICS, "--cn2", "1e-13", "--tile", "24", "--points")
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0] == "shimmer.mp4: 40 frames of 104×104 pixels, one every 0.05 s"
    assert "9 show motion in x and y" in lines[1]
    assert lines[2].startswith("path 1000 m, aperture 50 mm, 10 µrad per pixel, 550 nm, spherical wave")
    heads = next(line for line in lines if "95 % interval" in line)
    assert heads.split()[-2:] == ["theory", "ratio"]
    r0 = next(line.split() for line in lines if line.startswith("r0 "))
    assert float(r0[2]) == pytest.approx(0.0249, rel=0.2)
    assert "0.01024" in r0
    assert max(map(len, lines)) < 180


def test_json_and_files(run: Run, film: str) -> None:
    outputs = ["tiles.csv", "tiles.nc", "shimmer.png", "shimmer.svg"]
    flags = [word for name in outputs for word in ("-o", name)]
    done = run("measure", film, *OPTICS, "--json", "--tile", "24", "--cn2", "1e-14", *flags)
    assert done.code == 0
    assert done.err.splitlines() == outputs
    told = json.loads(done.out)
    variance = told["quantities"]["variance"]
    assert variance["unit"] == "rad²"
    assert 1e10 * variance["value"] == pytest.approx(0.64, rel=0.3)
    assert variance["low"] < variance["value"] < variance["high"]
    assert variance["ratio"] == pytest.approx(variance["value"] / variance["theory"])
    assert told["tile_kinds"] == {"xy": 9, "x": 0, "y": 0, "oblique": 0, "none": 0}
    assert told["interval"] == 0.05
    assert told["origin"]["distance"] == "typed"
    with Path("tiles.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 9
    x = np.mean([float(row["variance_x_rad2"]) for row in rows])
    assert x / told["quantities"]["variance_x"]["value"] == pytest.approx(1 - 1 / 40, rel=0.02)
    with xr.open_dataset("tiles.nc") as data:
        assert dict(data.sizes)["tile"] == 9
        assert data.attrs["variance"] / variance["value"] == pytest.approx(1.0)
        assert data.attrs["cn2_theory"] == 1e-14
        assert data.attrs["command"].startswith("nigemizu measure shimmer.mp4")
        assert data.variance.attrs["units"] == "rad2"
    with Image.open("shimmer.png") as picture:
        assert picture.size == (1680, 1120)
        assert picture.info["Command"].startswith("nigemizu measure")
    assert "<svg" in Path("shimmer.svg").read_text(encoding="utf-8")


def test_nothing_is_compared_where_nothing_is_stated(run: Run, film: str) -> None:
    lens = ("--focal-length", "500mm", "--pixel-pitch", "5um", "--aperture", "50mm", "--distance", "1km")
    done = run("measure", film, *lens, "--remove-shake", "--tile", "24", "--fps", "50", "-o", "plain.png")
    assert done.code == 0
    assert "theory" not in done.out
    assert "one every 0.02 s" in done.out
    assert "taken out" in done.out
    assert Path("plain.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ((), ["shimmer.mp4", "--distance", "is missing"]),
        (("--distance", "1km"), ["--aperture", "is missing"]),
        (("--distance", "1km", "--aperture", "0", "--pixel-angle", "1e-5"), ["--inner-scale", "pinhole"]),
        (("--distance", "far"), ["--distance", "'far'", "km"]),
        (("--distance", "1 s"), ["--distance", "'1 s'", "km"]),
        ((*OPTICS, "--distance", "-5"), ["--distance", "-5"]),
        ((*OPTICS, "--fps", "0"), ["--fps", "0"]),
        ((*OPTICS, "--tile", "500"), ["--tile", "500", "104×104"]),
        ((*OPTICS, "--cn2", "0"), ["--cn2", "above 0"]),
        ((*OPTICS, "-o", "out.txt"), ["out.txt", ".csv"]),
        ((*OPTICS, "--wave", "square"), ["--wave", "spherical"]),
        ((*OPTICS, "--apperture", "1"), ["--apperture", "did you mean --aperture?"]),
    ],
)
def test_bad_flags(run: Run, film: str, typed: tuple[str, ...], words: list[str]) -> None:
    refused(run("measure", film, *typed), *words)
    assert [entry.name for entry in Path().iterdir()] == ["shimmer.mp4"]


def test_bad_films(run: Run) -> None:
    still = [np.full((96, 96, 3), 120, dtype=np.uint8)] * 20
    write_film("still.mp4", still, fps=20)
    refused(run("measure", "still.mp4", *OPTICS), "still.mp4", "equal")
    write_film("short.gif", [np.full((96, 96, 3), 9 * n, dtype=np.uint8) for n in range(5)], fps=20)
    refused(run("measure", "short.gif", *OPTICS), "short.gif", "5 frames", "16")
    write_film("grey.gif", [np.full((96, 96, 3), 9 * n, dtype=np.uint8) for n in range(20)], fps=20)
    refused(run("measure", "grey.gif", *OPTICS), "grey.gif", "texture")
    Path("notes.mp4").write_text("no film")
    refused(run("measure", "notes.mp4", *OPTICS), "notes.mp4", "no film")
    refused(run("measure", "gone.mp4", *OPTICS), "gone.mp4", "no such film")


def refused(done: Any, *words: str) -> None:
    """Exit code 2, nothing on stdout, one line that holds all `words`."""
    assert done.code == 2
    assert done.out == ""
    assert len(done.err.splitlines()) == 1
    for word in words:
        assert word in done.err, f"{word!r} not in {done.err!r}"
