"""From the air to a rule that carries one path segment: straight, bent, or through panes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from nigemizu import field, trace
from nigemizu.errors import InputError
from nigemizu.render.settings import Settings
from nigemizu.render.variant import current_backend

__all__ = ["AirResolver", "Bending", "Frame", "field_from_air", "medium_of", "surface_query"]

Axes = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
AirResolver = Callable[[str, float], Axes]


@final
@dataclass(frozen=True)
class Frame:
    """Where the air stands in a Mitsuba scene: ``world = rotation · (scale · air) + origin``.

    Parameters
    ----------
    rotation : (3, 3) float64
        Proper rotation, air axes to scene axes.
    scale : float
        Scene units per metre.
    origin : (3,) float64
        The air's origin in scene units.
    """

    rotation: NDArray[np.float64]
    scale: float
    origin: NDArray[np.float64]

    @property
    def up(self) -> NDArray[np.float64]:
        """Unit vector of the air's vertical in the scene."""
        return self.rotation[:, 2]

    @property
    def is_identity(self) -> bool:
        """Whether air and scene share one frame."""
        return bool(
            np.array_equal(self.rotation, np.eye(3)) and self.scale == 1.0 and not np.any(self.origin)
        )

    @staticmethod
    def from_matrix(matrix: NDArray[np.float64]) -> Frame:
        """The frame of a 4×4 matrix made of a rotation, a uniform scale and a translation.

        Raises
        ------
        InputError
            If the matrix shears, mirrors or scales unevenly: optical paths would change their length
            with direction.
        """
        linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
        scale = float(np.cbrt(abs(np.linalg.det(linear))))
        rotation = linear / scale if scale > 0 else linear
        proper = scale > 0 and np.linalg.det(linear) > 0
        if not proper or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4):
            raise InputError(
                "the air can be rotated, moved and scaled evenly only",
                key="integrator nigemizu: to_world",
                value=np.asarray(matrix).tolist(),
            )
        return Frame(rotation, scale, np.asarray(matrix, dtype=np.float64)[:3, 3])


@final
class Bending:
    """Carries path segments of one scene.

    Parameters
    ----------
    medium : Field or Layers or None
        What the light passes; None leaves it straight.
    tracer : Tracer
        How it passes.
    frame : Frame
        Where the air stands.
    """

    def __init__(self, medium: Any, tracer: trace.Tracer, frame: Frame) -> None:
        self.method = tracer.method if medium is not None else "straight"
        self.medium = medium
        self.frame = frame
        self.stepper = trace.stepper_named(tracer.stepper)
        self.tolerance = tracer.chord_tolerance
        # Opaque: values of the next frame reuse the compiled kernel.
        self.step = dr.opaque(mi.Float, tracer.step)
        self.max_steps = dr.opaque(mi.UInt32, tracer.max_steps)
        self.set_pixel_angle(1e-4)

    def set_pixel_angle(self, angle: float) -> None:
        """Say how large a pixel is, rad."""
        self.chord_tolerance = dr.opaque(mi.Float, self.tolerance * angle)

    def advance(self, scene: Any, ray: Any, active: Any) -> tuple[Any, Any, Any]:
        """Follow `ray` to where it hits, escapes or has used its steps.

        Returns
        -------
        ray : mi.Ray3f
            The last straight piece, from the last point that was reached without meeting a surface.
        length : mi.Float
            Length of the path before that piece, scene units.
        status : mi.UInt32
            `nigemizu.trace` status; meaningless for straight rays.
        """

        escaped = mi.UInt32(int(trace.RayStatus.ESCAPED))
        if self.method == "straight":
            return ray, mi.Float(0), escaped
        frame = self.frame
        surface = _in_frame(surface_query(scene), frame)
        origin, direction = _to_air(ray.o, ray.d, frame)
        if self.method == "layered":
            end = trace.cross_layers(
                self.medium, origin, direction, max_crossings=self.max_steps, surface=surface, active=active
            )
        else:
            end = trace.march(
                self.medium,
                origin,
                direction,
                step=self.step,
                max_steps=self.max_steps,
                stepper=self.stepper,
                surface=surface,
                chord_tolerance=self.chord_tolerance,
                active=active,
            )
        last: Any = mi.Ray3f(ray)
        last.o, last.d = _to_scene(
            dr.select(end.hit, end.chord_origin, end.position),
            dr.select(end.hit, end.chord_direction, end.direction),
            frame,
        )
        last.maxt = dr.inf
        on_chord = dr.norm(end.position - end.chord_origin)
        before = dr.select(end.hit, end.path_length - on_chord, end.path_length)
        return last, mi.Float(before) * frame.scale, mi.UInt32(end.status)


