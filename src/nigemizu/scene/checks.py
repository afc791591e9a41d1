"""What cannot work although each value is valid by itself."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from nigemizu.errors import InputError, NigemizuWarning
from nigemizu.heat.flow.settings import VOLUMES
from nigemizu.heat.grid import VOLUMES_IN_MEMORY
from nigemizu.values import Value

if TYPE_CHECKING:
    from nigemizu.heat.grid import GridSpec
    from nigemizu.scene.model import Scene
    from nigemizu.scene.sections import Heated

__all__ = ["check"]

# A camera beyond these is a slip of the keyboard, not a place to stand.
_HIGHEST_EYE, _FARTHEST_EYE = 1e5, 1e6


def check(scene: Scene, available: Callable[[], int | None]) -> None:
    """See `nigemizu.scene.Scene.check`."""
    _check_files(scene)
    _check_camera(scene)
    _check_far_air(scene)
    heated = scene.heated
    if heated is None:
        return
    _check_memory(scene, heated.grid, available)
    _check_extent(scene, heated.grid)
    if scene.process == "convection":
        _check_flow(scene, heated)
        _check_turbulence(scene, heated.grid)
    elif scene.sources:
        raise InputError(
            "only air that moves by itself carries away what sources release",
            key="process",
            value=scene.process,
            expected="convection, with [[sources]]",
        )


def _check_far_air(scene: Scene) -> None:
    """What goes with air in layers over a round Earth, and what does not."""
    if scene.profile is None:
        if scene.earth is not None:
            raise InputError(
                "a round Earth needs air that reaches up to where light leaves it",
                key="profile",
                remedy='add a section [profile], for instance with kind = "us1976"',
            )
        if scene.light.sky == "physical":
            raise InputError(
                "a physical sky needs the air that makes it",
                key="light.sky",
                value=scene.light.sky,
                remedy='add a section [profile], for instance with kind = "us1976"',
            )
        return
    for key, value, expected in (
        ("method", scene.tracer.method, ("bent", "straight")),
        ("interpolation", scene.tracer.interpolation, ("stratified",)),
    ):
        if value not in expected:
            raise InputError(
                "does not work with air in layers over a round Earth",
                key=f"tracer.{key}",
                value=value,
                expected=" or ".join(expected),
            )
    if scene.tracer.step is not None:
        raise InputError(
            "fixed intervals do not reach from the ground to the top of the air",
            key="tracer.step",
            value=scene.tracer.step,
            remedy="leave it out, for steps that adapt",
        )


def _check_flow(scene: Scene, heated: Heated) -> None:
    from nigemizu.heat.flow.checks import require_resolved

    grid = heated.grid.build()
    require_resolved(
        grid,
        scene.convection,
        heated.ground,
        scene.wind,
        heated.initial.sample(grid).mean(axis=(1, 2)),
        scene.diffusivity.molecular,
        max(scene.time.duration, max(scene.film.times)),
        scene.sources,
    )


def _check_turbulence(scene: Scene, spec: GridSpec) -> None:
    """Warn of turbulence whose large eddies the flow makes, too."""
    if scene.turbulence is None or scene.turbulence.largest is not None:
        return
    grid = spec.build()
    widest = max(grid.horizontal_step(axis) for axis in "xy" if getattr(grid, axis).size > 1)
    warnings.warn(
        "turbulence: the flow makes large eddies itself, and these are added once more; set "
        f"turbulence.largest to what its cells cannot hold, 1 to 3 times their {widest:.3g} m",
        NigemizuWarning,
        stacklevel=4,
    )


def _check_files(scene: Scene) -> None:
    for key, path in _paths(scene, ""):
        if not path.expanduser().exists():
            raise InputError(f"no such file: {path}", key=key)  # in full, however long


def _paths(value: Value, prefix: str) -> Iterator[tuple[str, Path]]:
    for name in type(value).model_fields:
        content = getattr(value, name)
        entries = content if isinstance(content, tuple) else (content,)
        for position, entry in enumerate(entries):
            key = f"{prefix}{name}" + (f".{position}" if isinstance(content, tuple) else "")
            if isinstance(entry, Path):
                yield key, entry
            elif isinstance(entry, Value):
                yield from _paths(entry, f"{key}.")


def _check_camera(scene: Scene) -> None:
    x, y, z = scene.camera.eye
    ground = max((entry.height for entry in scene.objects if entry.kind == "ground"), default=0.0)
    if z <= ground:
        raise InputError(
            "the eye is below the ground",
            key="camera.eye",
            value=list(scene.camera.eye),
            expected=f"z > {ground:g} m",
        )
    if z > _HIGHEST_EYE or max(abs(x), abs(y)) > _FARTHEST_EYE:
        raise InputError(
            "the eye is far from everything",
            key="camera.eye",
            value=list(scene.camera.eye),
            expected=f"metres, within {_FARTHEST_EYE:g} m of the origin and below {_HIGHEST_EYE:g} m",
        )
    if scene.camera.target == scene.camera.eye:
        raise InputError("is where the eye is", key="camera.target", value=list(scene.camera.eye))


def _check_memory(scene: Scene, spec: GridSpec, available: Callable[[], int | None]) -> None:
    needed, at_hand = spec.memory(), available()
    if scene.process == "convection":
        needed = needed * VOLUMES // VOLUMES_IN_MEMORY
    if at_hand is not None and needed > at_hand:
        raise InputError(
            f"the volume needs {needed / 1e9:.1f} GB of memory and {at_hand / 1e9:.1f} GB are available",
            key="grid.cells",
            value=list(spec.cells),
            remedy="use fewer cells",
        )


def _check_extent(scene: Scene, spec: GridSpec) -> None:
    # Around sources the grid is what they heat, and not what is seen.
    if scene.tracer.beyond != "straight" or scene.sources or scene.profile is not None:
        return
    low, high = spec.x
    right, left = spec.y
    for position, entry in enumerate(scene.objects):
        place = getattr(entry, "position", None)
        if place is None or (low <= place[0] <= high and right <= place[1] <= left):
            continue
        warnings.warn(
            f"objects.{position} ({entry.kind}) stands outside the grid, where light goes straight; "
            "enlarge grid.x and grid.y, or set tracer.beyond = 'extend' or 'mean'",
            NigemizuWarning,
            stacklevel=4,
        )
