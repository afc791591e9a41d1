"""A scene on the compute device: built once, then seen through any number of airs."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, Final, final

from nigemizu.errors import NigemizuWarning
from nigemizu.progress import SILENT, ProgressMeter
from nigemizu.scene.picture import RenderedPicture
from nigemizu.scene.running import AirSource, AirVolume, Variant, air_at

if TYPE_CHECKING:
    from nigemizu.render.report import ErrorReport
    from nigemizu.scene.model import Scene

__all__ = ["Studio", "render", "warn_of_errors", "warn_of_lost_rays"]

# Up to a row of pixels at the horizon is nothing to warn of: over flat ground its light runs level for ever.
_SEEN_SHARE: Final = 5e-3
_FIXED_STEP_ERROR: Final = 1.0  # pixels that a fixed step may err by without a warning


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

        scene, camera = self._scene, self._scene.camera
        if air is None:
            self._integrator.set_medium(None)
        else:
            angle = scene.tracer.angle(camera.pixel_angle)
            make = partial(medium_of, *air[:4], tracer=scene.tracer, angle=angle)
            self._integrator.set_medium(make(), partial(make, precision="double", storage="single"))
        taken = picture(
            self._built,
            samples=camera.samples,
            seed=camera.seed,
            frame=frame,
            exposure=camera.exposure,
            progress=progress,
        )
        return RenderedPicture(taken.radiance, taken.statuses, scene, taken.report)


def render(
    scene: Scene, time: float | None, air: AirSource, variant: Variant, progress: ProgressMeter
) -> RenderedPicture:
    """See `nigemizu.scene.Scene.render`."""
    scene.check()
    studio = Studio(scene, variant)
    volume = None if scene.tracer.method == "straight" else air_at(scene, time, air, progress)
    picture = studio.shoot(volume, progress=progress)
    warn_of_lost_rays(picture.statuses, scene)
    if picture.report is not None:
        warn_of_errors(picture.report, scene)
    return picture


def warn_of_errors(report: ErrorReport, scene: Scene) -> None:
    """Warn when what was seen of the errors is larger than the scene asks for."""
    tracer, pixel = scene.tracer, scene.camera.pixel_angle
    if tracer.step is None:
        asked = tracer.angle(pixel) / pixel
        remedy = _remedy(scene)
    else:
        asked, remedy = _FIXED_STEP_ERROR, "shorten tracer.step, or leave it out for steps that adapt"
    if report.worst > asked:
        wanted = "" if tracer.step is not None else f" where {asked:.2g} were asked for"
        warnings.warn(
            f"what is seen is displaced by up to {report.worst:.2g} pixels (mean {report.mean:.2g}){wanted}; "
            f"{remedy}",
            NigemizuWarning,
            stacklevel=4,
        )
    if report.strays > _SEEN_SHARE:
        warnings.warn(
            f"{report.strays:.2%} of the rays meet something else than they ought to; {remedy}",
            NigemizuWarning,
            stacklevel=4,
        )


def _remedy(scene: Scene) -> str:
    ways = []
    if scene.tracer.sharing:
        ways.append("tracer.sharing = false")
    if scene.tracer.precision != "double":
        ways.append("tracer.precision = 'double'")
    return f"set {' or '.join(ways)}" if ways else "ask for less with tracer.accuracy"


def warn_of_lost_rays(statuses: Mapping[str, int], scene: Scene) -> None:
    """Warn when so many rays ran out of steps that it can be seen."""
    total = sum(statuses.values())
    share = statuses.get("out-of-steps", 0) / total if total else 0.0
    if share > _SEEN_SHARE:
        warnings.warn(
            f"{share:.2%} of the rays used up their {scene.tracer.max_steps} steps before they ended; "
            "raise tracer.max_steps, or ask for less with tracer.accuracy",
            NigemizuWarning,
            stacklevel=4,
        )
