"""The rule that carries one path segment of a picture: straight, bent, or through panes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from nigemizu import trace
from nigemizu.field.voxels import COLUMNS_REACH
from nigemizu.render.bounds import object_boxes
from nigemizu.render.frame import Frame
from nigemizu.render.pinhole import Pinhole
from nigemizu.render.sharing import view_of

__all__ = ["Bending"]

_CHORDS: Final = 0.5  # of the accuracy, that chords may use up


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
    reference : callable, optional
        Makes the same medium in double precision: for paths that are shared by a whole row, and to measure
        errors against. Default: the medium itself.
    """

    def __init__(
        self, medium: Any, tracer: trace.Tracer, frame: Frame, reference: Callable[[], Any] | None = None
    ) -> None:
        self.frame = frame
        self.tracer = tracer
        self._known_boxes: tuple[Any, NDArray[np.float64]] | None = None
        self.set_medium(medium, reference)
        # Opaque: values of the next frame reuse the compiled kernel.
        self._step = None if tracer.step is None else dr.opaque(mi.Float, tracer.step)
        self._max_steps = dr.opaque(mi.UInt32, tracer.max_steps)
        self._set_pixel_angle(1e-4)

    def set_medium(self, medium: Any, reference: Callable[[], Any] | None = None) -> None:
        """Put other air in; of the same kind and shape it reuses the compiled kernel."""
        self.method = self.tracer.method if medium is not None else "straight"
        self.medium = medium
        self.paths: trace.SharedPaths | None = None
        self._reference = reference
        self._made_for: tuple[Any, ...] = ()

    @property
    def controlled(self) -> bool:
        """Whether steps follow from an accuracy."""
        return self.method == "bent" and self._step is None

    @property
    def pixel_angle(self) -> float:
        """Angle of a pixel, rad."""
        return self._pixel_angle

    @property
    def angle(self) -> float:
        """The accuracy, rad."""
        return self.tracer.angle(self._pixel_angle)

    def reference(self) -> Any:
        """The medium in double precision, where it can be had."""
        return self.medium if self._reference is None else self._reference()

    def prepare(self, scene: Any, sensor: Any, samples: float) -> None:
        """Measure a pixel of the sensor, and lay the paths that its rays, `samples` per pixel, can share."""
        pinhole = Pinhole.of(sensor)
        self._set_pixel_angle(_pixel_angle(sensor) if pinhole is None else pinhole.pixel_angle)
        if pinhole is None or not self.controlled or not self.tracer.sharing:
            self.paths = None
            return
        shapes, boxes = self._shapes(scene)
        made_for = (
            shapes,
            pinhole.size,
            *(v.tobytes() for v in (pinhole.origin, pinhole.c0, pinhole.cu, pinhole.cv)),
        )
        if self.paths is not None and made_for == self._made_for:
            return
        stratified = self.medium.stratified
        view = view_of(pinhole, self.frame, stratified=stratified)
        # One elevation serves a whole row, or several: worth the double precision.
        field = self.reference() if stratified else self.medium
        self.paths = trace.share_paths(
            field,
            view,
            boxes,
            accuracy=self.angle,
            max_steps=self.tracer.max_steps,
            rays=samples,
            types=self.medium.types,
        )
        self._made_for = made_for

    def follow_from_eye(self, scene: Any, ray: Any, active: Any) -> tuple[Any, Any, Any, Any]:
        """Follow camera rays; parameters and results as of `follow`."""
        if self.paths is None:
            return self.follow(scene, ray, active, coherent=True)
        _, direction = self.frame.to_air(ray.o, ray.d)
        return self._last(ray, self.from_eye(scene, direction, active))

    def from_eye(self, scene: Any, direction: Any, active: Any) -> trace.RayEnd:
        """Ends of shared rays (`nigemizu.trace.SharedPaths.follow`), in the air's axes."""
        assert self.paths is not None
        # Air whose sides are far is left through its top, from where no ray comes close to the ground again.
        sides = np.abs([self.medium.lower[:2], self.medium.upper[:2]])
        aloft = bool(np.all(sides >= COLUMNS_REACH))
        return self.paths.follow(
            self.medium,
            self.medium.types.Array3f(direction),
            surface=self.frame.surface(scene),
            far_surface=self.frame.surface(scene, coherent=aloft),
            active=active,
            **self._control(),
        )

    def follow(
        self, scene: Any, ray: Any, active: Any, *, coherent: bool = False
    ) -> tuple[Any, Any, Any, Any]:
        """Follow `ray` to where it hits, escapes or has used its steps.

        Returns
        -------
        ray : mi.Ray3f
            The last straight piece, from the last point that was reached without meeting a surface.
        met : mi.PreliminaryIntersection3f
            What it meets.
        length : mi.Float
            Length of the path before that piece, scene units.
        status : mi.UInt32
            `nigemizu.trace` status; meaningless for straight rays.
        """
        if self.method == "straight":
            met = scene.ray_intersect_preliminary(ray, coherent, active)
            return ray, met, mi.Float(0), mi.UInt32(int(trace.RayStatus.ESCAPED))
        origin, direction = self.frame.to_air(ray.o, ray.d)
        return self._last(ray, self.march(scene, origin, direction, active))

    def march(self, scene: Any, origin: Any, direction: Any, active: Any) -> trace.RayEnd:
        """Ends of single rays in the air's axes."""
        surface = self.frame.surface(scene)
        types = self.medium.types
        origin, direction = types.Array3f(origin), types.Array3f(direction)
        if self.method == "layered":
            return trace.cross_layers(
                self.medium, origin, direction, max_crossings=self._max_steps, surface=surface, active=active
            )
        control = self._control()
        if self._step is not None:
            control |= {
                "accuracy": None,
                "step": self._step,
                "stepper": trace.stepper_named(self.tracer.stepper),
            }
        return trace.march(self.medium, origin, direction, surface=surface, active=active, **control)

    def _control(self) -> dict[str, Any]:
        return {
            "accuracy": self._accuracy,
            "max_steps": self._max_steps,
            "chord_tolerance": self._chord_tolerance if self.tracer.chord_tolerance > 0 else 0,
        }

    def _last(self, ray: Any, end: trace.RayEnd) -> tuple[Any, Any, Any, Any]:
        last: Any = mi.Ray3f(ray)
        last.o, last.d = self.frame.to_scene(
            dr.select(end.hit, end.chord_origin, end.position),
            dr.select(end.hit, end.chord_direction, end.direction),
        )
        last.maxt = dr.inf
        on_chord = dr.norm(end.position - end.chord_origin)
        before = dr.select(end.hit, end.path_length - on_chord, end.path_length)
        return last, end.mark, mi.Float(before) * self.frame.scale, mi.UInt32(end.status)

    def boxes(self, scene: Any) -> NDArray[np.float64]:
        """Boxes (N, 2, 3) that contain the scene's surfaces, in the air's axes, m."""
        return self._shapes(scene)[1]

    def _shapes(self, scene: Any) -> tuple[Any, NDArray[np.float64]]:
        """What tells the scene's shapes from others, and their boxes, which are found once for them."""
        known = _fingerprint(scene)
        if self._known_boxes is None or self._known_boxes[0] != known:
            self._known_boxes = known, self.frame.boxes(object_boxes(scene))
        return self._known_boxes

    def _set_pixel_angle(self, angle: float) -> None:
        self._pixel_angle = angle
        Float = mi.Float if self.medium is None else self.medium.types.Float
        self._accuracy = dr.opaque(Float, self.angle)
        chord = min(self.tracer.chord_tolerance * angle, _CHORDS * self.angle)
        self._chord_tolerance = dr.opaque(Float, chord)


def _fingerprint(scene: Any) -> tuple[Any, ...]:
    """What tells that shapes have been exchanged, moved or reshaped."""

    def of(shape: Any) -> tuple[Any, ...]:
        box = shape.bbox()
        # Exchanged vertices are another array; shapes in closed form have none.
        parameters = mi.traverse(shape)
        vertices = parameters["vertex_positions"].index if "vertex_positions" in parameters else 0
        return (tuple(box.min), tuple(box.max), vertices)

    return tuple(of(shape) for shape in scene.shapes())


def _pixel_angle(sensor: Any) -> float:
    """Angle between the rays through two neighbouring pixels in the middle of the picture, rad."""
    ray, _ = sensor.sample_ray_differential(0.0, 0.5, mi.Point2f(0.5), mi.Point2f(0.5))
    sine = dr.norm(dr.cross(ray.d, dr.normalize(ray.d_x)))
    # An orthographic sensor has parallel rays; any small angle does.
    return max(float(sine[0]), 1e-7)
