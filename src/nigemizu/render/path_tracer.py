"""The integrator plug-in ``nigemizu``: a path tracer whose segments are bent by air."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np

from nigemizu import trace
from nigemizu.errors import InputError
from nigemizu.render.bending import Bending
from nigemizu.render.frame import Frame
from nigemizu.render.media import AirResolver, axes_of, medium_of
from nigemizu.render.report import ErrorReport, measure
from nigemizu.render.settings import Settings, read_settings

__all__ = ["STATUSES", "integrator", "integrator_class"]

STATUSES: Final = ("hit", "escaped", "out-of-steps")
"""How a camera ray can end, in the order of the counters."""

KOSCHMIEDER: Final = 3.912
"""−ln 0.02: the optical thickness through which 2 % of the contrast is left."""


def integrator(
    medium: Any = None,
    settings: Settings | None = None,
    *,
    frame: Frame | None = None,
) -> Any:
    """An integrator over air that is already on the device, to put into a Mitsuba dictionary.

    Parameters
    ----------
    medium : Field or Layers, optional
        The air, in single precision with differentiable array types
        (``field.types(backend, differentiable=True)``); None renders straight rays.
    settings : Settings, optional
        How to follow light; its `air` and `time` are not used.
    frame : Frame, optional
        Where the air stands in the scene; default: the scene's own axes, metres, z up.

    Returns
    -------
    mi.SamplingIntegrator
        Usable as ``{"type": "scene", "integrator": integrator(field), ...}``. Its ``set_medium`` exchanges
        the air between frames, ``counts`` holds the number of camera rays per entry of `STATUSES`.
    """
    from nigemizu.render.variant import select_variant

    cls = integrator_class(select_variant("auto"))
    return cls(None, settings=settings or Settings(), medium=medium, frame=frame)


@functools.cache
def integrator_class(variant: str) -> Any:
    """The integrator's class under `variant`, which must be the one in use."""

    class NigemizuIntegrator(mi.SamplingIntegrator):
        """Path tracer with emitter sampling: what the eye sees, in mirrors too, is bent by air.

        Symbols: β throughput, L radiance, η relative index of refraction so far, s path length.

        Limits: shadow rays and what rough surfaces scatter go straight, so that shadows and light that
        reaches a surface through the air are not displaced; radiance is not divided by n² (3·10⁻⁴
        relative at most in air); no polarization.
        """

        def __init__(
            self,
            props: Any,
            *,
            settings: Settings | None = None,
            medium: Any = None,
            frame: Frame | None = None,
            resolve_air: AirResolver | None = None,
        ) -> None:
            reference: Callable[[], Any] | None = None
            super().__init__(props if props is not None else mi.Properties("nigemizu"))
            if settings is None:
                settings, frame = _settings_of(props)
                if settings.air is not None and settings.tracer.method != "straight":
                    medium, reference = _media(settings, resolve_air)
            self.settings = settings
            self.frame = frame or Frame(np.eye(3), 1.0, np.zeros(3))
            visibility = settings.visibility
            self.extinction = 0.0 if visibility is None else KOSCHMIEDER / (visibility * self.frame.scale)
            self.limit_depth = 2**32 - 1 if settings.max_depth < 0 else settings.max_depth
            self.bends_scattered = True
            self.globe: Any = None  # a Globe; None: the world is flat
            self.heavens: Any = None  # a Heavens; None: the sky is the scene's environment emitter
            self.planned = 0  # samples per pixel of all passes together; 0: those of each render call
            self.reset_counts()
            self.bending = Bending(medium, settings.tracer, self.frame, reference)

        def set_medium(self, medium: Any, reference: Callable[[], Any] | None = None) -> None:
            """Put other air in; of the same kind and shape it reuses the compiled kernel.

            `reference` makes the same air in double precision, against which errors are measured.
            """
            self.bending.set_medium(medium, reference)

        def render(self, scene: Any, sensor: Any = 0, *args: Any, **options: Any) -> Any:
            """Render (the interface of `mi.Integrator`); first lays the paths that the rays share."""
            if isinstance(sensor, int):
                sensor = scene.sensors()[sensor]
            self.bends_scattered = self.bending.method != "straight" and _has_mirrors(scene)
            samples = self.planned or options.get("spp") or sensor.sampler().sample_count()
            self.bending.prepare(scene, sensor, samples)
            return super().render(scene, sensor, *args, **options)

        def report(self, scene: Any, sensor: Any) -> ErrorReport | None:
            """Errors of the rays of the last picture, which must have been of this scene and sensor."""
            return measure(self.bending, scene, sensor)

        def reset_counts(self) -> None:
            """Set the counters of camera rays per status to zero."""
            self.counts = dr.opaque(mi.UInt32, 0, shape=len(STATUSES))

        @dr.syntax
        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> tuple[Any, Any, list[Any]]:
            """Radiance along one camera ray (the interface of `mi.SamplingIntegrator`)."""
            context = mi.BSDFContext()
            ray = mi.Ray3f(ray)
            active = mi.Bool(active)
            depth = mi.UInt32(0)
            L = mi.Spectrum(0)
            β: Any = mi.Spectrum(1)
            η = mi.Float(1)
            valid = mi.Bool(False)
            first = mi.Bool(True)
            previous = dr.zeros(mi.Interaction3f)
            pdf_previous = mi.Float(1)
            delta_previous = mi.Bool(True)
            # Light of one wavelength, from beyond the air and from the air itself
            S = mi.Spectrum(0)
            apparent = mi.Vector3f(ray.d)

            # ---------------------- the bent segment from the eye ----------------------
            ray, met, s, status = self.bending.follow_from_eye(scene, ray, active)

            while dr.hint(active, label="nigemizu"):
                # ---------------------- out of the air, over a round Earth ----------------------
                local = mi.Vector3f(ray.d)
                if dr.hint(self.globe is not None, mode="scalar"):
                    leaves = active & ~met.is_valid()
                    ray.d = dr.select(leaves, self.globe.outward(ray.o, ray.d), ray.d)

                # ---------------------- what its last straight piece meets ----------------------
                si = met.compute_surface_interaction(ray, mi.RayFlags.All, active)
                s += dr.select(si.is_valid(), si.t, 0)
                self.count(status, si, active & first)
                first = mi.Bool(False)

                # ---------------------- haze between eye and surface ----------------------
                if dr.hint(self.extinction > 0, mode="scalar"):
                    clear = dr.exp(-self.extinction * s)
                    seen = active & si.is_valid()
                    L[seen] += β * (1 - clear) * self.horizon_radiance(scene, ray, seen)
                    β[seen] *= clear

                # ---------------------- one wavelength of air, Sun and sky ----------------------
                starry = mi.Bool(False)
                if dr.hint(self.heavens is not None, mode="scalar"):
                    starry = active & ~si.is_valid() & delta_previous
                    elevation = self.heavens.elevation(dr.select(depth == 0, apparent, ray.d), local)
                    S[starry] += β * self.heavens.radiance(ray.d, elevation, starry)
                    seen = active & si.is_valid()
                    clear = self.heavens.clear(s, ray.o.z, si.p.z)
                    S[seen] += β * (1 - clear) * self.heavens.airlight(ray.d, seen)
                    β[seen] *= clear

                # ---------------------- emission ----------------------
                emitter = si.emitter(scene, active)
                hidden = mi.Bool(False)
                if dr.hint(self.settings.hide_emitters, mode="scalar"):
                    hidden = (depth == 0) & (emitter != None)  # noqa: E711  (elementwise)
                ds = mi.DirectionSample3f(scene, si, previous)
                lit = active & ~hidden & ~starry & (emitter != None)  # noqa: E711
                pdf_emitter = scene.pdf_emitter_direction(previous, ds, lit & ~delta_previous)
                weight = dr.select(delta_previous, 1, _balance(pdf_previous, pdf_emitter))
                L[lit] += β * weight * emitter.eval(si, lit)

                # ---------------------- light that is sampled ----------------------
                onward = active & si.is_valid() & ~hidden & (depth + 1 < self.limit_depth)
                bsdf = si.bsdf(ray)
                shaded = onward & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
                ds, emitted = scene.sample_emitter_direction(si, sampler.next_2d(), True, shaded)
                shaded &= ds.pdf != 0
                wo = si.to_local(ds.d)
                reflected, pdf_bsdf = bsdf.eval_pdf(context, si, wo, shaded)
                weight = dr.select(ds.delta, 1, _balance(ds.pdf, pdf_bsdf))
                L[shaded] += β * weight * reflected * emitted

                # ---------------------- scattered direction ----------------------
                bs, throughput = bsdf.sample(context, si, sampler.next_1d(), sampler.next_2d(), onward)
                next_ray = si.spawn_ray(si.to_world(bs.wo))
                valid |= onward & ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null)
                valid |= active & si.is_valid() & ~hidden & (depth + 1 >= self.limit_depth)
                β[onward] *= throughput
                η[onward] *= bs.eta
                previous.p = dr.select(onward, si.p, previous.p)
                pdf_previous = dr.select(onward, bs.pdf, pdf_previous)
                delta_previous = dr.select(
                    onward, mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta), delta_previous
                )
                depth[onward & si.is_valid()] += 1

                # ---------------------- Russian roulette ----------------------
                brightest = dr.max(β)
                survival = dr.minimum(brightest * η * η, 0.95)
                gamble = onward & (depth >= self.settings.rr_depth)
                β[gamble] *= dr.rcp(survival)
                onward &= ~gamble | (sampler.next_1d() < survival)
                onward &= brightest != 0

                # ---------------------- through a hidden emitter ----------------------
                passed = active & hidden & si.is_valid()
                beyond = si.spawn_ray(ray.d)
                next_ray.o = dr.select(passed, beyond.o, next_ray.o)
                next_ray.d = dr.select(passed, beyond.d, next_ray.d)
                ray = mi.Ray3f(next_ray)
                active = onward | passed

                # ---------------------- the next segment ----------------------
                s = mi.Float(0)
                mirrored = active & (delta_previous | passed) & self.bends_scattered
                met = scene.ray_intersect_preliminary(ray, False, active & ~mirrored)
                if dr.hint(self.bends_scattered, mode="scalar"):
                    last, met_last, before, _ = self.bending.follow(scene, ray, mirrored)
                    ray.o = dr.select(mirrored, last.o, ray.o)
                    ray.d = dr.select(mirrored, last.d, ray.d)
                    met = dr.select(mirrored, met_last, met)
                    s = dr.select(mirrored, before, s)

            if dr.hint(self.heavens is not None, mode="scalar"):
                L = self.heavens.mixed(L) + S
            return L, valid | self.shows_environment(scene), []

        def count(self, status: Any, si: Any, active: Any) -> None:
            """Count how camera rays end, in the order of `STATUSES`."""
            # Leaving the air is not the end: what lies behind it may still be met.
            lost = status == int(trace.RayStatus.OUT_OF_STEPS)
            hit = si.is_valid() & ~lost
            for index, ended in enumerate((hit, ~hit & ~lost, lost)):
                dr.scatter_reduce(
                    dr.ReduceOp.Add, self.counts, mi.UInt32(1), mi.UInt32(index), active & ended
                )

        def horizon_radiance(self, scene: Any, ray: Any, active: Any) -> Any:
            """Radiance of the sky at the horizon, in the azimuth of `ray`."""
            environment = scene.environment()
            if environment is None:
                raise InputError("haze takes its colour from the sky, and the scene has none",
                                 key="integrator nigemizu: visibility",
                                 remedy="add an environment emitter")  # fmt: skip
            up = mi.Vector3f(self.frame.up.tolist())
            # A hair above the horizon, where every sky model is defined.
            level = dr.normalize(ray.d - up * (dr.dot(ray.d, up) - 1e-4))
            looking = dr.zeros(mi.SurfaceInteraction3f)
            looking.wi = -level
            looking.wavelengths = ray.wavelengths
            return environment.eval(looking, active)

        def shows_environment(self, scene: Any) -> bool:
            return scene.environment() is not None and not self.settings.hide_emitters

        def to_string(self) -> str:
            return f"NigemizuIntegrator[{self.settings}]"

    assert mi.variant() == variant
    return NigemizuIntegrator


