"""The same view by straight, layered and bent light, in one labelled picture and each alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from nigemizu.progress import ProgressMeter
from nigemizu.scene.running import AirSource, Variant, air_at

if TYPE_CHECKING:
    from nigemizu.scene.model import Scene

__all__ = ["METHODS", "compare", "single_paths"]

METHODS: Final = {
    "straight": "straight: no refraction",
    "layered": "layered: panes of constant index",
    "bent": "bent: through the volume",
}


def compare(
    scene: Scene,
    path: Path,
    time: float | None,
    air: AirSource,
    variant: Variant,
    command: str,
    progress: ProgressMeter,
) -> list[Path]:
    """See `nigemizu.scene.Scene.compare`."""
    from nigemizu.output import Provenance, ready_to_write
    from nigemizu.output.panels import write_panels

    path = ready_to_write(path, (".png",))
    scene.check()
    volume = air_at(scene, time, air, progress)
    pictures = {
        method: scene.render(air=volume, method=method, variant=variant, progress=progress)
        for method in METHODS
    }
    panels = [(METHODS[method], picture.pixels) for method, picture in pictures.items()]
    written = [write_panels(path, panels, provenance=Provenance(scene=scene.to_toml(), command=command))]
    for single, picture in zip(single_paths(path), pictures.values(), strict=True):
        written.append(picture.save(single, command=command))
    return written


def single_paths(path: Path) -> list[Path]:
    """Where the pictures of each method go, beside the comparison `path`."""
    return [path.with_stem(f"{path.stem}_{method}") for method in METHODS]
