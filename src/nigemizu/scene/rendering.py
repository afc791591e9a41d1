"""A scene on the compute device: built once, then seen through any number of airs."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, final

from nigemizu.errors import InputError, NigemizuWarning
from nigemizu.progress import SILENT, ProgressMeter
from nigemizu.scene.colours import Colours
from nigemizu.scene.far_air import FarAir, medium
from nigemizu.scene.mapped import mapped_camera, mapped_objects
from nigemizu.scene.picture import RenderedPicture
from nigemizu.scene.running import AirSource, AirVolume, Variant, air_at, air_instants

if TYPE_CHECKING:
    from nigemizu.render.passes import Shot
    from nigemizu.render.report import ErrorReport
    from nigemizu.scene.model import Scene
    from nigemizu.scene.truth import PictureTruth

__all__ = ["Studio", "render", "warn_of_errors", "warn_of_lost_rays"]

# Up to a row of pixels at the horizon is nothing to warn of: over flat ground its light runs level for ever.
_SEEN_SHARE: Final = 5e-3
# The worst of a thousand rays, next to a kink of the air, may be a little worse than was asked for.
_WORSE: Final = 1.3
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
        from nigemizu.render import Globe, Settings, integrator, lens_sensors, select_variant

        select_variant(variant)
        self._scene, self._variant = scene, variant
        self._without_air: Studio | None = None
        self._far = None if scene.profile is None else FarAir.of(scene)
        self._camera = mapped_camera(scene)
        tracer = scene.tracer
        if tracer.method == "straight" and scene.round:
            tracer = tracer.model_copy(update={"method": "bent"})  # in the map
        settings = Settings(tracer=tracer, visibility=scene.light.visibility)
        self._integrator = integrator(settings=settings)
        if scene.earth is not None and self._far is not None and scene.round:
            top = float(scene.earth.conformal_height(self._far.profile.top))
            self._integrator.globe = Globe(scene.earth.radius, self._camera.eye, top)
        self._colours: Colours | None = None
        self._built: Any = None
        self._light: Any = None
        self._stand_at(0.0)
        # None stands for the sensor of the built scene itself.
        self._lens: list[Any] = lens_sensors(self._camera) or [None]

    def _stand_at(self, time: float) -> None:
        """Build the scene in the light of a time [s], unless it stands in it already."""
        from nigemizu.render import build

        light = self._scene.light.at(time)
        if light == self._light:
            return
        self._light, sky = light, None
        if self._far is not None and light.sky == "physical":
            self._colours = Colours.of(self._scene, self._far, light, self._camera.eye[2])
            sky = self._colours.sky
        objects = mapped_objects(self._scene)
        self._built = build(self._camera, light, objects, integrator=self._integrator, sky=sky)

    @property
    def scene(self) -> Scene:
        """What is seen."""
        return self._scene

    @property
    def surfaces(self) -> Any:
        """The objects as the callback that rays are traced against."""
        from nigemizu.render import surface_query

        return surface_query(self._built)

    def shoot(
        self,
        air: AirVolume | Iterable[AirVolume] | None,
        *,
        weights: Sequence[float] | None = None,
        frame: int = 0,
        time: float = 0.0,
        measured: bool = True,
        progress: ProgressMeter = SILENT,
    ) -> RenderedPicture:
        """Render the scene through air.

        Parameters
        ----------
        air : AirVolume, or iterable of AirVolume, or None
            Air that stands still during the exposure; or that of each of its instants
            (`nigemizu.render.Camera.instants`), among which the samples are divided, and of which one at a
            time is held; or no air.
        weights : sequence of float, optional
            Share of each instant in the picture, relative to the others. Default: all the same.
        frame : int
            Each draws its own random numbers.
        time : float, s
            Where Sun and Moon stand, if they move.
        measured : bool
            Whether the errors of the rays are measured.
        progress : ProgressMeter
            Receives how far the work has come.
        """
        from nigemizu.render import add_noise, diffract, picture
        from nigemizu.render.diffraction import WAVELENGTHS

        scene, camera = self._scene, self._scene.camera
        self._stand_at(time)
        airs = [air] if air is None or isinstance(air, AirVolume) else air
        shares = _shares(airs, weights, len(camera.instants(0.0)))
        taken = picture(
            self._built,
            samples=max(camera.samples, len(shares) * self._bands),
            seed=camera.seed,
            frame=frame,
            exposure=camera.exposure,
            shots=self._shots(airs, shares),
            measured=measured,
            progress=progress,
        )
        noiseless = taken.radiance
        if camera.diffraction:
            noiseless = diffract(noiseless, [camera.airy_scale(wavelength) for wavelength in WAVELENGTHS])
        if camera.noise is None:
            return RenderedPicture(noiseless, taken.statuses, scene, taken.report)
        pixels = add_noise(noiseless, camera.noise, seed=camera.seed, frame=frame)
        return RenderedPicture(pixels, taken.statuses, scene, taken.report, noiseless)

    def truth(
        self,
        picture: RenderedPicture,
        air: AirVolume | Sequence[AirVolume] | None,
        time: float,
        *,
        frame: int = 0,
    ) -> PictureTruth:
        """What each pixel of the picture taken last sees, and the picture without air.

        Parameters
        ----------
        picture : RenderedPicture
        air : AirVolume, or sequence of AirVolume, or None
            As for `shoot`; of several instants the one in the middle counts.
        time : float, s
            When the picture was taken.
        frame : int
        """
        from nigemizu.render.sensors import pinhole_sensor
        from nigemizu.render.truth import ground_truth
        from nigemizu.scene.truth import PictureTruth

        middle = air if air is None or isinstance(air, AirVolume) else air[len(air) // 2]
        if middle is not air or self._colours is not None:  # otherwise it is in place still
            self._set_air(middle)
        vacuum, globe = None, self._integrator.globe
        if globe is not None and self._far is not None:
            vacuum = medium(self._scene, self._far.vacuum(), precision="double")
        # Through the middle of the aperture, where there is one.
        layers = ground_truth(
            self._integrator.bending, self._built, pinhole_sensor(self._camera), globe=globe, vacuum=vacuum
        )
        if self._without_air is None:
            straight = self._scene.with_changes({"tracer.method": "straight"})
            self._without_air = Studio(straight, self._variant)
        straight_picture = self._without_air.shoot(None, frame=frame, time=time)
        return PictureTruth(layers, picture.noiseless, straight_picture.noiseless, time, self._scene)

    def _shots(self, airs: Iterable[AirVolume | None], shares: Sequence[float]) -> Iterator[Shot]:
        """The parts of a picture: of each instant, from each of its points on the aperture."""
        from nigemizu.render.passes import Shot

        instants, lens = len(shares), self._lens
        samples = _divided(self._scene.camera.samples, instants)
        given = 0
        for index, air in enumerate(airs):
            given += 1
            if given > instants:
                break
            for band, taken in enumerate(_divided(samples[index], self._bands)):
                self._set_air(air, None if self._colours is None else band)
                # Every so many points for each instant: any part of the sequence fills the aperture.
                points = lens[index % len(lens) :: instants][:taken]
                for sensor, count in zip(points, _divided(taken, len(points)), strict=True):
                    yield Shot(count, sensor, shares[index] / self._bands * count / taken)
        if given != instants:
            raise InputError(
                "one air per instant is needed",
                key="air",
                value=f"{given}{' or more' if given > instants else ''}",
                expected=f"{instants}",
            )

    @property
    def _bands(self) -> int:
        """Number of wavelengths that are rendered one by one."""
        return 1 if self._colours is None else len(self._colours)

    def _set_air(self, air: AirVolume | None, band: int | None = None) -> None:
        """Put air in, for light of a band of the physical sky or of the scene's own wavelength."""
        scene = self._scene
        if air is None and scene.round and self._far is not None:
            air = self._far.vacuum()
        elif self._colours is not None and self._far is not None and air is not None and band is not None:
            air = self._far.at_wavelength(air, self._colours.wavelength(band))
        if self._colours is not None and band is not None:
            self._integrator.heavens = self._colours.heavens(band, air)
        if air is None:
            self._integrator.set_medium(None)
            return
        make = partial(medium, scene, air, angle=scene.tracer.angle(scene.camera.pixel_angle))
        self._integrator.set_medium(make(), partial(make, precision="double", storage="single"))


