"""The figure of a displacement."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from nigemizu.errors import InputError
from nigemizu.output import Provenance, displacement_figure


def shifts(height: int, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    y, x = np.mgrid[0:height, 0:width] / min(height, width)
    across = np.sin(6 * x) * np.exp(-y)
    across[:3, :3] = np.nan
    return np.full((height, width, 3), 0.4), across, 0.3 * np.cos(5 * y)


@pytest.mark.parametrize("size", [(30, 50), (50, 30)])
def test_four_panels_in_one_file(tmp_path: Path, size: tuple[int, int]) -> None:
    """Tall pictures stand side by side, wide ones in two rows."""
    path = displacement_figure(tmp_path / "out.png", *shifts(*size), title="a plume")
    with Image.open(path) as figure:
        wide = figure.width / figure.height
        colours = figure.convert("RGB").getcolors(1 << 20)
    assert (1.1 < wide < 1.9) if size[1] > size[0] else (1.7 < wide < 3.0)
    assert colours is not None
    assert len(colours) > 300


def test_equal_figures_are_equal_files(tmp_path: Path) -> None:
    made = Provenance(scene="x = 1", command="nigemizu render plume --truth")
    files = [
        displacement_figure(tmp_path / name, *shifts(20, 30), provenance=made) for name in ("a.svg", "b.svg")
    ]
    assert files[0].read_bytes() == files[1].read_bytes()
    assert b"render plume" in files[0].read_bytes()


def test_nothing_known_is_drawn_all_the_same(tmp_path: Path) -> None:
    lost = np.full((10, 12), np.nan)
    assert displacement_figure(tmp_path / "out.png", np.zeros((10, 12, 3)), lost, lost).exists()


def test_an_unknown_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.jpg"):
        displacement_figure(tmp_path / "out.jpg", *shifts(10, 10))
