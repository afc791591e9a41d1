"""What bad input gets: one clear line on stderr, exit code 2, nothing half-written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Run = Callable[..., Any]


def assert_refused(done: Any, *words: str, left: set[str] = frozenset()) -> None:  # type: ignore[assignment]
    """Exit code 2, one line that holds all `words`, no traceback, and no file but those that were `left`."""
    assert done.code == 2
    assert done.out == ""
    assert done.err.startswith("nigemizu: error: ")
    assert len(done.err.splitlines()) == 1
    assert "Traceback" not in done.err
    for word in words:
        assert word in done.err, f"{word!r} not in {done.err!r}"
    assert {entry.name for entry in Path().iterdir()} == set(left)


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["rendr", "pyramid"], ["'rendr'", "did you mean render?"]),
        (["render", "pyramid", "--sampels", "4"], ["'--sampels'", "did you mean --samples?"]),
        (["render", "pyramid", "--size", "96"], ["--size", "'96'", "960x540"]),
        (["render", "pyramid", "--spp", "0"], ["--spp", "'0'"]),
        (["render", "pyramid", "--time", "3 km"], ["--time", "'3 km'", "min"]),
        (["render", "pyramid", "extra"], ["'extra'"]),
        (["render"], ["SCENE"]),
        ([], ["VERB"]),
        (["render", "pyramid", "--set", "camera.samples"], ["--set", "section.key=value"]),
        (["trace", "pyramid", "-e", "1:0:0.1", "--json"], ["--elevation", "first:last:step"]),
        (["trace", "pyramid", "-e", "up", "--json"], ["--elevation", "'up'"]),
        (["trace", "pyramid", "-e", "-91", "--json"], ["elevation", "-91"]),
        (["trace", "pyramid"], ["--json", "-o"]),
        (["render", "pyramid", "--compare", "--stats"], ["--compare", "--stats"]),
        (["animate", "pyramid", "--duration", "-3"], ["--duration", "-3"]),
    ],
)
def test_mistyped_commands(run: Run, typed: list[str], words: list[str]) -> None:
    assert_refused(run(*typed), *words)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("camera.sampels=4", ["camera.sampels", "unknown key", "did you mean 'samples'?"]),
        ("cammera.samples=4", ["cammera", "did you mean 'camera'?"]),
        ("objects.1.hieght=3", ["objects.1.hieght", "did you mean 'height'?"]),
        ("objects.7.height=3", ["objects.7.height", "'7'", "0 to 2"]),
        ("camera.samples='many'", ["camera.samples", "'many'", "a whole number"]),
        ("camera.samples=1.5", ["camera.samples", "1.5", "a whole number"]),
        ("camera.eye='up there'", ["camera.eye", "'up there'", "a list"]),
        ("camera.eye=[0, 0]", ["camera.eye.2", "is missing"]),
        ("camera.eye=[0, 0, '2 degC']", ["camera.eye", "wrong unit", "'2 degC'", "km"]),
        ("wind.speed='3 km'", ["wind.speed", "wrong unit", "km/h"]),
        ("wind.speed=true", ["wind.speed", "wrong type", "True"]),
        ("ground.temperature=-5", ["ground.temperature", "-5", "kelvin"]),
        ("ground.temperature='-300 degC'", ["ground.temperature", "kelvin"]),
        ("initial.temperature=nan", ["initial.temperature", "nan", "finite"]),
        ("ground.kind='helt'", ["ground.kind", "'helt'", "'held'"]),
        ("grid.cells=[0, 4, 8]", ["grid.cells.0", "0", "≥ 1"]),
        ("grid.x=[10, -10]", ["grid.x", "-10"]),
        ("grid=5", ["grid", "wrong type", "a table"]),
        ("camera.eye=[0, 0, -1.8]", ["camera.eye", "below the ground", "-1.8"]),
        ("camera.eye=[0, 0, 1e7]", ["camera.eye", "10000000.0"]),
        ("camera.target=[0.0, 0.0, 1.3]", ["camera.target"]),
        ("tracer.method='curved'", ["tracer.method", "'curved'", "'bent'"]),
        ("tracer.accuracy=0", ["tracer.accuracy", "got 0", "> 0"]),
        ("tracer.accuracy=-1", ["tracer.accuracy", "got -1", "> 0"]),
        ("tracer.accuracy=abc", ["tracer.accuracy", "'abc'", "a number"]),
        ("tracer.accuracy=inf", ["tracer.accuracy", "inf", "finite"]),
        ("tracer.accuracy_unit=px", ["tracer.accuracy_unit", "'px'", "'pixel'", "'radian'"]),
        ("tracer.acuracy=1", ["tracer.acuracy", "did you mean 'accuracy'?"]),
        ("tracer.step=0", ["tracer.step", "got 0", "> 0"]),
        ("tracer.precision=half", ["tracer.precision", "'half'", "'single'", "'double'"]),
        ("tracer.interpolation=cubic", ["tracer.interpolation", "'cubic'", "'tricubic'"]),
        ("tracer.sharing=maybe", ["tracer.sharing", "'maybe'", "true or false"]),
        ("tracer.chord_tolerance=2", ["tracer.chord_tolerance", "got 2", "≤ 1"]),
        ("time.picture=1e6", ["time.picture", "time.duration"]),
        ("objects.1.material={kind='texture', image='gone.png'}", ["objects.1.material.image", "gone.png"]),
        ("objects.1={kind='mesh', file='gone.ply'}", ["objects.1.file", "gone.ply"]),
        ("initial={dataset='gone.nc'}", ["initial.dataset", "gone.nc"]),
        ("initial={profile='300 + import(z)'}", ["initial", "import"]),
        ("initial={}", ["initial", "exactly one"]),
    ],
)
@pytest.mark.parametrize("verb", ["check", "render"])
def test_mistakes_in_a_scene(run: Run, verb: str, assignment: str, words: list[str]) -> None:
    done = run(verb, "pyramid", "--set", assignment, *(["-o", "out.png"] if verb == "render" else []))
    assert_refused(done, "pyramid: ", *words)


def test_mistake_in_a_file_names_the_file(run: Run) -> None:
    text = run("show", "pyramid", "--plain").out
    Path("mine.toml").write_text(text.replace("[camera]", "[camera]\nfeild_of_view = 3"))
    assert_refused(
        run("check", "mine.toml"), "mine.toml: camera.feild_of_view", "'field_of_view'", left={"mine.toml"}
    )
    Path("mine.toml").write_text("title = \n[camera]")
    assert_refused(run("check", "mine.toml"), "mine.toml", "line 1", left={"mine.toml"})
    Path("mine.toml").write_text("title = 'no air at all'")
    assert_refused(run("check", "mine.toml"), "mine.toml: grid: is missing", left={"mine.toml"})
    Path("mine.toml").write_bytes(b"\xff\xfe\x00")
    assert_refused(run("check", "mine.toml"), "mine.toml", "UTF-8", left={"mine.toml"})


def test_unknown_scene_names_the_nearest(run: Run) -> None:
    assert_refused(run("render", "piramid"), "piramid", "did you mean 'pyramid'?")


def test_paths_in_a_file_count_from_its_folder(run: Run) -> None:
    text = run("show", "pyramid", "--plain").out
    folder = Path("elsewhere")
    folder.mkdir()
    (folder / "mine.toml").write_text(text + "\n[[objects]]\nkind = 'mesh'\nfile = 'part.ply'\n")
    done = run("check", "elsewhere/mine.toml")
    assert_refused(done, "objects.3.file", os.path.join("elsewhere", "part.ply"), left={"elsewhere"})


def test_volume_larger_than_memory_is_refused_before_it_is_made(run: Run) -> None:
    done = run("render", "pyramid", "-o", "big.png", "--set", "grid.cells=[30000, 10000, 40]")
    assert_refused(done, "grid.cells", "GB", "fewer cells")


def test_memory_at_hand_is_what_decides() -> None:
    from nigemizu import InputError
    from nigemizu.scene import Scene

    scene = Scene.load("pyramid")
    scene.check(available=lambda: scene.grid.memory())
    with pytest.raises(InputError, match=r"grid\.cells"):
        scene.check(available=lambda: scene.grid.memory() - 1)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gone/out.png", ["gone", "no such folder"]),
        ("out.jpeg", ["out.jpeg", ".png"]),
        ("out", [".png"]),
    ],
)
def test_impossible_outputs_are_refused_before_the_work(run: Run, name: str, words: list[str]) -> None:
    assert_refused(run("render", "pyramid", "-o", name), *words)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux")
def test_unwritable_folder(run: Run) -> None:
    assert_refused(run("render", "pyramid", "-o", "/proc/out.png"), "/proc")
    assert_refused(run("animate", "pyramid", "-o", "/proc/out.mp4"), "/proc")
    assert_refused(run("simulate", "pyramid", "-o", "/proc/air.zarr"), "/proc")


def test_full_disk(run: Run, small: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    import errno

    replace = os.replace

    def no_room(source: str, target: str) -> None:
        # compiled code is kept on disk too, elsewhere
        if Path(target).name == "out.png":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    monkeypatch.setattr(os, "replace", no_room)
    assert_refused(run("render", "pyramid", "-o", "out.png", *small), "out.png", "disk is full")


def _dataset(**changes: Any) -> Any:
    import xarray

    z = np.array([0.0, 1.0, 2.0])
    air = xarray.Dataset(
        {"air_temperature": (("z", "y", "x"), np.full((3, 2, 2), 300.0), {"units": "K"})},
        {"z": ("z", z), "y": ("y", [-10.0, 10.0]), "x": ("x", [0.0, 1000.0])},
    )
    return air.assign(**changes)


def test_datasets_that_cannot_be_used(run: Run, small: tuple[str, ...]) -> None:
    holes = np.full((3, 2, 2), 300.0)
    holes[1, 0, 1] = np.nan
    bad = {
        "nan.nc": (_dataset(air_temperature=(("z", "y", "x"), holes)), ["air_temperature", "NaN"]),
        "order.nc": (_dataset().isel(x=[0, 0]), ["x", "increase"]),
        "units.nc": (
            _dataset(air_temperature=(("z", "y", "x"), np.full((3, 2, 2), 300.0), {"units": "m"})),
            ["air_temperature", "'m'"],
        ),
        "name.nc": (_dataset().rename(air_temperature="temp"), ["air_temperature"]),
    }
    for name, (dataset, words) in bad.items():
        dataset.to_netcdf(name)
        done = run("render", "pyramid", "-o", "out.png", "--air", name, *small)
        assert_refused(done, name, *words, left=set(bad) & {entry.name for entry in Path().iterdir()})
    Path("text.nc").write_text("no dataset")
    done = run("render", "pyramid", "-o", "out.png", "--air", "text.nc", *small)
    assert_refused(done, "text.nc", left={*bad, "text.nc"})
    done = run("render", "pyramid", "-o", "out.png", "--air", "gone.zarr", *small)
    assert_refused(done, "gone.zarr", "no such", left={*bad, "text.nc"})


def test_time_outside_the_stored_air(run: Run, small: tuple[str, ...]) -> None:
    run("simulate", "pyramid", "-o", "air.nc", *small)
    for verb, output in (("render", "out.png"), ("animate", "out.mp4")):
        asked = ["--time", "60"] if verb == "render" else ["--start", "60"]
        small_with_time = [flag for flag in small if "film.start" not in flag]
        done = run(verb, "pyramid", "-o", output, "--air", "air.nc", *asked, *small_with_time)
        assert_refused(done, "time", "60", "2 s", left={"air.nc"})


def test_frames_of_another_film_are_not_mixed(run: Run, small: tuple[str, ...]) -> None:
    run("animate", "pyramid", "-o", "film.mp4", "--frames", "2", *small)
    before = {file: file.read_bytes() for file in Path("film_frames").iterdir()}
    done = run("animate", "pyramid", "-o", "film.mp4", "--frames", "2", "--seed", "9", *small)
    assert_refused(done, "film_frames", "seed", left={"film.mp4", "film_frames"})
    assert {file: file.read_bytes() for file in Path("film_frames").iterdir()} == before


@pytest.mark.parametrize("version", [None, (15, 0, 7)])
def test_llvm_that_cannot_be_used(
    run: Run, monkeypatch: pytest.MonkeyPatch, version: tuple[int, ...] | None
) -> None:
    monkeypatch.setattr("nigemizu.cli.doctor.find_backends", lambda: (version, False))
    expected = ["LLVM", "16"] + (["15.0.7 is too old"] if version else ["none was found"])
    assert_refused(run("render", "pyramid", "-o", "out.png"), *expected)
    assert_refused(run("animate", "pyramid", "-o", "out.mp4"), *expected)
    assert_refused(run("trace", "pyramid", "--json"), *expected)
    done = run("doctor")
    assert (done.code, done.err) == (2, "")
    assert "remedy" in done.out
    assert run("simulate", "pyramid", "-o", "gone/air.nc").err.count("LLVM") == 0


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ({"usable": True, "optix": False}, ["libnvoptix.so.1", "NVIDIA_DRIVER_CAPABILITIES=all"]),
        ({"usable": False, "card": True}, ["535", "nvidia-smi"]),
        ({"usable": False, "card": False}, ["no NVIDIA card"]),
    ],
)
def test_cuda_that_cannot_be_used(
    run: Run, monkeypatch: pytest.MonkeyPatch, state: dict[str, bool], words: list[str]
) -> None:
    monkeypatch.setattr("nigemizu.cli.doctor.find_backends", lambda: ((19, 1, 7), state["usable"]))
    monkeypatch.setattr("nigemizu.cli.doctor._has_optix", lambda: state.get("optix", True))
    monkeypatch.setattr("nigemizu.cli.doctor._has_card", lambda: state.get("card", True))
    assert_refused(run("render", "pyramid", "--variant", "cuda", "-o", "out.png"), "--variant llvm", *words)
    done = run("doctor")
    assert (done.code, done.err) == (0, "")
    assert all(word in done.out for word in words)
    assert "can be rendered, by LLVM" in done.out
    if state["usable"]:
        # What would be taken by itself does not work: better said than met as a crash.
        assert_refused(run("render", "pyramid", "-o", "out.png"), "--variant llvm", *words)
        monkeypatch.setattr("nigemizu.cli.doctor._has_optix", lambda: True)
        assert "by CUDA and OptiX" in run("doctor").out


@pytest.mark.parametrize(("typed", "lines"), [(["check", "pyramid"], 0), (["doctor"], 0), (["bench"], 1)])
def test_llvm_named_by_the_user_that_is_not_there(program: Run, typed: list[str], lines: int) -> None:
    # A process of its own: Dr.Jit looks for LLVM while it is imported, and complains in its own words.
    started = program(*typed, DRJIT_LIBLLVM_PATH="gone.so")
    out, err = started.communicate(timeout=60)
    assert started.returncode == (0 if typed[0] == "check" else 2)
    assert len(err.splitlines()) == lines
    assert ("unset DRJIT_LIBLLVM_PATH" in out + err) == (typed[0] != "check")


def test_debug_shows_where_it_happened(run: Run) -> None:
    done = run("render", "piramid", "--debug")
    assert done.code == 2
    assert "Traceback" in done.err
    assert done.err.splitlines()[-1].startswith("nigemizu: error: piramid")