def _balance(pdf_a: Any, pdf_b: Any) -> Any:
    """Weight of strategy a by the power heuristic."""
    a2, b2 = pdf_a * pdf_a, pdf_b * pdf_b
    weight = a2 / (a2 + b2)
    return dr.select(dr.isfinite(weight), weight, 0)


def _has_mirrors(scene: Any) -> bool:
    """Whether anything in the scene reflects or passes light without scattering it."""
    flags = mi.BSDFFlags.Delta
    return any(
        mi.has_flag(shape.bsdf().flags(), flags) for shape in scene.shapes() if shape.bsdf() is not None
    )


def _media(settings: Settings, resolve_air: AirResolver | None) -> tuple[Any, Callable[[], Any]]:
    """The air of the plug-in properties, and how the same is had in double precision."""
    axes = axes_of(settings, resolve_air)
    reference = functools.partial(medium_of, *axes, tracer=settings.tracer, precision="double")
    return medium_of(*axes, tracer=settings.tracer), reference


def _settings_of(props: Any) -> tuple[Settings, Frame | None]:
    """Split Mitsuba's properties into settings and the air's place."""
    given = {key: value for key, value in props.items() if key != "id"}
    for key in given:
        props.mark_queried(key)
    to_world = given.pop("to_world", None)
    frame = None if to_world is None else Frame.from_matrix(np.array(to_world.matrix, dtype=np.float64))
    return read_settings(given), frame
