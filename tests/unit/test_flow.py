"""Moving air from instant to instant: checkpoints, what a scene makes of it, and what is refused."""

from __future__ import annotations

import itertools
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nigemizu.errors import InputError, NigemizuWarning
from nigemizu.heat import (
    Checkpoints,
    Convection,
    Diffusivity,
    FluxGround,
    GridSpec,
    HeldGround,
    Quantity,
    Sides,
    State,
    Top,
    Wind,
    convect,
)
from nigemizu.heat.flow.moving import MovingAir
from nigemizu.heat.flow.running import DivergedError
from nigemizu.scene import Scene

GRID = GridSpec(x=(0, 2), y=(0, 2), height=1.0, cells=(8, 8, 8), first_cell=0.05).build()
HOT = HeldGround(temperature=Quantity(value=330.0))
TIMES = (0.5, 1.0, 1.5, 2.0)
SMALL = {
    "process": "convection",
    "grid.x": [0.0, 4.0],
    "grid.y": [-2.0, 2.0],
    "grid.height": 1.0,
    "grid.cells": [8, 8, 10],
    "grid.first_cell": 0.01,
    "initial.unevenness": [],
    "diffusivity": {"kind": "molecular"},
    "convection.noise": 0.2,
    "convection.ground": "rough",
    "convection.roughness": 0.0005,
    "time.duration": 1.0,
    "time.picture": 1.0,
    "time.store_every": 0.5,
    "film.start": 0.0,
    "film.duration": 0.5,
    "film.frames": 3,
    "camera.width": 24,
    "camera.height": 16,
    "camera.samples": 1,
}


def run(**options: Any) -> list[State]:
    given: dict[str, Any] = {
        "ground": HOT,
        "times": TIMES,
        "convection": Convection(noise=0.5, ground="rough"),
    }
    return list(convect(GRID, np.full(GRID.shape, 300.0), **(given | options)))


def same(one: State, other: State) -> bool:
    assert one.wind is not None
    assert other.wind is not None
    pairs = zip((one.temperature, *one.wind), (other.temperature, *other.wind), strict=True)
    return one.time == other.time and all(np.array_equal(a, b) for a, b in pairs)


def small(**overrides: Any) -> Scene:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NigemizuWarning)
        return Scene.load("pyramid", SMALL | overrides)


def test_air_over_hot_ground_rises() -> None:
    """Negative control: over ground of its own temperature the disturbance alone moves it, and dies."""
    hot, even = (
        run(ground=HeldGround(temperature=Quantity(value=kelvin)), times=(10.0,)) for kelvin in (330.0, 300.0)
    )
    fastest = [max(float(np.max(np.abs(part))) for part in state.wind or ()) for state in (hot[-1], even[-1])]
    assert fastest[0] > 0.03
    assert fastest[0] > 3 * fastest[1]
    assert hot[-1].temperature.mean() > 300.0


def test_a_run_goes_on_from_its_checkpoint_to_the_same_bits(tmp_path: Path) -> None:
    whole = run()
    kept = Checkpoints(tmp_path / "kept", "run", 0.3)
    first = convect(GRID, np.full(GRID.shape, 300.0), ground=HOT, times=TIMES, checkpoints=kept,
                 convection=Convection(noise=0.5, ground="rough"))  # fmt: skip
    assert all(same(a, b) for a, b in zip(itertools.islice(first, 3), whole, strict=False))
    first.close()  # type: ignore[attr-defined]
    assert len(list((tmp_path / "kept").glob("state_*.npz"))) == 3
    later = run(checkpoints=Checkpoints(tmp_path / "kept", "run", 0.3), first=3)
    assert len(later) == 1
    assert same(later[0], whole[3])
    # Negative control: what another run has left is not taken up, nor is a state that is too late.
    air = MovingAir(GRID, Convection(), HOT, Sides(), Top(), 2.2e-5)
    assert not Checkpoints(tmp_path / "kept", "another", 0.3).take_up(air, 9.0)
    assert not Checkpoints(tmp_path / "kept", "run", 0.3).take_up(air, 0.1)
    assert Checkpoints(tmp_path / "kept", "run", 0.3).take_up(air, 1.25)
    assert air.time <= 1.25


