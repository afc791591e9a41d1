"""Ground truth beside pictures and films."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from nigemizu.output import read_layers

Run = Callable[..., Any]


def test_truth_goes_beside_the_picture(run: Run, small: tuple[str, ...]) -> None:
    done = run("render", "pyramid", "-o", "out.png", "--truth", *small)
    assert done.code == 0, done.err
    names = {"out.png", "out_truth.exr", "out_truth.nc", "out_truth.png"}
    assert {entry.name for entry in Path().iterdir()} == names
    layers = read_layers("out_truth.exr")
    with xr.open_dataset("out_truth.nc") as truth:
        assert truth.sizes == {"row": 18, "column": 32, "colour": 3}
        assert set(truth["status"].attrs["flag_meanings"].split()) >= {"hit", "escaped", "out-of-steps"}
        for channel, name in (("displacement.y", "displacement_y"), ("path_length.m", "path_length")):
            assert np.allclose(layers[channel], truth[name], equal_nan=True)
        assert np.allclose(layers["R"], truth["radiance"][..., 0])
        # the mirage: somewhere the picture differs from the straight view, and there things are displaced
        differs = np.abs(truth["radiance"] - truth["straight_radiance"]).max("colour").values > 0.1
        assert np.abs(truth["displacement_y"].values[differs]).max() > 1
        assert truth.attrs["pixel_angle_rad"] > 0


def test_truth_of_a_lens_is_that_through_its_middle(run: Run, small: tuple[str, ...]) -> None:
    lens = ("--set=camera.aperture=0.05", "--set=camera.focus_distance=700")
    for name, more in (("pinhole", ()), ("lens", lens)):
        done = run("render", "pyramid", "-o", f"{name}.png", "--truth", *small, *more)
        assert done.code == 0, done.err
    with xr.open_dataset("pinhole_truth.nc") as one, xr.open_dataset("lens_truth.nc") as other:
        assert np.allclose(one["displacement_y"], other["displacement_y"], equal_nan=True, atol=1e-3)


def test_truth_beside_the_frames_of_a_film(run: Run, small: tuple[str, ...]) -> None:
    """A frame whose truth is missing is made again."""
    command = ("animate", "pyramid", "-o", "film.mp4", "--frames", "2", "--truth", *small)
    assert run(*command).code == 0
    names = {"0000.exr", "0000.nc", "0001.exr", "0001.nc"}
    assert {entry.name for entry in Path("film_truth").iterdir()} == names
    Path("film_truth/0001.nc").unlink()
    assert run(*command).code == 0
    assert {entry.name for entry in Path("film_truth").iterdir()} == names


def test_truth_is_of_one_picture(run: Run, small: tuple[str, ...]) -> None:
    done = run("render", "pyramid", "-o", "out.png", "--truth", "--compare", *small)
    assert done.code == 2
    assert "--compare" in done.err
