"""The number that tells whether a film goes on in the same air."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray

from nigemizu import InputError
from nigemizu.heat import Grid
from nigemizu.output import write_air
from nigemizu.scene import Scene
from nigemizu.scene.digest import air_digest
from nigemizu.scene.running import AirVolume

GRID = Grid(np.linspace(0.0, 8.0, 5), np.linspace(-2.0, 2.0, 3), np.linspace(0.0, 2.0, 5))


def air(warmer: float = 0.0) -> xarray.Dataset:
    values = np.full((4, 2, 4), 300.0) + warmer * (np.arange(32).reshape(4, 2, 4) == 5)
    axes = {"z": GRID.z, "y": GRID.y, "x": GRID.x}
    data = xarray.Dataset({"air_temperature": (("z", "y", "x"), values, {"units": "K"})}, coords=axes)
    for axis in axes:
        data[axis].attrs["units"] = "m"
    return data


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_contents_count_and_the_place_does_not(tmp_path: Path, suffix: str) -> None:
    first = write_air(air=air(), path=tmp_path / f"a{suffix}")
    moved = tmp_path / "elsewhere" / f"b{suffix}"
    (shutil.copytree if first.is_dir() else _copy)(first, moved)
    changed = write_air(air=air(1e-9), path=tmp_path / f"c{suffix}")
    assert air_digest(first) == air_digest(str(moved))
    assert air_digest(first) != air_digest(changed)


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir()
    shutil.copy(source, target)


def test_a_lost_chunk_counts(tmp_path: Path) -> None:
    store = write_air(air=air(), path=tmp_path / "a.zarr")
    before = air_digest(store)
    chunk = max((path for path in store.rglob("*") if path.is_file()), key=lambda path: len(path.parts))
    chunk.unlink()
    assert air_digest(store) != before


def test_air_in_memory() -> None:
    assert air_digest(air()) == air_digest(air())
    assert air_digest(air()) != air_digest(air(1e-9))
    volume = AirVolume(GRID.x, GRID.y, GRID.z, np.full((4, 2, 4), 2.6e-4))
    changed = volume._replace(refractivity=volume.refractivity * (1 + 1e-15))
    assert air_digest(volume) == air_digest(AirVolume(*volume))
    assert air_digest(volume) != air_digest(changed)
    assert air_digest(None) is None


def test_a_film_goes_on_only_in_the_same_air(tmp_path: Path) -> None:
    small = {"camera.width": 16, "camera.height": 8, "camera.samples": 1, "film.frames": 2}
    scene = Scene.load("pyramid", small)
    stored = write_air(air=air(), path=tmp_path / "air.nc")
    film = scene.animate(tmp_path / "film.mp4", air=stored)
    film.unlink()
    frames = tmp_path / "film_frames"
    done = {path.name: path.stat().st_mtime_ns for path in frames.glob("*.png")}
    assert len(done) == 2

    moved = stored.rename(tmp_path / "moved.nc")
    scene.animate(film, air=moved)
    assert {path.name: path.stat().st_mtime_ns for path in frames.glob("*.png")} == done

    write_air(air=air(0.5), path=moved)
    with pytest.raises(InputError, match="made otherwise: air was 'sha256:"):
        scene.animate(film, air=moved)
