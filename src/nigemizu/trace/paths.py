"""Whole ray paths, for diagrams and for rays as data."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.field import Field
from nigemizu.trace.controlled import FIRST_TRIAL
from nigemizu.trace.ends import OUT_OF_STEPS, RayEnd
from nigemizu.trace.march import march
from nigemizu.trace.steppers import LEAPFROG, Stepper
from nigemizu.trace.surfaces import Surface

__all__ = ["record_paths"]


def record_paths(
    field: Field,
    origin: ArrayLike,
    directions: ArrayLike,
    *,
    accuracy: float | None = None,
    step: float | None = None,
    max_steps: int,
    stepper: Stepper = LEAPFROG,
    surface: Surface | None = None,
    chord_tolerance: float | None = None,
    max_distance: float | None = None,
    every: int = 1,
) -> tuple[list[NDArray[np.float64]], RayEnd]:
    """March a few rays and keep the points on their way.

    Parameters
    ----------
    field : Field
        In double precision where the numbers matter.
    origin : (3,) or (N, 3) array_like, m
    directions : (N, 3) array_like, 1
        Made unit length here.
    accuracy, step, max_steps, stepper, surface, chord_tolerance, max_distance
        As in `march`.
    every : int
        Steps between two points.

    Returns
    -------
    paths : list of (K, 3) float64 arrays, m
        From the origin to the end of each ray.
    end : RayEnd
        With optical path and turning height; the same as `march` gives, to the integrator's order.

    Notes
    -----
    The march is cut into pieces of `every` steps, one launch each: for tens of rays, not for pictures.
    """
    types = field.types
    unit = np.atleast_2d(np.asarray(directions, dtype=np.float64))
    if unit.ndim != 2 or unit.shape[1] != 3 or not np.all(np.linalg.norm(unit, axis=1) > 0):
        raise InputError("not a list of directions", key="directions", expected="(N, 3), none of them zero")
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    start = np.broadcast_to(np.asarray(origin, dtype=np.float64), unit.shape)
    if every < 1:
        raise InputError("must be at least 1", key="every", value=every)

    x, d = types.Array3f(start.T.copy()), types.Array3f(unit.T.copy())
    total: RayEnd | None = None
    flying = np.ones(len(unit), dtype=bool)
    points, masks, used = [start], [flying], 0
    while used < max_steps and flying.any():
        piece = march(
            field,
            x,
            d,
            accuracy=accuracy,
            step=step,
            max_steps=min(every, max_steps - used),
            stepper=stepper,
            surface=surface,
            chord_tolerance=chord_tolerance,
            travelled=0.0 if total is None else total.path_length,
            # A piece of few steps must not begin with one that is too long again and again.
            trial=FIRST_TRIAL if total is None else total.trial,
            max_distance=max_distance,
            details=True,
            active=types.Bool(flying),
        )
        total = piece if total is None else _joined(total, piece, types.Bool(flying))
        dr.eval(total)
        used += every
        points.append(np.array(total.position).T)
        masks.append(flying)
        flying = flying & (np.array(total.status) == OUT_OF_STEPS)
        x, d = total.position, total.direction
    if total is None:
        raise InputError("must be at least 1", key="max_steps", value=max_steps)
    track, kept = np.stack(points), np.stack(masks)
    return [track[kept[:, ray], ray].astype(np.float64) for ray in range(len(unit))], total


def _joined(before: RayEnd, piece: RayEnd, active: Any) -> RayEnd:
    """Two consecutive pieces of the same rays as one; rays that have ended stay as they are."""
    lowest = dr.minimum(_or_infinite(before.turning_height), _or_infinite(piece.turning_height))
    later = replace(
        piece,
        optical_path=before.optical_path + piece.optical_path,
        steps=before.steps + piece.steps,
        queries=before.queries + piece.queries,
        error=None if piece.error is None else before.error + piece.error,
        turning_height=dr.select(lowest < dr.inf, lowest, dr.nan),
    )
    return before.replaced(later, active)


def _or_infinite(height: Any) -> Any:
    return dr.select(dr.isnan(height), dr.inf, height)
