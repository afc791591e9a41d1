"""Running a scene: from its description to air and to pictures."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.memory import available_memory
from nigemizu.progress import ProgressMeter
from nigemizu.scene.far_air import FarAir
from nigemizu.scene.turbulent import AddedTurbulence

if TYPE_CHECKING:
    import xarray

    from nigemizu.field import Types
    from nigemizu.heat import Checkpoints, State
    from nigemizu.scene.model import Scene

__all__ = [
    "AirSource",
    "AirVolume",
    "Variant",
    "air_at",
    "air_instants",
    "flow_arrays",
    "open_air",
    "require_within",
    "save_air",
    "simulate",
]

AirSource: TypeAlias = "xarray.Dataset | AirVolume | str | os.PathLike[str] | None"
Variant: TypeAlias = Literal["auto", "llvm", "cuda"]
FloatArray: TypeAlias = NDArray[np.float64]

_PHYSICS: Final = {
    "grid", "initial", "ground", "sides", "top", "diffusivity", "wind", "convection", "sources",
}  # fmt: skip

# Cells; a step of fewer is made of kernels that take longer to start than to run.
_WORTH_A_CARD: Final = 100_000


class AirVolume(NamedTuple):
    """The refractive-index volume at one instant.

    Attributes
    ----------
    x, y, z : (nx,), (ny,), (nz,) float64, m
        Positions of the nodes; over a round Earth x and y along its surface, and z the conformal height.
    refractivity : (nz, ny, nx) float64, 1
        n − 1 at the nodes; over a round Earth n′ − 1 (`nigemizu.air.Earth`).
    temperature : (nz,) float64, K, optional
        Horizontal mean, for the profile beside a ray diagram; the rays do not need it.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    refractivity: FloatArray
    temperature: FloatArray | None = None


def simulate(
    scene: Scene, times: tuple[float, ...], progress: ProgressMeter, variant: Variant = "auto"
) -> xarray.Dataset:
    """See `nigemizu.scene.Scene.simulate`."""
    from nigemizu.heat import complete, to_dataset

    scene.check()
    _require_times(times, scene)
    _require_memory(scene, len(times))
    states = _states(scene, times, progress, variant=variant)
    dataset = to_dataset(
        scene.require_heated().grid.build(), states, title=scene.title, scene=scene.to_toml()
    )
    return complete(dataset, scene.air)


def save_air(
    scene: Scene, path: Path, command: str, progress: ProgressMeter, variant: Variant = "auto"
) -> Path:
    """See `nigemizu.scene.Scene.save_air`."""
    from nigemizu.heat import complete, to_dataset
    from nigemizu.output import ready_to_write, write_air

    scene.check()
    path = ready_to_write(path, (".zarr", ".nc"))
    grid = scene.require_heated().grid.build()
    about = {"title": scene.title, "scene": scene.to_toml(), "history": command}
    kept = checkpoints(scene, scene.time.stored, path.with_name(f"{path.name}.checkpoints"))
    if kept is None:
        states = _states(scene, scene.time.stored, progress, variant=variant)
    else:
        states = _kept(scene, kept, progress, variant)
    instants = (complete(to_dataset(grid, [state], **about), scene.air) for state in states)
    written = write_air(air=instants, path=path)
    if kept is not None:
        kept.remove()
    return written


def air_at(
    scene: Scene, time: float | None, air: AirSource, progress: ProgressMeter, variant: Variant = "auto"
) -> AirVolume:
    """See `nigemizu.scene.Scene.air_at`."""
    if isinstance(air, AirVolume):
        return air
    shown = scene.time.shown if time is None else time
    return next(iter(air_instants(scene, (shown,), air, progress, variant=variant)))


def air_instants(
    scene: Scene,
    times: tuple[float, ...],
    air: AirSource,
    progress: ProgressMeter,
    *,
    first: int = 0,
    folder: Path | None = None,
    variant: Variant = "auto",
) -> Iterator[AirVolume]:
    """The air at each of the instants from number `first` on, one after another; only one is held.

    Air that moves by itself is kept in `folder` from time to time, and taken up from there.
    """
    from nigemizu.heat import to_dataset

    if isinstance(air, AirVolume):  # air that does not change
        yield from (air for _ in times[first:])
        return
    _require_times(times, scene)
    far = None if scene.profile is None else FarAir.of(scene)
    if far is not None and air is None and scene.heated is None:
        alone = far.alone()
        yield from (alone for _ in times[first:])
        return
    turbulence = AddedTurbulence(scene)
    if air is not None:
        dataset = open_air(air)
        require_within(dataset, times)
        near = (_volume(scene, dataset, time, turbulence) for time in times[first:])
    else:
        grid = scene.require_heated().grid.build()
        kept = None if folder is None else checkpoints(scene, times, folder)
        states = _states(scene, times, progress, first, kept, variant)
        near = (_volume(scene, to_dataset(grid, [state]), state.time, turbulence) for state in states)
    yield from near if far is None else (far.around(volume) for volume in near)


