"""A scene on the compute device: built once, then seen through any number of airs."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np

from nigemizu.errors import NigemizuWarning
from nigemizu.progress import SILENT, ProgressMeter
from nigemizu.scene.picture import RenderedPicture
from nigemizu.scene.running import AirSource, AirVolume, Variant, air_at

if TYPE_CHECKING:
    from nigemizu.scene.model import Scene

__all__ = ["Studio", "render", "warn_of_lost_rays"]

# Up to a row of pixels at the horizon is nothing to warn of: over flat ground its light runs level for ever.
_SEEN_SHARE: Final = 5e-3
# Steps that a ray needs while it is turned back, and the share of the mirage's height that may lack them.
_TURN_STEPS: Final = 4
_RAGGED_SHARE: Final = 0.2


@final
class Studio:
    """A scene's camera, light and objects, ready to be seen through air.

    Parameters
    ----------
    scene : Scene
        What is seen.
    variant : {"auto", "llvm", "cuda"}
        Compute device; one per process.
    """

    def __init__(self, scene: Scene, variant: Variant) -> None:
        from nigemizu.render import Settings, build, integrator, select_variant

        select_variant(variant)
        self._scene = scene
        settings = Settings(tracer=scene.tracer, visibility=scene.light.visibility)
        self._integrator = integrator(settings=settings)
        self._built = build(scene.camera, scene.light, scene.objects, integrator=self._integrator)

    @property
    def surfaces(self) -> Any:
        """The objects as the callback that rays are traced against."""
        from nigemizu.render import surface_query

        return surface_query(self._built)

    def shoot(
        self, air: AirVolume | None, *, frame: int = 0, progress: ProgressMeter = SILENT
    ) -> RenderedPicture:
        """Render the scene through `air` (None: no air); each `frame` draws its own random numbers."""
        from nigemizu.render import medium_of, picture

        scene = self._scene
        self._integrator.set_medium(None if air is None else medium_of(*air[:4], tracer=scene.tracer))
        camera = scene.camera
        taken = picture(
            self._built,
            samples=camera.samples,
            seed=camera.seed,
            frame=frame,
            exposure=camera.exposure,
            progress=progress,
        )
        return RenderedPicture(taken.radiance, taken.statuses, scene)


def render(
    scene: Scene, time: float | None, air: AirSource, variant: Variant, progress: ProgressMeter
) -> RenderedPicture:
    """See `nigemizu.scene.Scene.render`."""
    scene.check()
    studio = Studio(scene, variant)
    volume = None if scene.tracer.method == "straight" else air_at(scene, time, air, progress)
    if volume is not None and scene.tracer.method == "bent":
        warn_of_long_steps(volume, scene)
    picture = studio.shoot(volume, progress=progress)
    warn_of_lost_rays(picture.statuses, scene)
    return picture


def warn_of_long_steps(air: AirVolume, scene: Scene) -> None:
    """Warn when much of the light that the air turns back would be turned within a few steps.

    A ray that arrives at the angle θ = √(2 Δn) and turns where the gradient is g does so over the length
    2 θ / g. With fewer than some four steps along it, neighbouring rays turn differently: noise.
    """
    below = air.z <= scene.camera.eye[2]
    height, index = air.z[below], air.refractivity.mean(axis=(1, 2))[below]
    if height.size < 2:
        return
    gradient = np.diff(index) / np.diff(height)
    angle = np.sqrt(2.0 * (index.max() - index))
    length = np.divide(
        angle[1:] + angle[:-1], gradient, out=np.full_like(gradient, np.inf), where=gradient > 0.0
    )
    ragged = length < _TURN_STEPS * scene.tracer.step
    if np.sum((angle[:-1] - angle[1:])[ragged]) > _RAGGED_SHARE * angle.max():
        shortest = float(length[ragged].min())
        warnings.warn(
            f"the air turns light back within {shortest:.2g} m, which a step of {scene.tracer.step:g} m "
            f"makes ragged; set tracer.step to {shortest / _TURN_STEPS / 2:.1g} or less",
            NigemizuWarning,
            stacklevel=4,
        )


def warn_of_lost_rays(statuses: Mapping[str, int], scene: Scene) -> None:
    """Warn when so many rays ran out of steps that it can be seen."""
    total = sum(statuses.values())
    share = statuses.get("out-of-steps", 0) / total if total else 0.0
    if share > _SEEN_SHARE:
        warnings.warn(
            f"{share:.2%} of the rays used up their {scene.tracer.max_steps} steps before they ended; "
            "raise tracer.max_steps or tracer.step",
            NigemizuWarning,
            stacklevel=4,
        )