def test_a_damaged_checkpoint_is_passed_over(tmp_path: Path) -> None:
    kept = Checkpoints(tmp_path, "run", 0.3)
    run(checkpoints=kept)
    newest = sorted(tmp_path.glob("state_*.npz"))[-1]
    newest.write_bytes(newest.read_bytes()[:100])
    again = Checkpoints(tmp_path, "run", 0.3)
    assert same(run(checkpoints=again, first=3)[0], run()[3])


def test_wind_is_kept_up() -> None:
    """Its mean stays, against the drag of the ground; the lowest cells are slowed."""
    last = run(wind=Wind(speed=2.0, direction=90.0), ground=HeldGround(temperature=Quantity(value=300.0)))[-1]
    assert last.wind is not None
    means = [float(part.mean(axis=(1, 2)) @ GRID.z_widths) for part in last.wind]
    assert abs(means[1] - 2.0) < 1e-9
    assert abs(means[0]) < 1e-9
    assert last.wind[1][0].mean() < 0.9 * last.wind[1][-1].mean()


def test_eddy_viscosity_is_that_of_vreman() -> None:
    """Against his equations written out in NumPy; none in laminar shear."""
    air = MovingAir(GRID, Convection(), HOT, Sides(), Top(), 2.2e-5)
    air.set(np.full(GRID.shape, 300.0), tuple(np.random.default_rng(5).standard_normal((3, *GRID.shape))))  # type: ignore[arg-type]
    air.longest_step()
    k, j, i = 5, 6, 4
    dx, dy, dz = 0.25, 0.25, air.cells.metric.dz
    u, v, w, _ = air.cells.fields
    rise = 0.5 * dz[k - 1] + dz[k] + 0.5 * dz[k + 1]

    def middle(field: Any, axis: int) -> Any:
        return 0.5 * (field + np.roll(field, -1, axis=axis))

    uc, vc, wc = middle(u, 2), middle(v, 1), middle(w, 0)
    a = np.empty((3, 3))
    for number, field in enumerate((uc, vc, wc)):
        a[0, number] = (field[k, j, i + 1] - field[k, j, i - 1]) / (2 * dx)
        a[1, number] = (field[k, j + 1, i] - field[k, j - 1, i]) / (2 * dy)
        a[2, number] = (field[k + 1, j, i] - field[k - 1, j, i]) / rise
    a[0, 0] = (u[k, j, i + 1] - u[k, j, i]) / dx
    a[1, 1] = (v[k, j + 1, i] - v[k, j, i]) / dy
    a[2, 2] = (w[k + 1, j, i] - w[k, j, i]) / dz[k]
    b = np.einsum("m,mi,mj->ij", np.array([dx, dy, dz[k]]) ** 2, a, a)
    size = (
        b[0, 0] * b[1, 1] - b[0, 1] ** 2 + b[0, 0] * b[2, 2] - b[0, 2] ** 2 + b[1, 1] * b[2, 2] - b[1, 2] ** 2
    )
    expected = 1.57e-5 + 0.07 * np.sqrt(size / np.sum(a * a))
    assert abs(air.cells.viscosity[k, j, i] / expected - 1) < 1e-12
    assert expected > 1e-3

    sheared = np.broadcast_to(np.arange(8.0)[:, None, None], GRID.shape)
    still = np.zeros(GRID.shape)
    air.cells.put((sheared, still, still), still + 300.0)
    air.longest_step()
    assert np.all(air.cells.viscosity[2:-2, 2:-2, 2:-2] < 1.6e-5)


