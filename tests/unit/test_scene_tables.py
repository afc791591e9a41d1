"""Tables and curves: folds of known curves, columns, files, and what is refused."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.scene.measuring.columns import Column, plain, records, text_table
from nigemizu.scene.measuring.folds import find_images, image_count
from nigemizu.scene.measuring.transfer import curve_through
from nigemizu.scene.measuring.transfer_rays import Arrivals

FloatArray = NDArray[np.float64]
EDGE = math.pi / 10


def images(curve: Callable[[FloatArray], FloatArray], low: float, high: float, count: int = 41):  # type: ignore[no-untyped-def]
    places = np.linspace(low, high, count)
    return find_images(curve, places, curve(places), tolerance=1e-12)


def test_folds_of_a_cubic() -> None:
    """h = e³ − 3e has its folds at e = ∓1, where h = ±2; between them each height is seen three times."""
    folds, bands = images(lambda e: e**3 - 3 * e, -3.0, 3.0)
    assert [fold.kind for fold in folds] == ["highest", "lowest"]
    assert [fold.elevation for fold in folds] == pytest.approx([-1.0, 1.0], rel=0, abs=1e-6)
    assert [fold.height for fold in folds] == pytest.approx([2.0, -2.0], rel=0, abs=1e-12)
    assert [band.erect for band in bands] == [True, False, True]
    assert image_count(bands, [-2.1, -1.9, 0.0, 1.9, 2.1, np.nan]).tolist() == [1, 3, 3, 3, 1, 0]


def test_a_curve_that_rises_has_one_image_and_no_fold() -> None:
    folds, bands = images(lambda e: e**3 + 0.1 * e, -3.0, 3.0)
    assert folds == ()
    assert [(band.low, band.high, band.erect) for band in bands] == [(-3.0, 3.0, True)]


def test_folds_that_are_corners() -> None:
    """Layers of constant slope make corners: |e − 0.1234| has its lowest there."""
    folds, _ = images(lambda e: np.abs(e - 0.1234), -1.0, 1.0)
    assert len(folds) == 1
    assert folds[0].elevation == pytest.approx(0.1234, rel=0, abs=1e-11)
    assert folds[0].kind == "lowest"


def test_edges_where_rays_begin_to_come() -> None:
    """Of e < π/10 nothing comes; of e > 2 nothing either. A fold right behind the edge is found, too."""

    def curve(e: FloatArray) -> FloatArray:
        return np.where((e >= EDGE) & (e <= 2.0), (e - EDGE - 0.2) ** 2, np.nan)

    folds, bands = images(curve, 0.0, 3.0)
    assert [fold.elevation for fold in folds] == pytest.approx([EDGE + 0.2], rel=0, abs=1e-6)
    assert [bands[0].low, bands[-1].high] == pytest.approx([EDGE, 2.0], rel=0, abs=2e-12)
    assert bands[0].low >= EDGE
    assert [bands[0].low_height, bands[0].high_height] == pytest.approx([0.04, 0.0], rel=0, abs=1e-11)


def test_what_differs_by_less_than_the_error_is_no_fold() -> None:
    def noisy(e: FloatArray) -> FloatArray:
        return e + 1e-3 * np.sin(1e4 * e)

    places = np.linspace(-1.0, 1.0, 2001)
    assert find_images(noisy, places, noisy(places), tolerance=3e-3)[0] == ()
    assert len(find_images(noisy, places, noisy(places), tolerance=1e-6)[0]) > 100


def test_no_ray_comes() -> None:
    places = np.linspace(0.0, 1.0, 5)
    assert find_images(lambda e: np.full(e.shape, np.nan), places, np.full(5, np.nan), tolerance=1e-9) == (
        (),
        (),
    )


@pytest.mark.parametrize(("radius", "eye"), [(math.inf, 3.0), (6371e3, 12.0)])
def test_without_air_nothing_is_magnified(radius: float, eye: float) -> None:
    """Straight rays over a plane, and over a sphere in polar coordinates: magnification 1, one image."""
    distance = 20e3

    def straight(e: FloatArray) -> Arrivals:
        if math.isinf(radius):
            height = eye + distance * np.tan(e)
        else:  # r cos(e + φ) = r₀ cos e, to 60 digits' worth of room by the difference of two tangents
            phi = distance / radius
            height = eye + (radius + eye) * (np.cos(e) / np.cos(e + phi) - 1)
        return Arrivals(height, np.full(e.shape, np.nan))

    curve = curve_through(straight, np.linspace(-0.1, 0.3, 7), distance, eye=eye, radius=radius)
    assert curve.magnification == pytest.approx(np.ones(7), rel=0, abs=1e-6)
    assert curve.straight == pytest.approx(curve.height, rel=0, abs=1e-8)
    assert curve.images.tolist() == [1] * 7
    assert curve.folds == ()
    # −h₀ at the foot: the drop of the ground, which a plane does not have
    drop = 0.0 if math.isinf(radius) else distance**2 / 2 / radius
    level = curve_through(straight, [0.0], distance, eye=eye, radius=radius)
    assert level.height[0] == pytest.approx(eye + drop, rel=0, abs=1e-3)


def cubic_curve() -> object:
    """A curve with three images, at 1 km."""

    def flight(e: FloatArray) -> Arrivals:
        minutes = np.degrees(e) * 60
        height = np.where(minutes > -6, 10 + minutes**3 / 10 - minutes, np.nan)
        return Arrivals(height, np.where(minutes > -6, np.nan, 900.0))

    return curve_through(flight, np.linspace(-8, 8, 33) / 60, 1e3, eye=2.0)


def test_records_and_files_of_a_curve(tmp_path: Path) -> None:
    curve = cubic_curve()
    rows = curve.as_records()  # type: ignore[attr-defined]
    assert len(rows) == 33
    assert rows[0]["height"] is None
    assert rows[0]["ground_distance"] == 900.0
    assert rows[16]["images"] == 3
    for kind in ("csv", "nc", "json", "svg", "png", "pdf"):
        curve.save(tmp_path / f"curve.{kind}")  # type: ignore[attr-defined]
    with (tmp_path / "curve.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["elevation_deg"] for row in table] == [str(row["elevation_deg"]) for row in rows]
    assert table[0]["height"] == ""
    read = json.loads((tmp_path / "curve.json").read_text())
    assert [band["erect"] for band in read["bands"]] == [True, False, True]
    with xarray.open_dataset(tmp_path / "curve.nc") as dataset:
        assert dataset.sizes == {"elevation": 33, "fold": 2, "band": 3}
        assert dataset["fold_elevation"].values * 60 == pytest.approx(
            [-math.sqrt(10 / 3), math.sqrt(10 / 3)], rel=0, abs=1e-3
        )
    drawn = (tmp_path / "curve.svg").read_text(encoding="utf-8")
    # Each text is drawn as outlines: with itself as a comment, or with a halo and its identifier.
    for words in ("erect", "inverted", "without air", "apparent elevation (′)"):
        assert f"<!-- {words} -->" in drawn
    assert 'id="fold −1.83′, 11.2 m"' in drawn
    with pytest.raises(InputError, match=r"\.csv"):
        curve.save(tmp_path / "curve.xlsx")  # type: ignore[attr-defined]


def test_columns_show_what_is_missing() -> None:
    columns = [Column("a", np.array([1.0, np.nan, np.inf]), "A [m]", 1), Column("b", np.array([1, 2, 3]))]
    assert records(columns) == [{"a": 1.0, "b": 1}, {"a": None, "b": 2}, {"a": None, "b": 3}]
    assert text_table(columns, [0, 2]) == ["A [m]      b", "  1.0  1.000", "    –  3.000"]
    assert plain(np.float64(2.5)) == 2.5
    assert plain("x") == "x"
