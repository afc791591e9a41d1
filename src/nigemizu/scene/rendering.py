"""A scene on the compute device: built once, then seen through any number of airs."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Final, final

from nigemizu.errors import NigemizuWarning
from nigemizu.progress import SILENT, ProgressMeter
from nigemizu.scene.picture import RenderedPicture
from nigemizu.scene.running import AirSource, AirVolume, air_at

if TYPE_CHECKING:
    from nigemizu.scene.model import Scene

__all__ = ["Studio", "render"]

# Fewer lost rays than this cannot be seen in a picture.
_SEEN_SHARE: Final = 1e-4


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

    def __init__(self, scene: Scene, variant: str) -> None:
        from nigemizu.render.settings import Settings
        from nigemizu.render.variant import select_variant

        self._backend = select_variant(variant).split("_", 1)[0]
        # Mitsuba's classes belong to a variant: these modules come after its choice.
        from nigemizu.render.assembly import build
        from nigemizu.render.integrator import integrator

        self._scene = scene
        settings = Settings(tracer=scene.tracer, visibility=scene.light.visibility)
        self._integrator = integrator(settings=settings)
        self._built = build(scene.camera, scene.light, scene.objects, integrator=self._integrator)

    @property
    def surfaces(self) -> Any:
        """The objects as the callback that rays are traced against."""
        from nigemizu.render.bending import surface_query

        return surface_query(self._built)

    def shoot(self, air: AirVolume | None, *, frame: int = 0, progress: ProgressMeter = SILENT) -> RenderedPicture:
        """Render the scene through `air` (None: no air); each `frame` draws its own random numbers."""
        from nigemizu.render.picture import picture

        scene = self._scene
        self._integrator.set_medium(None if air is None else medium(scene, air, self._backend))
        camera = scene.camera
        taken = picture(
            self._built,
            samples=camera.samples,
            seed=camera.seed,
            frame=frame,
            exposure=camera.exposure,
            progress=progress,
        )
        _warn_of_lost_rays(taken.statuses, scene.tracer.max_steps)
        return RenderedPicture(taken.radiance, taken.statuses, scene)


def medium(scene: Scene, air: AirVolume, backend: str, *, precision: str = "single") -> Any:
    """The air on the device: the trilinear volume, or Berger's panes cut from its mean profile."""
    from nigemizu import field

    tracer = scene.tracer
    types = field.types(backend, precision=precision, differentiable=True)
    if tracer.method == "layered":
        profile = air.refractivity.mean(axis=(1, 2))
        return field.Layers.from_profile(
            air.z,
            profile,
            types=types,
            count=tracer.layers,
            spacing=tracer.layer_spacing,
            waviness_amplitude=tracer.waviness_amplitude,
            waviness_length=tracer.waviness_length,
            waviness_seed=tracer.waviness_seed,
        )
    return field.TrilinearVolume(air.x, air.y, air.z, air.refractivity, types=types, beyond=tracer.beyond)


def render(
    scene: Scene, time: float | None, air: AirSource, variant: str, progress: ProgressMeter
) -> RenderedPicture:
    """See `nigemizu.scene.Scene.render`."""
    scene.check()
    studio = Studio(scene, variant)
    volume = None if scene.tracer.method == "straight" else air_at(scene, time, air, progress)
    return studio.shoot(volume, progress=progress)


def _warn_of_lost_rays(statuses: dict[str, int], max_steps: int) -> None:
    total = sum(statuses.values())
    share = statuses.get("out-of-steps", 0) / total if total else 0.0
    if share > _SEEN_SHARE:
        warnings.warn(
            f"{share:.2%} of the rays used up their {max_steps} steps before they ended; "
            "raise tracer.max_steps or tracer.step",
            NigemizuWarning,
            stacklevel=4,
        )
