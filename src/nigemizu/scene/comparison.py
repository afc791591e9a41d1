"""The same view by straight, layered and bent light, in one labelled picture and each alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from nigemizu.progress import ProgressMeter
from nigemizu.scene.running import AirSource, Variant, air_at

if TYPE_CHECKING:
    from nigemizu.scene.model import Scene

__all__ = ["METHODS", "compare"]

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
    volume = air_at(scene, time, air, progress, variant)
    pictures = {
        method: scene.render(time, air=volume, method=method, variant=variant, progress=progress)
        for method in _methods(scene)
    }
    panels = [(METHODS[method], picture.shown) for method, picture in pictures.items()]
    provenance = Provenance(scene=scene.to_toml(), command=command)
    written = [write_panels(path, panels, highlights=scene.camera.highlights, provenance=provenance)]
    for method, picture in pictures.items():
        written.append(picture.save(path.with_stem(f"{path.stem}_{method}"), command=command))
    return written


def _methods(scene: Scene) -> list[str]:
    """Panes are flat: there are none over a round Earth."""
    return [method for method in METHODS if method != "layered" or not scene.round]
