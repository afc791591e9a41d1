"""The two baselines: rays through panes of constant index, and rays that nothing bends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr

from nigemizu.field import Layers, Types
from nigemizu.trace.chords import Chord
from nigemizu.trace.ends import RayEnd, choose_status
from nigemizu.trace.surfaces import Surface

__all__ = ["cross_layers", "straight"]

LEAST_RISE: Final = 1e-7  # |d_z| that a ray keeps after a wavy boundary would have sent it along the pane


@final
@dataclass
class _Crossing:
    """What the loop over the boundaries carries, one entry per ray."""

    position: Any  #   Array3f  m
    direction: Any  #  Array3f  1    unit length
    pane: Any  #       UInt32        number of the pane from below
    path: Any  #       Float    m    ∫ ds so far
    optical: Any  #    Float    m    ∫ n ds so far
    turning: Any  #    Float    m    least height of an upward turn; infinite before the first
    steps: Any  #      UInt32        boundaries met
    free: Any  #       Bool          no boundary lies ahead


def cross_layers(
    layers: Layers,
    origin: Any,
    direction: Any,
    *,
    max_crossings: Any,
    surface: Surface | None = None,
    max_distance: Any = None,
    details: bool = False,
    active: Any = True,
) -> RayEnd:
    """Follow rays through panes of constant index by Snell's law.

    Parameters
    ----------
    layers : Layers
    origin : Array3f, m
    direction : Array3f, 1 — unit length
    max_crossings : int or UInt32
        Most boundaries that a ray may meet; counted as `RayEnd.steps`.
    surface : callable, optional
        Tested on every straight piece, the last one, which has no end, included.
    max_distance : Float, optional, m
        Path length at which a ray stops.
    details : bool
        Also give the optical path and the turning height.
    active : Bool

    Returns
    -------
    RayEnd

    Notes
    -----
    From boundary to boundary a ray is straight. At a boundary with normal N against the ray, c = −d·N and
    η = n_i/n_t, it is refracted, d_t = η d + (η c − c_t) N with c_t² = η² c² + (n_t² − n_i²)/n_t², or
    totally reflected where c_t² < 0. The last fraction is stored to full precision: near grazing
    everything depends on it. A refracted ray always goes on beyond the boundary and a reflected one on its
    own side, even where a wavy normal would have it otherwise.

    Limits: no light is lost to partial reflection. Panes make steps in the image that the air does not
    have; that is what this baseline is for.
    """
    types = layers.types
    Float, Array3f, UInt32, Bool = types.Float, types.Array3f, types.UInt32, types.Bool
    origin, d, active = Array3f(origin), Array3f(direction), Bool(active)
    limit = Float(dr.inf if max_distance is None else max_distance)
    max_crossings = UInt32(max_crossings)
    start = _Crossing(
        position=origin,
        direction=d,
        pane=UInt32(layers.pane_at(origin.z)),
        path=Float(0),
        optical=Float(0),
        turning=Float(dr.inf),
        steps=UInt32(0),
        free=Bool(False),
    )
    chord = Chord.along(origin, d, Float(0), Float(0), blank=getattr(surface, "blank", None))
    flying = active & (max_crossings > 0)
    ray, chord = _cross_all(layers, surface, start, chord, max_crossings, limit, flying)

    hit = chord.found
    ended = ray.free | (ray.path >= limit)
    turning = dr.select(ray.turning < dr.inf, ray.turning, dr.nan)
    return RayEnd(
        status=choose_status(types, active=active, hit=hit, escaped=ended & (limit == dr.inf), stopped=ended),
        position=ray.position,
        direction=ray.direction,
        chord_origin=chord.origin,
        chord_direction=chord.direction,
        chord_length=chord.length,
        chord_start=chord.start,
        steps=ray.steps,
        queries=ray.steps + 1,
        mark=chord.mark,
        path_length=ray.path,
        optical_path=ray.optical if details else None,
        turning_height=turning if details else None,
    )


@dr.syntax
def _cross_all(
    layers: Layers,
    surface: Surface | None,
    ray: _Crossing,
    chord: Chord,
    max_crossings: Any,
    limit: Any,
    flying: Any,
) -> tuple[_Crossing, Chord]:
    while dr.hint(flying, label="cross layers"):
        ray, chord = _cross(layers, surface, ray, chord, limit, flying)
        flying = flying & ~chord.found & ~ray.free & (ray.path < limit) & (ray.steps < max_crossings)
    return ray, chord


def _cross(
    layers: Layers, surface: Surface | None, ray: _Crossing, chord: Chord, limit: Any, active: Any
) -> tuple[_Crossing, Chord]:
    """One straight piece, and what happens at the boundary at its end.

    Symbols: d direction, N normal against the ray, c and c_t cosines of incidence and refraction,
    η = n_i/n_t, δ = 1 − η².
    """
    types = layers.types
    Float, Array3f, UInt32 = types.Float, types.Array3f, types.UInt32
    d = ray.direction

    # ---- the boundary ahead and the way to it
    upward = d.z > 0
    free = dr.select(upward, ray.pane >= layers.count, ray.pane == 0) | (d.z == 0)
    ahead = active & ~free
    boundary = UInt32(dr.select(upward, ray.pane, ray.pane - 1))
    height = layers.boundary_height(boundary, ahead)
    way = dr.maximum((height - ray.position.z) / dr.select(d.z == 0, 1, d.z), 0)
    length = dr.minimum(dr.select(free, dr.inf, way), limit - ray.path)

    # ---- surfaces on the way
    piece = Chord.along(ray.position, d, Float(length), ray.path)
    if surface is not None:
        piece = piece.test(surface, active)
    meets = ahead & ~piece.found & (way <= length)

    # ---- Snell's law at the boundary
    there = piece.at(dr.select(meets, way, 0))
    side = dr.select(upward, Float(-1), Float(1))
    N = layers.normal(boundary, there) * side
    c = -dr.dot(d, N)
    # A wavy normal may lie on the far side of a grazing ray; the flat one stands in.
    flat = c <= 0
    N = Array3f(dr.select(flat, Array3f(0, 0, side), N))
    c = dr.select(flat, abs(d.z), c)
    delta = layers.contrast(boundary, upward, meets)
    c_t2 = dr.fma(c * c, 1 - delta, delta)
    reflected = c_t2 < 0
    eta = dr.sqrt(1 - delta)
    refracted_d = d * eta + N * (eta * c - dr.sqrt(dr.maximum(c_t2, 0)))
    reflected_d = d + N * (2 * c)
    rising = upward ^ reflected
    turned = _keep_side(dr.select(reflected, reflected_d, refracted_d), rising)
    pane = dr.select(reflected, ray.pane, dr.select(upward, ray.pane + 1, ray.pane - 1))

    # ---- state at the end of the piece
    travelled = dr.select(active & (piece.found | (piece.distance < dr.inf)), piece.distance, 0)
    end = piece.at(travelled)
    bottomed = meets & reflected & ~upward
    after = _Crossing(
        position=Array3f(end.x, end.y, dr.select(meets, height, end.z)),
        direction=Array3f(dr.select(meets, turned, d)),
        pane=UInt32(dr.select(meets, pane, ray.pane)),
        path=ray.path + travelled,
        optical=dr.fma(layers.index(ray.pane, active), travelled, ray.optical),
        turning=dr.select(bottomed, dr.minimum(ray.turning, height), ray.turning),
        steps=ray.steps + dr.select(meets, UInt32(1), UInt32(0)),
        free=ray.free | (active & free & ~piece.found),
    )
    return after, chord.replaced(piece, active)


def _keep_side(direction: Any, rising: Any) -> Any:
    """The direction, made to rise (or fall) at least a little, of unit length."""
    size = dr.maximum(dr.select(rising, direction.z, -direction.z), LEAST_RISE)
    return dr.normalize(type(direction)(direction.x, direction.y, dr.select(rising, size, -size)))


def straight(
    types: Types,
    origin: Any,
    direction: Any,
    *,
    surface: Surface | None = None,
    max_distance: Any = None,
    details: bool = False,
    active: Any = True,
) -> RayEnd:
    """Follow rays that nothing bends; parameters and result as in `cross_layers`, in vacuum.

    A ray that meets nothing ends at its origin (ESCAPED), or after `max_distance` (STOPPED).
    """
    Float, Array3f, Bool = types.Float, types.Array3f, types.Bool
    origin, d, active = Array3f(origin), Array3f(direction), Bool(active)
    limit = Float(dr.inf if max_distance is None else max_distance)
    chord = Chord.along(origin, d, limit, Float(0))
    if surface is not None:
        chord = chord.test(surface, active)
    escaped = ~chord.found & (limit == dr.inf)
    path = dr.select(escaped, 0, chord.distance)
    return RayEnd(
        status=choose_status(types, active=active, hit=chord.found, escaped=escaped, stopped=Bool(True)),
        position=chord.at(path),
        direction=d,
        chord_origin=chord.origin,
        chord_direction=chord.direction,
        chord_length=chord.length,
        chord_start=chord.start,
        steps=types.UInt32(0),
        queries=types.UInt32(1),
        mark=chord.mark,
        path_length=path,
        optical_path=path if details else None,
        turning_height=Float(dr.nan) if details else None,
    )
