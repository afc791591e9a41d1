"""The programs in benchmarks/ on sizes that take seconds."""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"

Load = Callable[[str], ModuleType]


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Load:
    """Import a program that belongs to no package."""

    def load(name: str) -> ModuleType:
        spec = importlib.util.spec_from_file_location(f"benchmarks_{name}", FOLDER / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, spec.name, module)
        spec.loader.exec_module(module)
        return module

    return load


def _typed(monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    monkeypatch.setattr(sys, "argv", ["program", *words])


def test_march(load: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    march = load("march")
    monkeypatch.setattr(march.measure, "__defaults__", (march.Voxels((16, 16, 32)),))
    _typed(monkeypatch, "--json", "--rays", "64", "--steps", "8", "--repeat", "1")
    march.main()
    found = json.loads(capsys.readouterr().out)
    assert next(iter(found)) == "by hand"
    assert len(found) == 7
    assert all(speed["million_ray_steps_per_second"] > 0 and speed["ratio"] > 0 for speed in found.values())


def test_heat(load: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    _typed(monkeypatch, "--json", "--cells", "64", "32", "24", "--steps", "2")
    load("heat").main()
    found = json.loads(capsys.readouterr().out)
    assert found["cells (nx, ny, nz)"] == [64, 32, 24]
    assert all(value > 0 for name, value in found.items() if not isinstance(value, list))
    assert 2 < found["peak memory, volumes"] < 20


def test_work_precision_draws_and_prints(
    load: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    work_precision = load("work_precision")
    monkeypatch.setattr(work_precision, "INTERPOLATIONS", ("stratified",))
    plot = tmp_path / "plot.svg"
    small = ("--rays", "16", "--fan", "16", "--steps", "4", "1", "--repeat", "1")
    _typed(monkeypatch, "--json", "-o", str(plot), *small)
    work_precision.main()
    points = [work_precision.Point(**point) for point in json.loads(capsys.readouterr().out)]
    assert {point.case for point in points} == {work_precision.LOG_COSH, "hot road, stratified"}
    assert {point.method for point in points} == set(work_precision.COLOURS)
    assert all(point.error > 0 and point.seconds > 0 and math.isfinite(point.error) for point in points)
    text = plot.read_text(encoding="utf-8")
    assert text.count("error-controlled") > 0
    work_precision.draw(points, tmp_path / "again.svg")
    assert (tmp_path / "again.svg").read_text(encoding="utf-8") == text


def test_refraction_table_is_timed(
    load: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    refraction = load("refraction")
    _typed(monkeypatch, "--json", "--step", "10", "--repeat", "1")
    refraction.main()
    measured = json.loads(capsys.readouterr().out)
    assert measured
    assert all(row["seconds"] > 0 for row in measured.values())


def test_sunset_is_timed(
    load: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sunset = load("sunset")
    _typed(monkeypatch, "--json", "--size", "16x12", "--samples", "4", "--wavelengths", "4", "--repeat", "1")
    sunset.main()
    figures = json.loads(capsys.readouterr().out)
    assert set(figures) == {"first", "sky", "picture", "together"}
    assert all(seconds > 0 for seconds in figures.values())


def test_work_precision_refuses_other_pictures(
    load: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    work_precision = load("work_precision")
    _typed(monkeypatch, "-o", "plot.jpeg")
    with pytest.raises(SystemExit, match="2"):
        work_precision.main()
    assert "plot.jpeg must end in .svg" in capsys.readouterr().err


def test_work_precision_knows_the_exact_rays(load: Load) -> None:
    """Marched finely in double precision, rays come to within 1 nrad of the closed form, and to within 0.1
    µrad of SciPy's over the road, whose profile is given on nodes only. Straight rays are far off."""
    from nigemizu import field, trace

    work_precision, types = load("work_precision"), field.types("llvm", "double")
    fan = work_precision.log_cosh(12).fan(types)
    marched = fan.marched(step=0.5, stepper=trace.SUZUKI4, max_steps=4000)
    assert fan.error(fan.heights(marched)) < 1e-3
    road = work_precision.road("stratified", 12).fan(types, 1e-8)
    assert road.error(road.heights(road.marched(accuracy=1e-8, max_steps=10_000))) < 0.1
    straight = np.tan(road.elevations) * road.distance + road.eye
    assert road.error(straight) > 1000
