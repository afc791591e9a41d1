"""``nigemizu trace --table``: what is printed, what is written, and what is refused."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xarray

Run = Callable[..., Any]

SEA = """
title = "Sea"
[earth]
radius = 6371000.0
[profile]
kind = "us1976"
[tracer]
method = "bent"
[camera]
eye = [0.0, 0.0, 10.0]
field_of_view = 2.0
[[objects]]
kind = "ground"
"""


@pytest.fixture
def sea(run: Run) -> str:
    """A scene file of the standard atmosphere over a sea."""
    Path("sea.toml").write_text(SEA, encoding="utf-8")
    return "sea.toml"


def assert_refused(done: Any, *words: str) -> None:
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("nigemizu: error: ")
    assert len(done.err.splitlines()) == 1
    assert "Traceback" not in done.err
    for word in words:
        assert word in done.err, f"{word!r} not in {done.err!r}"
    assert {entry.name for entry in Path().iterdir()} <= {"sea.toml"}


def test_refraction_as_a_table(run: Run, sea: str) -> None:
    done = run("trace", sea, "--table", "refraction", "--wavelength", "400nm,700e-9", "-e", "0,45,90")
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0] == "Sea: astronomical refraction, eye at 10 m"
    assert lines[2].split("  ") == ["apparent [°]", "400 nm [″]", "700 nm [″]", "true, 400 nm [°]"]
    assert len(lines) == 6
    zenith = lines[-1].split()
    assert [float(word) for word in zenith] == pytest.approx([90.0, 0.0, 0.0, 90.0], abs=1e-9)
    level = [float(word) for word in lines[3].split()]
    assert level[1] > level[2] > 1900


def test_all_of_the_refraction_as_json_and_csv(run: Run, sea: str) -> None:
    done = run("trace", sea, "--table", "refraction", "--json", "-o", "table.csv")
    assert (done.code, done.err) == (0, "table.csv\n")
    rows = json.loads(done.out)["refraction"]
    with Path("table.csv").open() as file:
        table = list(csv.DictReader(file))
    assert len(rows) == len(table) == 911  # every tenth of a degree, hundredths below, the horizon
    assert list(rows[0]) == list(table[0])
    assert rows[0]["apparent_elevation_deg"] == pytest.approx(-5.55 / 60, abs=1e-3)
    assert {row["status"] for row in rows} == {"escaped"}
    lifted = [row["refraction_arcsec"] for row in rows]
    assert lifted == sorted(lifted, reverse=True)


def test_the_horizon(run: Run, sea: str) -> None:
    done = run("trace", sea, "--table", "horizon", "--height", "1.5,1km")
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert [line.split()[0] for line in lines[3:]] == ["1.50", "1000.00"]
    assert float(lines[3].split()[1]) == pytest.approx(2.1493, abs=2e-4)
    assert run("trace", sea, "--table", "horizon").out.count("\n") == 13


def test_a_transfer_curve(run: Run, sea: str) -> None:
    done = run("trace", sea, "--table", "transfer", "--distance", "5km", "-e", "-0.05,0,0.5")
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0] == "Sea: object at 5 km: 1 image, 0 folds"
    assert lines[3].split()[0] == "erect"
    rays = [line.split() for line in lines[-3:]]
    # 10 m + 5 km × elevation + the drop of the ground over 5 km, less a sixth of it for refraction
    assert [float(ray[1]) for ray in rays] == pytest.approx([7.26, 11.63, 55.26], abs=0.05)
    read = json.loads(run("trace", sea, "--table", "transfer", "--distance", "5km", "--json").out)
    assert list(read) == ["distance", "folds", "bands", "rays"]
    assert len(read["rays"]) == 2001
    assert [ray["images"] for ray in read["rays"] if ray["height"] is not None].count(1) > 1000


@pytest.mark.parametrize(
    "name", ["curve.csv", "curve.nc", "curve.json", "curve.svg", "curve.png", "curve.pdf"]
)
def test_files_of_a_transfer_curve(run: Run, sea: str, name: str) -> None:
    done = run("trace", sea, "--table", "transfer", "--distance", "5km", "-o", name)
    assert (done.code, done.out, done.err) == (0, f"{name}\n", "")
    assert Path(name).stat().st_size > 1000


@pytest.mark.parametrize("name", ["stars.nc", "stars.json", "stars.svg", "stars.png"])
def test_files_of_refraction(run: Run, sea: str, name: str) -> None:
    done = run("trace", sea, "--table", "refraction", "--wavelength", "400nm,550nm,700nm", "-o", name)
    assert (done.code, done.out, done.err) == (0, f"{name}\n", "")
    if name.endswith(".nc"):
        with xarray.open_dataset(name) as dataset:
            assert dataset.sizes == {"elevation": 911, "wavelength": 3}
            assert dataset["refraction"].attrs["units"] == "rad"
            assert float(dataset["refraction"].max()) == pytest.approx(0.01, rel=0.1)
    if name.endswith(".svg"):
        drawn = Path(name).read_text(encoding="utf-8")
        for words in ("refraction (′)", "lifted more than 550 nm (″)", "apparent elevation (°)"):
            assert f"<!-- {words} -->" in drawn


@pytest.mark.parametrize("name", ["dip.nc", "dip.json", "dip.csv"])
def test_files_of_the_horizon(run: Run, sea: str, name: str) -> None:
    done = run("trace", sea, "--table", "horizon", "-o", name)
    assert (done.code, done.out, done.err) == (0, f"{name}\n", "")
    if name.endswith(".nc"):
        with xarray.open_dataset(name) as dataset:
            assert dataset["dip"].sizes == {"height": 10}
            assert "us1976" in dataset.attrs["nigemizu_scene"]
    if name.endswith(".csv"):
        assert Path(name).read_text().startswith("height,dip_arcmin,distance_km,geometric_dip_arcmin,")


def test_near_the_horizon_all_colours_are_drawn(run: Run, sea: str) -> None:
    typed = ("--wavelength", "400nm,700nm", "-e", "0:1:0.1", "-o", "low.svg")
    assert run("trace", sea, "--table", "refraction", *typed).code == 0
    drawn = Path("low.svg").read_text(encoding="utf-8")
    for words in ("400 nm", "700 nm", "apparent elevation (′)"):
        assert f"<!-- {words} -->" in drawn
    assert "lifted more" not in drawn


def test_air_that_is_heated(run: Run, small: tuple[str, ...]) -> None:
    warm = (*small, "--set=grid.cells=[8, 4, 40]", "--set=time.duration=200")
    done = run("trace", "pyramid", "--table", "transfer", "--distance", "600", *warm)
    assert (done.code, done.err) == (0, "")
    assert "inverted" in done.out


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["--table", "transfer"], ["--distance", "--distance 10km"]),
        (["--table", "transfer", "--distance", "-3km"], ["distance", "-3000.0", "metres"]),
        (["--table", "transfer", "--distance", "1km,2km"], ["--distance", "one number"]),
        (["--table", "transfer", "--distance", "3 kg"], ["--distance", "'3 kg'", "km"]),
        (["--table", "transfer", "--distance", "60km", "-e", "-0.3:-0.1:0.01"], ["60 km", "meet the ground"]),
        (["--table", "transfer", "--distance", "2000km", "-e", "80"], ["2000 km", "leave the air"]),
        (["--table", "transfer", "--distance", "1km", "-e", "-90"], ["elevation", "-90", "-89 to 89"]),
        (["--table", "transfer", "--distance", "1km", "--wavelength", "1um"], ["--wavelength", "--set air."]),
        (["--table", "refraction", "-e", "91"], ["elevation", "91", "-90 to 90"]),
        (["--table", "refraction", "--wavelength", "9e-6"], ["wavelength", "9e-06", "300e-9"]),
        (["--table", "refraction", "--wavelength", "blue"], ["--wavelength", "'blue'", "nm"]),
        (
            ["--table", "refraction", "--wavelength", "400nm", "--set=air.model='lehn1978'"],
            ["air.model", "'lehn1978'", "ciddor1996"],
        ),
        (["--table", "refraction", "--distance", "1km"], ["--distance", "--table transfer"]),
        (["--table", "refraction", "-a", "3"], ["--azimuth", "all around"]),
        (["--table", "horizon", "--height", "-1"], ["height", "-1", "ground at 0"]),
        (["--table", "horizon", "-o", "dip.png"], [".png", ".csv"]),
        (["--table", "stars"], ["--table", "'stars'", "refraction"]),
        (["--table", "refraction", "--set=earth.flat=true"], ["earth.flat", "flat = true"]),
        (["--json", "--distance", "1km"], ["--distance", "--table transfer"]),
        (["--json", "--height", "1"], ["--height", "--table horizon"]),
    ],
)  # fmt: skip
def test_what_is_refused(run: Run, sea: str, typed: list[str], words: list[str]) -> None:
    assert_refused(run("trace", sea, *typed), *words)


def test_a_scene_without_layers_has_no_refraction(run: Run) -> None:
    for table in ("refraction", "horizon"):
        assert_refused(run("trace", "pyramid", "--table", table), "pyramid", "profile", "us1976")
