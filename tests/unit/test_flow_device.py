"""Moving air by array code, as on a graphics card: cell by cell what the processor's loops make of it."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nigemizu.errors import MachineError
from nigemizu.field import types
from nigemizu.heat import (
    Checkpoints,
    Convection,
    ExchangeGround,
    FluxGround,
    GridSpec,
    HeldGround,
    Quantity,
    Sides,
    Source,
    Top,
    convect,
)
from nigemizu.heat.flow.device.transforms import Waves, wave_basis
from nigemizu.heat.flow.moving import MovingAir
from nigemizu.heat.grid import Grid
from nigemizu.scene.running import flow_arrays

DOUBLE = types("llvm", "double")
HOT = HeldGround(temperature=Quantity(value=330.0))
FLUX = FluxGround(heat_flux=Quantity(value=300.0))
SUN = ExchangeGround(temperature=Quantity(value=330.0), coefficient=Quantity(value=10.0))
BURNER = Source(
    position=(1.3, 0.9, 0.5), size=(0.6, 0.7, 0.4), power=5e3, thrust=0.2, elevation=30, start=0.01
)


def mesh(cells: tuple[int, int, int] = (12, 10, 14)) -> Grid:
    first = 0.02 if cells[2] > 10 else None
    return GridSpec(x=(0, 3), y=(0, 2), height=1.0, cells=cells, first_cell=first).build()


def marched(
    arrays: Any, grid: Grid, flow: dict[str, Any], wind: Any = (None, None), **given: Any
) -> list[np.ndarray]:
    """Velocities, temperature, skin and divergence after four steps of a stirred flow, and their lengths."""
    random = np.random.default_rng(np.random.SeedSequence(7))
    velocity = 0.3 * random.standard_normal((3, *grid.shape))
    temperature = 300 + 2 * random.standard_normal(grid.shape)
    convection = Convection(**({"noise": 0.0, "viscosity": 1e-4} | flow))
    bounds = {"ground": HOT, "sides": Sides(), "top": Top(kind="insulated"), "diffusivity": 2.2e-5}
    air = MovingAir(grid, convection, arrays=arrays, **(bounds | given))
    lengths = []
    with air:
        air.set(temperature, (velocity[0], velocity[1], velocity[2]))
        for _ in range(4):
            lengths.append(air.longest_step())
            air.advance(lengths[-1], wind)
        return [*air.velocity, air.temperature, air.skin_at(air.time), np.array(lengths), air.divergence()]


def apart(one: list[np.ndarray], other: list[np.ndarray]) -> float:
    """The largest difference in velocity [m/s], temperature [K], and length of a step [s]."""
    return max(float(np.max(np.abs(a - b))) for a, b in zip(one[:-1], other[:-1], strict=True))


ENDS = ["periodic", "insulated"]
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    f"{x}, {y}, {closure}": ({"closure": closure}, {"sides": Sides(x=x, y=y)})
    for x, y, closure in itertools.product(ENDS, ENDS, ["vreman", "none"])
} | {
    "rough ground in wind": ({"ground": "rough"}, {"wind": (1.0, -0.5)}),
    "flux into rough ground": ({"ground": "rough"}, {"ground": FLUX}),
    "exchange": ({}, {"ground": SUN}),
    "held top, no slip": ({"top": "no-slip", "closure": "none"}, {"top": Top(temperature=290.0)}),
    "held walls, no slip": (
        {"sides": "no-slip", "advection": "central"},
        {"sides": Sides(x="insulated"), "held_sides": {"x": (310.0, 290.0)}},
    ),
    "sources": ({}, {"sources": (BURNER,)}),
}


@pytest.mark.parametrize("name", CASES)
def test_arrays_and_loops_agree(name: str) -> None:
    """Expected: round-off, on stretched cells, after four steps that change velocities by some 0.1 m/s."""
    flow, given = CASES[name]
    one, other = (marched(arrays, mesh(), flow, **given) for arrays in (None, DOUBLE))
    assert apart(one, other) < 1e-11
    largest = max(float(np.max(np.abs(part))) for part in one[:3]) / 0.02
    assert np.max(np.abs(other[-1])) < 1e-13 * largest
    # Negative control: a viscosity that is a hundredth larger is no round-off.
    assert apart(marched(DOUBLE, mesh(), flow | {"viscosity": 1.01e-4}, **given), one) > 1e-7


@pytest.mark.parametrize("cells", [(12, 1, 14), (9, 7, 5), (4, 4, 3), (1, 1, 6)])
def test_any_mesh(cells: tuple[int, int, int]) -> None:
    """Two dimensions, one column, and numbers of cells that nothing divides."""
    one, other = (marched(arrays, mesh(cells), {"closure": "none"}) for arrays in (None, DOUBLE))
    assert apart(one, other) < 1e-11


@pytest.mark.parametrize(("count", "wall"), list(itertools.product([1, 2, 3, 8, 9, 30], [False, True])))
def test_waves_are_orthonormal_and_make_differences_diagonal(count: int, wall: bool) -> None:
    """Against the second difference written out, with its ends wrapped or mirrored."""
    basis, eigenvalues = wave_basis(count, wall)
    assert np.max(np.abs(basis @ basis.T - np.eye(count))) < 1e-14
    identity = np.eye(count)
    around = np.pad(identity, ((0, 0), (1, 1)), mode="edge" if wall else "wrap")
    second = around[:, 2:] + around[:, :-2] - 2 * identity
    assert np.max(np.abs(basis @ second @ basis.T + np.diag(eigenvalues))) < 1e-14 * 4
    if count > 3:  # negative control: the other kind of ends (three cells cannot tell)
        other, _ = wave_basis(count, not wall)
        assert np.max(np.abs(other @ second @ other.T + np.diag(eigenvalues))) > 0.01


def test_waves_go_there_and_back() -> None:
    basis, _ = wave_basis(6, wall=False)
    values = np.random.default_rng(3).standard_normal((2, 6, 8))
    waves = Waves(DOUBLE, basis, 2, 8)
    there = waves.there(DOUBLE.Float(values.ravel()))
    assert np.max(np.abs(np.array(there).reshape(2, 6, 8) - np.einsum("rm,bmq->brq", basis, values))) < 1e-14
    assert np.max(np.abs(np.array(waves.back(there)).reshape(values.shape) - values)) < 1e-14


def test_a_run_goes_on_from_its_checkpoint_to_the_same_bits(tmp_path: Path) -> None:
    grid = GridSpec(x=(0, 2), y=(0, 2), height=1.0, cells=(8, 8, 8), first_cell=0.05).build()
    given: dict[str, Any] = {"ground": HOT, "times": (0.5, 1.0, 1.5), "arrays": DOUBLE}
    given["convection"] = Convection(noise=0.5, ground="rough")
    beginning = np.full(grid.shape, 300.0)
    whole = list(convect(grid, beginning, **given))
    first = convect(grid, beginning, checkpoints=Checkpoints(tmp_path, "run", 0.3), **given)
    next(first)
    next(first)
    first.close()  # type: ignore[attr-defined]
    later = list(convect(grid, beginning, checkpoints=Checkpoints(tmp_path, "run", 0.3), first=2, **given))
    assert np.array_equal(later[0].temperature, whole[2].temperature)
    assert np.max(np.abs(whole[2].temperature - whole[1].temperature)) > 0.1


def test_where_air_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """The processor, unless a card is asked for, or is there and has enough to do."""
    assert flow_arrays("llvm", 10**7) is None
    monkeypatch.setattr("drjit.has_backend", lambda backend: False)
    assert flow_arrays("auto", 10**7) is None
    with pytest.raises(MachineError, match="graphics card"):
        flow_arrays("cuda", 10)
    made = []
    monkeypatch.setattr("nigemizu.field.types", lambda *given: made.append(given) or DOUBLE)
    monkeypatch.setattr("drjit.has_backend", lambda backend: True)
    assert flow_arrays("auto", 10**7) is DOUBLE
    assert flow_arrays("auto", 10**4) is None
    assert made == [("cuda", "double")]
