"""Films of moving air with an exposure time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nigemizu.errors import InputError
from nigemizu.output import read_picture
from nigemizu.scene import Scene

SMALL = {
    "grid.cells": [8, 4, 24],
    "time.duration": 1.0,
    "time.picture": 1.0,
    "film.start": 0.0,
    "film.duration": 0.6,
    "film.frames": 3,
    "camera.width": 24,
    "camera.height": 16,
    "camera.samples": 4,
    "camera.shutter": 0.1,
    "camera.shutter_instants": 2,
}


def scene(**overrides: Any) -> Scene:
    return Scene.load("road", SMALL | {"initial.unevenness": []} | overrides)


@pytest.mark.filterwarnings("ignore::nigemizu.errors.NigemizuWarning")
def test_a_frame_is_the_picture_of_its_exposure(tmp_path: Path) -> None:
    """Each frame looks through the air of its own instants: the one at 0.2 s as when it is rendered alone,
    and, when it is missing from a film that was interrupted, as before."""
    film = scene()
    film.animate(tmp_path / "film.mp4")
    frames = sorted((tmp_path / "film_frames").glob("[0-9]*.png"))
    assert len(frames) == 3
    before = frames[1].read_bytes()
    frames[1].unlink()
    film.animate(tmp_path / "film.mp4")
    assert frames[1].read_bytes() == before
    still = scene(**{"camera.shutter": 0.0})
    still.animate(tmp_path / "still.mp4")
    other = read_picture(tmp_path / "still_frames" / frames[1].name)
    assert not np.array_equal(read_picture(frames[1]), other)


@pytest.mark.filterwarnings("ignore::nigemizu.errors.NigemizuWarning")
def test_an_exposure_longer_than_a_frame_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"camera\.shutter.*longer than a frame"):
        scene(**{"camera.shutter": 0.9}).animate(tmp_path / "film.mp4")
    assert not list(tmp_path.iterdir())
