"""The command line as a person types it, on scenes small enough to be quick."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from nigemizu.cli import main

SMALL = (
    "--set=camera.width=32",
    "--set=camera.height=18",
    "--set=camera.samples=2",
    "--set=grid.cells=[8, 4, 16]",
    "--set=grid.first_cell=0.02",
    "--set=initial.unevenness=[]",
    "--set=time.duration=2.0",
    "--set=film.start=0.0",
    "--set=film.duration=0.5",
)


@dataclass(frozen=True)
class Outcome:
    """What a command left behind."""

    code: int
    out: str
    err: str


@pytest.fixture
def small() -> tuple[str, ...]:
    """Flags that make any scene quick to simulate and to render."""
    return SMALL


@pytest.fixture
def run(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Outcome]:
    """Run a command in this process, in an empty folder."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)

    def call(*typed: str) -> Outcome:
        capfd.readouterr()
        code = main(typed)
        return Outcome(code, *capfd.readouterr())

    return call


@pytest.fixture
def program(tmp_path: Path) -> Callable[..., subprocess.Popen[str]]:
    """Start a command as a process of its own, in an empty folder."""
    folder = tmp_path / "there"
    folder.mkdir()

    def start(*typed: str, **environment: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "nigemizu", *typed],
            cwd=folder,
            env={**os.environ, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    return start
