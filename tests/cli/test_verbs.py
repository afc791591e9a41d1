"""Every verb as a person types it."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

Run = Callable[..., Any]


def test_render_writes_the_picture_and_says_where(run: Run, small: tuple[str, ...]) -> None:
    done = run("render", "pyramid", "-o", "mirage.png", *small, "--time", "1 s", "--seed", "3")
    assert (done.code, done.out, done.err) == (0, "mirage.png\n", "")
    with Image.open("mirage.png") as picture:
        assert picture.size == (32, 18)
        scene = tomllib.loads(picture.info["Scene"])
        assert picture.info["Command"].startswith("nigemizu render pyramid -o mirage.png")
        assert np.asarray(picture).std() > 5  # not one flat colour
    assert scene["camera"]["seed"] == 3


def test_stats_tell_of_rays_errors_and_time(run: Run, small: tuple[str, ...]) -> None:
    done = run("render", "pyramid", "-o", "bent.png", "--stats", *small)
    assert (done.code, done.out) == (0, "bent.png\n")
    rays, bending, time = done.err.splitlines()
    told = re.fullmatch(r"nigemizu: rays: ([\d,]+) hit, ([\d,]+) escaped, 0 out-of-steps", rays)
    assert told is not None
    assert sum(int(count.replace(",", "")) for count in told.groups()) == 32 * 18 * 2
    error = re.match(
        r"nigemizu: bending: displacement error (\S+) pixels on average, (\S+) at worst", bending
    )
    assert error is not None
    assert 0 < float(error[1]) < float(error[2]) < 0.2
    assert re.fullmatch(r"nigemizu: time: \d+\.\d s", time)
    done = run("render", "pyramid", "-o", "straight.png", "--stats", "--method", "straight", *small)
    assert [line.split()[1] for line in done.err.splitlines()] == ["rays:", "time:"]


def test_stats_of_a_film_are_those_of_its_frames(run: Run, small: tuple[str, ...]) -> None:
    done = run("animate", "pyramid", "-o", "film.mp4", "--stats", "--frames", "2", *small)
    assert (done.code, done.out) == (0, "film.mp4\n")
    rays, bending, _ = done.err.splitlines()
    counts = [int(count.replace(",", "")) for count in re.findall(r"([\d,]+) [heo]", rays)]
    assert sum(counts) == 2 * 32 * 18 * 2
    assert "displacement error" in bending
    again = run("animate", "pyramid", "-o", "film.mp4", "--stats", "--frames", "2", *small)
    assert again.err.splitlines()[0] == "nigemizu: rays: none, every frame was there already"


def test_flags_and_set_say_the_same(run: Run, small: tuple[str, ...]) -> None:
    run(
        "render",
        "pyramid",
        "-o",
        "flags.png",
        *small,
        "--size",
        "20x10",
        "--spp",
        "3",
        "--method",
        "straight",
    )
    keys = ("camera.width=20", "camera.height=10", "camera.samples=3", "tracer.method='straight'")
    run("render", "pyramid", "-o", "set.png", *small, *(f"--set={key}" for key in keys))
    with Image.open("flags.png") as one, Image.open("set.png") as other:
        assert one.size == (20, 10)
        assert np.array_equal(np.asarray(one), np.asarray(other))
        assert one.info["Scene"] == other.info["Scene"]


def test_bent_light_differs_from_straight_light(run: Run, small: tuple[str, ...]) -> None:
    for method in ("bent", "straight"):
        run("render", "pyramid", "-o", f"{method}.exr", *small, "--spp", "16", "--method", method)
    from nigemizu.output import read_picture

    bent, straight = (read_picture(f"{method}.exr").astype(float) for method in ("bent", "straight"))
    assert np.abs(bent - straight).max() > 0.05


def test_compare_renders_all_three(run: Run, small: tuple[str, ...]) -> None:
    done = run("render", "pyramid", "-o", "three.png", "--compare", *small)
    names = ["three.png", "three_straight.png", "three_layered.png", "three_bent.png"]
    assert (done.code, done.out.split(), done.err) == (0, names, "")
    with Image.open("three.png") as sheet:
        assert sheet.width == 32
        assert sheet.height >= 3 * 18


def test_simulate_then_render_through_the_stored_air(run: Run, small: tuple[str, ...]) -> None:
    done = run("simulate", "pyramid", "-o", "air.nc", *small, "--every", "1 s")
    assert (done.code, done.out, done.err) == (0, "air.nc\n", "")
    import xarray

    with xarray.open_dataset("air.nc", decode_times=False) as air:
        assert air["time"].values.tolist() == [0.0, 1.0, 2.0]
        assert air["air_temperature"].attrs["standard_name"] == "air_temperature"
        assert 303.0 < float(air["air_temperature"].max()) <= 328.0
    run("render", "pyramid", "-o", "stored.png", "--air", "air.nc", "--time", "2", *small)
    run("render", "pyramid", "-o", "fresh.png", "--time", "2", *small)
    with Image.open("stored.png") as stored, Image.open("fresh.png") as fresh:
        difference = np.abs(np.asarray(stored, float) - np.asarray(fresh, float))
    assert difference.max() <= 1.0  # the heat stage took other steps on its way


def test_simulate_writes_zarr(run: Run, small: tuple[str, ...]) -> None:
    done = run("simulate", "road", "-o", "air.zarr", *small)
    assert (done.code, done.out) == (0, "air.zarr\n")
    from nigemizu.heat import read_air

    assert read_air(Path("air.zarr")).sizes["time"] == 11


def test_animate_writes_a_film_and_its_frames(run: Run, small: tuple[str, ...]) -> None:
    done = run("animate", "road", "-o", "film.mp4", "--frames", "3", "--fps", "10", *small)
    assert (done.code, done.out, done.err) == (0, "film.mp4\n", "")
    import av

    with av.open("film.mp4") as film:
        stream = film.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.average_rate == 10
        assert sum(1 for _ in film.decode(video=0)) == 3
    assert len(list(Path("film_frames").glob("*.png"))) == 3


@pytest.mark.parametrize("verb", ["render", "animate"])
def test_steps_too_long_for_the_air_are_told_once(run: Run, small: tuple[str, ...], verb: str) -> None:
    name = "film.mp4" if verb == "animate" else "picture.png"
    done = run(verb, "road", "-o", name, "--set=tracer.step=50", "--set=film.frames=2", *small)
    assert (done.code, done.out) == (0, f"{name}\n")
    assert done.err.startswith("nigemizu: warning: what is seen is displaced by up to ")
    assert "shorten tracer.step" in done.err
    assert len(done.err.splitlines()) == 1


def test_frames_are_the_same_whoever_renders_them(run: Run, small: tuple[str, ...]) -> None:
    run("animate", "road", "-o", "one.mp4", "--frames", "3", *small)
    done = run("animate", "road", "-o", "two.mp4", "--frames", "3", "--workers", "2", *small)
    assert (done.code, done.err) == (0, "")
    for one in sorted(Path("one_frames").glob("*.png")):
        assert one.read_bytes() == (Path("two_frames") / one.name).read_bytes()


def test_trace_prints_rays_as_json(run: Run, small: tuple[str, ...]) -> None:
    done = run("trace", "pyramid", "--json", "-e", "-2:2:2", "--azimuth", "-1,1", *small)
    assert (done.code, done.err) == (0, "")
    rays = json.loads(done.out)
    asked = [(elevation, azimuth) for azimuth in (-1, 1) for elevation in (-2, 0, 2)]
    assert [(ray["elevation"], ray["azimuth"]) for ray in rays] == asked
    keys = {
        "elevation",
        "azimuth",
        "status",
        "end",
        "end_direction",
        "turning_height",
        "optical_path",
        "steps",
    }
    assert all(set(ray) == keys for ray in rays)
    down = rays[0]
    assert down["status"] == "hit"
    # 2° down from 1.3 m meets the ground 37.2 m away, and bends little on its way there
    assert math.hypot(*down["end"][:2]) == pytest.approx(1.3 / math.tan(math.radians(2)), rel=0.02)
    assert down["end"][1] < 0 < rays[3]["end"][1]  # azimuth is positive to the left
    assert down["turning_height"] is None


def test_trace_writes_tables_and_diagrams(run: Run, small: tuple[str, ...]) -> None:
    for name in ("rays.csv", "rays.nc", "rays.svg", "rays.png"):
        done = run("trace", "pyramid", "-o", name, "-e", "-0.6:0.2:0.1", *small)
        assert (done.code, done.out, done.err) == (0, f"{name}\n", "")
    rows = Path("rays.csv").read_text().splitlines()
    assert len(rows) == 10
    assert rows[0].startswith("elevation,azimuth,status,")
    drawn = Path("rays.svg").read_text(encoding="utf-8")
    assert "<svg" in drawn[:500]
    assert "<!-- temperature (°C) -->" in drawn
    assert 'id="object pyramid"' in drawn


def test_scenes_lists_the_built_in_ones(run: Run) -> None:
    done = run("scenes")
    assert [line.split()[0] for line in done.out.splitlines()] == [
        *("fata-morgana", "lake", "looming", "moonrise", "plume", "pyramid"),
        *("road", "runway", "shimmer", "sunset-inferior", "sunset-mock"),
    ]


def test_show_prints_toml_that_renders_the_same_scene(run: Run) -> None:
    from nigemizu.scene import Scene

    for flags in ((), ("--plain",)):
        shown = run("show", "road", *flags).out
        Path("mine.toml").write_text(shown)
        assert Scene.load("mine.toml") == Scene.load("road")
        assert ("# [m]" in shown) == (not flags)
    assert run("check", "mine.toml").code == 0


def test_show_applies_set(run: Run) -> None:
    shown = run("show", "road", "--set", "camera.eye=[0, 0, '250 cm']", "--set", "title=Mine").out
    scene = tomllib.loads(shown)
    assert scene["camera"]["eye"] == [0.0, 0.0, 2.5]
    assert scene["title"] == "Mine"


def test_check_of_all_built_in_scenes(run: Run) -> None:
    done = run("check", "pyramid", "road")
    assert (done.code, done.err, len(done.out.splitlines())) == (0, "", 2)


def test_check_warns_of_objects_outside_the_air(run: Run) -> None:
    done = run("check", "pyramid", "--set=tracer.beyond='straight'", "--set=objects.1.position=[5000, 0, 0]")
    assert done.code == 0
    assert done.err.startswith("nigemizu: warning: objects.1 (pyramid) stands outside the grid")
    assert len(done.err.splitlines()) == 1


def test_schema_describes_every_section(run: Run) -> None:
    schema = json.loads(run("schema").out)
    # Air is heated on a mesh, or lies in layers: the scene itself says which sections are wanting.
    assert "required" not in schema
    assert {"grid", "initial", "ground", "earth", "profile"} <= set(schema["properties"])
    eye = schema["$defs"]["Camera"]["properties"]["eye"]
    assert eye["unit"] == "m"
    assert "[m]" in eye["description"]


def test_doctor_says_what_the_machine_can_run(run: Run) -> None:
    done = run("doctor", "--json")
    found = json.loads(done.out)
    assert (done.code == 0) == found["can_render"]
    assert found["llvm"]["state"] in ("found", "missing", "too old")
    assert set(found["packages"]) >= {"mitsuba", "drjit", "numpy"}
    lines = run("doctor").out.splitlines()
    assert any(line.startswith("LLVM") for line in lines)


@pytest.mark.parametrize("asked", [["--help"], ["render", "--help"], ["--version"]])
def test_help_and_version_leave_with_zero(run: Run, asked: list[str]) -> None:
    done = run(*asked)
    assert (done.code, done.err) == (0, "")
    assert "nigemizu" in done.out
