"""The command as a process: quick to start, quiet in a pipe, clean when interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

Program = Callable[..., "subprocess.Popen[str]"]
HEAVY = ("mitsuba", "drjit", "xarray", "numba", "scipy", "matplotlib", "pydantic")


FRAMES = 16  # enough that a busy machine cannot end the film before Ctrl-C arrives


def _shortest(command: list[str]) -> float:
    taken = []
    for _ in range(5):
        began = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        taken.append(time.perf_counter() - began)
    return min(taken)


def test_help_costs_little_more_than_python_itself() -> None:
    bare = _shortest([sys.executable, "-c", "import argparse, importlib, re"])
    asked = _shortest([sys.executable, "-m", "nigemizu", "--help"])
    assert asked < 6 * bare + 0.05


@pytest.mark.parametrize("code", ["import nigemizu", "from nigemizu.cli import main; main(['--help'])"])
def test_importing_loads_nothing_heavy(code: str) -> None:
    code = f"import sys; {code}; sys.exit(','.join(sorted({{*sys.modules}} & {{*{HEAVY!r}}})))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""


def test_output_that_nobody_reads_is_no_error(program: Program) -> None:
    with program("show", "road") as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 141


def test_exit_code_and_one_line_reach_the_shell(program: Program) -> None:
    process = program("render", "piramid")
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (2, "")
    assert len(err.splitlines()) == 1


def _interrupt(process: subprocess.Popen[str], when: Callable[[], bool]) -> tuple[str, str]:
    """Ctrl-C, which the terminal sends to every process of the command."""
    deadline = time.monotonic() + 120
    while not when():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    return process.communicate(timeout=60)


@pytest.mark.parametrize("workers", ["1", "2"])
def test_interrupted_film_goes_on_where_it_stopped(
    program: Program, tmp_path: Path, small: tuple[str, ...], workers: str
) -> None:
    folder = tmp_path / "there"
    frames = folder / "film_frames"
    command = ["animate", "road", "--frames", str(FRAMES), *small, "--size", "64x36", "--spp", "16"]
    process = program(*command, "-o", "film.mp4", "--workers", workers)
    out, err = _interrupt(process, lambda: len(list(frames.glob("[0-9]*.png"))) >= 2)
    assert process.returncode == 130, err
    assert (out, err) == ("", "nigemizu: interrupted\n")
    done = {file.name: file.stat().st_mtime_ns for file in frames.glob("[0-9]*.png")}
    assert 2 <= len(done) < FRAMES
    assert {entry.name for entry in folder.iterdir()} == {"film_frames"}

    for name in ("film.mp4", "whole.mp4"):
        process = program(*command, "-o", name)
        out, err = process.communicate(timeout=120)
        assert (process.returncode, out, err) == (0, f"{name}\n", "")
    kept = {name: (frames / name).stat().st_mtime_ns for name in done}
    assert kept == done
    whole = sorted((folder / "whole_frames").glob("[0-9]*.png"))
    assert len(whole) == FRAMES
    for file in whole:
        assert file.read_bytes() == (frames / file.name).read_bytes()


def test_interrupted_picture_leaves_nothing(program: Program, tmp_path: Path) -> None:
    process = program("render", "pyramid", "-o", "out.png", "--size", "640x360", "--spp", "4000")
    began = time.monotonic()
    out, err = _interrupt(process, lambda: time.monotonic() - began > 4)
    assert (process.returncode, out, err) == (130, "", "nigemizu: interrupted\n")
    assert list((tmp_path / "there").iterdir()) == []


@pytest.mark.parametrize(("error", "code"), [("KeyboardInterrupt", 130), ("ZeroDivisionError", 1)])
def test_ctrl_c_is_known_inside_a_loop_that_drjit_records(error: str, code: int) -> None:
    program = f"""
import sys, drjit as dr
from drjit.llvm import UInt32
from nigemizu.cli import main, verbs

def fail(count):
    raise {error}

def doctor(options):
    dr.while_loop((UInt32(0, 1),), lambda count: count < 3, fail)

verbs.doctor = doctor
sys.exit(main(["doctor"]))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert (done.stderr == "nigemizu: interrupted\n") is (code == 130), done.stderr