def _shares(
    airs: Iterable[AirVolume | None], weights: Sequence[float] | None, instants: int
) -> tuple[float, ...]:
    """The weight of each instant, adding up to 1."""
    if weights is None:
        count = len(airs) if isinstance(airs, Sequence) else instants
        weights = [1.0] * count
    if not weights or min(weights) < 0 or not 0 < sum(weights) < float("inf"):
        raise InputError(
            "no shares of a picture", key="weights", value=list(weights), expected="numbers ≥ 0, some above 0"
        )
    return tuple(weight / sum(weights) for weight in weights)


def _divided(samples: int, parts: int) -> list[int]:
    """Samples per pixel of each part: equal as far as possible, one at least."""
    whole, rest = divmod(samples, parts)
    return [max(1, whole + (part < rest)) for part in range(parts)]


def render(
    scene: Scene,
    time: float | None,
    air: AirSource,
    variant: Variant,
    progress: ProgressMeter,
    *,
    truth: bool = False,
) -> RenderedPicture:
    """See `nigemizu.scene.Scene.render`."""
    scene.check()
    studio = Studio(scene, variant)
    airs = _airs(scene, time, air, progress, variant)
    shown = scene.time.shown if time is None else time
    picture = studio.shoot(airs, time=shown, progress=progress)
    if truth:
        picture = replace(picture, truth=studio.truth(picture, airs, shown))
    warn_of_lost_rays(picture.statuses, scene)
    if picture.report is not None:
        warn_of_errors(picture.report, scene)
    return picture


def _airs(
    scene: Scene, time: float | None, air: AirSource, progress: ProgressMeter, variant: Variant
) -> AirVolume | tuple[AirVolume, ...] | None:
    """The air that one picture is seen through, at each instant of its exposure if it moves."""
    if scene.tracer.method == "straight":
        return None
    if scene.camera.shutter == 0 or isinstance(air, AirVolume):
        return air_at(scene, time, air, progress, variant)
    instants = scene.camera.instants(scene.time.shown if time is None else time)
    return tuple(air_instants(scene, instants, air, progress, variant=variant))


def warn_of_errors(report: ErrorReport, scene: Scene) -> None:
    """Warn when what was seen of the errors is larger than the scene asks for."""
    tracer, pixel = scene.tracer, scene.camera.pixel_angle
    if tracer.step is None:
        asked = tracer.angle(pixel) / pixel
        remedy = _remedy(scene)
    else:
        asked, remedy = _FIXED_STEP_ERROR, "shorten tracer.step, or leave it out for steps that adapt"
    faults = []
    if report.usual_worst > (asked if tracer.step is not None else _WORSE * asked):
        wanted = "" if tracer.step is not None else f" where {asked:.2g} were asked for"
        faults.append(
            f"what is seen is displaced by up to {report.worst:.2g} pixels (mean {report.mean:.2g}){wanted}"
        )
    if report.strays > _SEEN_SHARE:
        faults.append(f"{report.strays:.2%} of the rays meet something else than they ought to")
    if faults:
        warnings.warn(f"{', and '.join(faults)}; {remedy}", NigemizuWarning, stacklevel=4)


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