def _volume(scene: Scene, dataset: xarray.Dataset, time: float, turbulence: AddedTurbulence) -> AirVolume:
    from nigemizu.heat import mean_temperature_at, refractivity_at

    x, y, z, refractivity = refractivity_at(dataset, time, scene.air)
    temperature = mean_temperature_at(dataset, time, scene.air)
    return AirVolume(*turbulence.to(x, y, z, refractivity, temperature, time))


def open_air(air: xarray.Dataset | str | os.PathLike[str]) -> xarray.Dataset:
    """The dataset, read when it is a file."""
    from nigemizu.heat import read_air

    return read_air(os.fspath(air)) if isinstance(air, str | os.PathLike) else air


def checkpoints(scene: Scene, times: tuple[float, ...], folder: Path) -> Checkpoints | None:
    """Where air that moves by itself is kept on its way through these instants; None for other air."""
    if scene.process != "convection":
        return None
    from nigemizu.heat import Checkpoints

    physics = scene.model_dump(include=_PHYSICS, mode="json") | {"times": times, "step": scene.time.step}
    identity = hashlib.sha256(json.dumps(physics, sort_keys=True).encode()).hexdigest()
    return Checkpoints(folder, identity, scene.convection.checkpoint_every or max(times) / 20)


def _kept(scene: Scene, kept: Checkpoints, progress: ProgressMeter, variant: Variant) -> Iterator[State]:
    """All stored instants: those of an interrupted run first, then those of the flow that goes on."""
    first, times = 0, scene.time.stored
    for state in kept.instants():
        yield state
        first += 1
    if first < len(times):
        states = _states(scene, times, progress, first, kept, variant)
        for number, state in enumerate(states, start=first):
            kept.keep(number, state)
            yield state


def _states(
    scene: Scene,
    times: tuple[float, ...],
    progress: ProgressMeter,
    first: int = 0,
    kept: Checkpoints | None = None,
    variant: Variant = "auto",
) -> Iterable[State]:
    from nigemizu.heat import convect, evolve

    heated = scene.require_heated()
    grid = heated.grid.build()
    temperature = heated.initial.sample(grid)
    common: dict[str, Any] = {
        "ground": heated.ground,
        "sides": scene.sides,
        "top": scene.top,
        "diffusivity": scene.diffusivity,
        "wind": scene.wind,
        "times": times,
        "time_step": scene.time.step,
        "progress": progress,
    }
    if scene.process == "convection":
        common |= {"convection": scene.convection, "sources": scene.sources}
        common["arrays"] = flow_arrays(variant, math.prod(grid.shape))
        return convect(grid, temperature, checkpoints=kept, first=first, **common)
    return itertools.islice(evolve(grid, temperature, **common), first, None)


def flow_arrays(variant: Variant, cells: int) -> Types | None:
    """Array types of the graphics card on which air moves by itself; None: on the processor.

    ``auto`` takes a card that is at hand for meshes that keep it busy.

    Raises
    ------
    MachineError
        When ``cuda`` is asked for and there is no such card.
    """
    if variant == "llvm" or (variant == "auto" and cells < _WORTH_A_CARD):
        return None
    import drjit

    from nigemizu.field import types

    if variant == "auto" and not drjit.has_backend(drjit.JitBackend.CUDA):
        return None
    return types("cuda", "double")


def _require_times(times: tuple[float, ...], scene: Scene) -> None:
    if not times:
        raise InputError("no instant was asked for", key="times")
    if not all(np.isfinite(time) and time >= 0.0 for time in times):
        raise InputError("lies before the beginning", key="time", value=min(times), expected="seconds ≥ 0")


def _require_memory(scene: Scene, instants: int) -> None:
    """Refuse, before the first, instants that cannot be held: a temperature and an index in each cell."""
    cells = int(np.prod(scene.require_heated().grid.cells, dtype=object))
    needed, at_hand = instants * cells * 16, available_memory()
    if at_hand is not None and needed > at_hand:
        raise InputError(
            f"{instants} instants need {needed / 1e9:.1f} GB of memory, {at_hand / 1e9:.1f} GB are available",
            key="times",
            remedy="keep fewer, or write them one by one with save_air (nigemizu simulate)",
        )


def require_within(dataset: xarray.Dataset, times: tuple[float, ...]) -> None:
    """Refuse a film that the dataset does not cover before its first frame."""
    if "time" not in dataset.dims:
        return
    first, last = float(dataset["time"][0]), float(dataset["time"][-1])
    for time in (min(times), max(times)):
        if not first <= time <= last:
            raise InputError(
                "the dataset does not cover it",
                key="time",
                value=time,
                expected=f"{first:g} s to {last:g} s",
                remedy="name an instant in it, with --time or film.start",
            )