def test_a_flow_that_blows_up_names_its_last_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ordinary = MovingAir.advance

    def explode(self: MovingAir, *args: Any) -> None:
        ordinary(self, *args)
        if self.time > 1.2:
            self.cells.fields[0][4, 4, 4] = np.nan

    monkeypatch.setattr(MovingAir, "advance", explode)
    with pytest.raises(DivergedError, match=r"blown up at 1\.[0-9]+ s; its last sound state, at (0\.9|1)"):
        run(checkpoints=Checkpoints(tmp_path, "run", 0.3))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"grid.cells": [8, 2, 10]}, ["grid.cells", "got 2", "4 and more"]),
        ({"grid.height": 8.0, "grid.first_cell": 0.1}, ["too small for its eddies", "grid.x"]),
        ({"convection.closure": "none"}, ["cell Reynolds number", "vreman"]),
        ({"sides.x": "insulated", "wind.speed": 2.0}, ["through a wall", "sides.x"]),
        ({"diffusivity": {"kind": "eddy", "friction_velocity": 0.1}}, ["diffusivity.kind", "molecular"]),
        ({"convection.courant": 2.0}, ["convection.courant"]),
        ({"process": "turbulence"}, ["process", "convection"]),
    ],
)
def test_what_cannot_flow_is_refused(changes: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(InputError) as told:
        small(**changes).simulate([0.1])
    for word in words:
        assert word in str(told.value)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"grid.height": 3.0, "grid.first_cell": 0.1}, "6 m leave them room"),
        ({"convection.ground": "smooth", "grid.first_cell": 0.06}, "conducts"),
        ({"time.duration": 1e6, "time.store_every": 1e6}, "hours on two cores"),
    ],
)
def test_what_flows_badly_is_warned_of(changes: dict[str, Any], word: str) -> None:
    scene = small(**changes)
    with pytest.warns(NigemizuWarning, match=word):
        scene.check()


def test_a_flux_has_a_speed_too() -> None:
    flux = FluxGround(heat_flux=Quantity(value=300.0))
    with pytest.raises(InputError, match="cell Reynolds"):
        small(
            **{"convection.closure": "none", "ground": flux.model_dump(mode="json", exclude_none=True)}
        ).check()


def test_a_scene_gives_temperature_and_wind() -> None:
    scene = small()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NigemizuWarning)
        air = scene.simulate()
    assert air["x_wind"].dims == ("time", "z", "y", "x")
    assert air["upward_air_velocity"].attrs["units"] == "m s-1"
    assert float(abs(air["upward_air_velocity"]).max()) > 1e-3
    assert "x_wind" not in small(process="diffusion").simulate([0.0])


def test_a_dataset_is_completed_after_an_interruption(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import xarray as xr

    warnings.simplefilter("ignore", NigemizuWarning)
    scene = small(**{"convection.checkpoint_every": 0.1})
    scene.save_air(tmp_path / "whole.nc")
    ordinary, calls = MovingAir.advance, []

    def stop(self: MovingAir, *args: Any) -> None:
        if self.time > 0.7:
            raise KeyboardInterrupt
        calls.append(self.time)
        ordinary(self, *args)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MovingAir, "advance", stop)
        with pytest.raises(KeyboardInterrupt):
            scene.save_air(tmp_path / "air.nc")
    assert not (tmp_path / "air.nc").exists()
    assert (tmp_path / "air.nc.checkpoints").is_dir()
    before = len(calls)
    monkeypatch.setattr(
        MovingAir, "advance", lambda self, *a: (calls.append(self.time), ordinary(self, *a))[1]
    )
    scene.save_air(tmp_path / "air.nc")
    assert min(calls[before:]) > 0.5  # it did not begin anew
    assert not (tmp_path / "air.nc.checkpoints").exists()
    with xr.open_dataset(tmp_path / "air.nc") as one, xr.open_dataset(tmp_path / "whole.nc") as other:
        assert one.drop_attrs().equals(other.drop_attrs())


def test_a_diffusivity_of_eddies_is_for_diffusion() -> None:
    with pytest.raises(InputError, match="makes its own eddies"):
        run(diffusivity=Diffusivity(kind="eddy", friction_velocity=0.2))