def surface_query(scene: Any) -> Callable[[Any, Any, Any, Any], tuple[Any, Any]]:
    """The surfaces of a Mitsuba scene as the callback that `nigemizu.trace` takes.

    Parameters
    ----------
    scene : mi.Scene
        The scene; its unit is the metre.

    Returns
    -------
    callable
        ``(origin, direction, length, active) -> (hit, distance)``; takes double precision as well, which
        is rounded to Mitsuba's single precision (0.06 mm at 1 km).
    """

    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        ray: Any = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))
        ray.maxt = mi.Float(length)
        # Never as "coherent" rays: Embree loses flat parts of meshes far from the origin in packets of
        # nearly parallel rays that begin close to them, a third of the hits in the worst case.
        met = scene.ray_intersect_preliminary(ray, False, mi.Bool(active))
        # In the array types of the caller.
        return dr.mask_t(length)(met.is_valid()), type(length)(met.t)

    return surface


def field_from_air(settings: Settings, resolve_air: AirResolver | None) -> Any:
    """The refractive-index volume named by the plug-in properties, on the device in use.

    Raises
    ------
    InputError
        If the name is neither a dataset nor known to the resolver, or the dataset cannot be used.
    """
    # Late: the heat stage loads its compiler, which pictures without a dataset do not need.
    from nigemizu import heat
    from nigemizu.air import Atmosphere

    name = str(settings.air)
    path = Path(name)
    if path.suffix.lower() in (".nc", ".zarr"):
        axes = heat.refractivity_at(heat.read_air(path), settings.time, Atmosphere())
    elif resolve_air is not None:
        axes = resolve_air(name, settings.time)
    else:
        raise InputError(
            "no such air dataset", key="integrator nigemizu: air", value=name,
            expected="a path that ends in .nc or .zarr",
        )  # fmt: skip
    return medium_of(*axes, tracer=settings.tracer)


def medium_of(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    z: NDArray[np.float64],
    refractivity: NDArray[np.float64],
    *,
    tracer: trace.Tracer,
    precision: Literal["single", "double"] = "single",
) -> Any:
    """Air on a grid as what the tracer's method wants: a volume, or panes cut from its mean profile.

    Parameters
    ----------
    x, y, z : (nx,), (ny,), (nz,) float64, m
        Axes, as from `nigemizu.heat.refractivity_at`.
    refractivity : (nz, ny, nx) float64, 1
        n − 1.
    tracer : Tracer
        Method, what lies beyond the sides, and the panes.
    precision : {"single", "double"}
        Single for pictures, double for rays as data.
    """
    types = field.types(current_backend(), precision, differentiable=True)
    if tracer.method == "layered":
        return field.Layers.from_profile(
            z,
            refractivity.mean(axis=(1, 2)),
            tracer.layers,
            types,
            spacing=tracer.layer_spacing,
            waviness_amplitude=tracer.waviness_amplitude,
            waviness_length=tracer.waviness_length,
            waviness_seed=tracer.waviness_seed,
        )
    return field.TrilinearVolume(x, y, z, refractivity, types, beyond=tracer.beyond)


def _to_air(origin: Any, direction: Any, frame: Frame) -> tuple[Any, Any]:

    if frame.is_identity:
        return origin, direction
    inverse = mi.Matrix3f(frame.rotation.T.tolist())
    shifted = (origin - mi.Point3f(frame.origin.tolist())) / frame.scale
    return mi.Point3f(inverse @ mi.Vector3f(shifted)), inverse @ direction


def _to_scene(origin: Any, direction: Any, frame: Frame) -> tuple[Any, Any]:

    origin, direction = mi.Point3f(origin), mi.Vector3f(direction)
    if frame.is_identity:
        return origin, direction
    rotation = mi.Matrix3f(frame.rotation.tolist())
    turned = rotation @ (mi.Vector3f(origin) * frame.scale)
    return mi.Point3f(turned + mi.Vector3f(frame.origin.tolist())), rotation @ direction


def _in_frame(surface: Callable[..., tuple[Any, Any]], frame: Frame) -> Callable[..., tuple[Any, Any]]:
    if frame.is_identity:
        return surface

    def in_frame(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        scene_origin, scene_direction = _to_scene(origin, direction, frame)
        hit, distance = surface(scene_origin, scene_direction, length * frame.scale, active)
        return hit, distance / frame.scale

    return in_frame
