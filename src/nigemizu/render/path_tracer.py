"""The integrator plug-in ``nigemizu``: a path tracer whose segments are bent by air."""

from __future__ import annotations

import functools
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np

from nigemizu import trace
from nigemizu.errors import InputError
from nigemizu.render.bending import AirResolver, Bending, Frame, field_from_air
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
        """Path tracer with emitter sampling whose camera and scattered segments are bent by air.

        Symbols: β throughput, L radiance, η relative index of refraction so far, s path length.

        Limits: shadow rays are straight, so that shadows and light seen through the air are not displaced;
        radiance is not divided by n² (3·10⁻⁴ relative at most in air); no polarization.
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
            super().__init__(props if props is not None else mi.Properties("nigemizu"))
            if settings is None:
                settings, frame = _settings_of(props)
                if settings.air is not None and settings.tracer.method != "straight":
                    medium = field_from_air(settings, resolve_air)
            self.settings = settings
            self.frame = frame or Frame(np.eye(3), 1.0, np.zeros(3))
            visibility = settings.visibility
            self.extinction = 0.0 if visibility is None else KOSCHMIEDER / (visibility * self.frame.scale)
            self.limit_depth = 2**32 - 1 if settings.max_depth < 0 else settings.max_depth
            self.reset_counts()
            self.set_medium(medium)

        def set_medium(self, medium: Any) -> None:
            """Put other air in; of the same kind and shape it reuses the compiled kernel."""
            self.bending = Bending(medium, self.settings.tracer, self.frame)

        def render(self, scene: Any, sensor: Any = 0, *args: Any, **options: Any) -> Any:
            """Render (the interface of `mi.Integrator`); measures a pixel for the chord tolerance first."""
            if isinstance(sensor, int):
                sensor = scene.sensors()[sensor]
            self.bending.set_pixel_angle(pixel_angle(sensor))
            return super().render(scene, sensor, *args, **options)

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
            previous = dr.zeros(mi.SurfaceInteraction3f)
            pdf_previous = mi.Float(1)
            delta_previous = mi.Bool(True)
            counts = self.counts

            while dr.hint(active, label="nigemizu"):
                # ---------------------- follow the bent segment ----------------------
                ray, s, status = self.bending.advance(scene, ray, active)
                # not "coherent", see `surface_query`
                si = scene.ray_intersect(ray, mi.RayFlags.All, False, active)
                s += dr.select(si.is_valid(), si.t, 0)
                # Leaving the air is not the end: what lies behind it may still be met.
                ended = dr.select(
                    status == int(trace.RayStatus.OUT_OF_STEPS), 2, dr.select(si.is_valid(), 0, 1)
                )
                dr.scatter_reduce(dr.ReduceOp.Add, counts, mi.UInt32(1), mi.UInt32(ended), active & first)
                first = mi.Bool(False)

                # ---------------------- haze between eye and surface ----------------------
                if dr.hint(self.extinction > 0, mode="scalar"):
                    clear = dr.exp(-self.extinction * s)
                    seen = active & si.is_valid()
                    L[seen] += β * (1 - clear) * self.horizon_radiance(scene, ray, seen)
                    β[seen] *= clear

                # ---------------------- emission ----------------------
                emitter = si.emitter(scene, active)
                hidden = mi.Bool(False)
                if dr.hint(self.settings.hide_emitters, mode="scalar"):
                    hidden = (depth == 0) & (emitter != None)  # noqa: E711  (elementwise)
                ds = mi.DirectionSample3f(scene, si, previous)
                lit = active & ~hidden & (emitter != None)  # noqa: E711
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
                previous = dr.select(onward, si, previous)
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

            return L, valid | self.shows_environment(scene), []

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


def pixel_angle(sensor: Any) -> float:
    """Angle between the rays through two neighbouring pixels in the middle of the picture, rad."""
    ray, _ = sensor.sample_ray_differential(0.0, 0.5, mi.Point2f(0.5), mi.Point2f(0.5))
    sine = dr.norm(dr.cross(ray.d, dr.normalize(ray.d_x)))
    # An orthographic sensor has parallel rays; any small angle does.
    return max(float(sine[0]), 1e-7)


def _balance(pdf_a: Any, pdf_b: Any) -> Any:
    """Weight of strategy a by the power heuristic."""
    a2, b2 = pdf_a * pdf_a, pdf_b * pdf_b
    weight = a2 / (a2 + b2)
    return dr.select(dr.isfinite(weight), weight, 0)


def _settings_of(props: Any) -> tuple[Settings, Frame | None]:
    """Split Mitsuba's properties into settings and the air's place."""
    given = {key: value for key, value in props.items() if key != "id"}
    for key in given:
        props.mark_queried(key)
    to_world = given.pop("to_world", None)
    frame = None if to_world is None else Frame.from_matrix(np.array(to_world.matrix, dtype=np.float64))
    return read_settings(given), frame
