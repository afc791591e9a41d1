"""A picture's rays through air that varies with height alone, and the methods that compete on them.

The error of a method is how far its rays are displaced in the picture: their height where the pyramid stands,
against that of rays marched in far finer steps, as an angle seen from the eye, in pixels. Of all rays that
get there above the ground the 99th percentile counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Self, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.cli.bench.rays import control, settle, stratified_field
from nigemizu.cli.bench.timing import SELDOM, alternate
from nigemizu.progress import SILENT, ProgressMeter

if TYPE_CHECKING:
    from nigemizu.field import Field
    from nigemizu.scene import Scene

__all__ = ["EQUAL_ERROR", "MOST_PANES", "Fan", "measure_panes", "measure_ray_by_ray", "power_law"]

FloatArray = NDArray[np.float64]

EQUAL_ERROR: Final = 0.1  # pixel; the error at which methods are compared
PERCENTILE: Final = 99.0
MOST_PANES: Final = 16_384
"""Panes beyond which the error is extrapolated."""
_FINE: Final = 0.02  # m; step of the reference
_SAMPLES: Final = 20_000  # heights at which the profile is handed to the other methods
_FITTED: Final = 5  # counts of panes, the largest, through which the power law goes
_TIMED_RAYS: Final = 2**15
_RAYS_OF_A_PICTURE: Final = 2**18


@final
@dataclass(frozen=True)
class Fan:
    """Rays from the eye in the plane of view, one per elevation, to a distance.

    Attributes
    ----------
    field : Field
        The air, in double precision; it varies with height alone.
    eye : float, m
        Height of the eye.
    elevations : (N,) float64, rad
    distance : float, m
        Horizontally, to where heights are compared.
    pixel : float, rad
        Angle that a pixel spans.
    exact : (N,) float64, m
        Height of the reference rays there.
    """

    field: Field
    eye: float
    elevations: FloatArray
    distance: float
    pixel: float
    exact: FloatArray

    @classmethod
    def of(cls, scene: Scene, distance: float, per_row: int = 2) -> Self:
        """The rays of `scene` through the rows of its picture that reach `distance` [m] above the ground.

        The air is that of the scene without its unevenness, as the heat stage leaves it.
        """
        from nigemizu import field

        air = scene.with_changes({"grid.cells": _one_column(scene), "initial.unevenness": []}).air_at()
        medium = stratified_field(air.z, air.refractivity.mean(axis=(1, 2)), field.types("llvm", "double"))
        camera = scene.camera
        rows = (np.arange(camera.height * per_row) + 0.5) / per_row - 0.5 * camera.height
        middle = math.asin(camera.direction[2])
        elevations = middle + np.arctan(rows * camera.pixel_angle)
        every = cls(medium, camera.eye[2], elevations, distance, camera.pixel_angle, elevations)
        exact = every.heights(every.marched(step=_FINE, max_steps=10**6))
        seen = exact > 0.0  # what has met the ground never comes up again
        return cls(medium, camera.eye[2], elevations[seen], distance, camera.pixel_angle, exact[seen])

    @property
    def path_length(self) -> FloatArray:
        """How far straight rays go to the distance, m; the bent ones end millimetres beside it."""
        return np.asarray(self.distance / np.cos(self.elevations))

    @property
    def lowest_and_highest(self) -> tuple[float, float]:
        """Ends of the air, m."""
        box: Any = self.field
        return box.lower[2], box.upper[2]

    def repeated(self, count: int) -> Fan:
        """The same rays over and over, about `count` in all: enough to keep every processor at work."""
        times = max(1, count // len(self.elevations))
        elevations, exact = np.repeat(self.elevations, times), np.repeat(self.exact, times)
        return Fan(self.field, self.eye, elevations, self.distance, self.pixel, exact)

    def launched(self) -> dict[str, Any]:
        """Origin, direction and greatest path length, as `trace.march` and `trace.cross_layers` take them."""
        types = self.field.types
        rise, still = self.elevations, np.zeros_like(self.elevations)
        return {
            "origin": types.Array3f(np.stack([still, still, np.full_like(rise, self.eye)])),
            "direction": types.Array3f(np.stack([np.cos(rise), still, np.sin(rise)])),
            "max_distance": types.Float(self.path_length),
        }

    def marched(self, **controls: Any) -> Any:
        """Ends of the bent rays; `controls` are the step or the accuracy of `trace.march`."""
        from nigemizu import trace

        return settle(trace.march(self.field, **self.launched(), **controls))

    def heights(self, end: Any) -> FloatArray:
        """Height [m] at the distance, of rays that ended near it or left the air before."""
        x, _, z = np.asarray(end.position, dtype=np.float64)
        d_x, _, d_z = np.asarray(end.direction, dtype=np.float64)
        return np.asarray(z + (self.distance - x) * d_z / d_x)

    def error(self, heights: FloatArray) -> float:
        """Displacement in the picture [pixel], 99th percentile over the rays."""
        displaced = np.abs(heights - self.exact) / self.distance / self.pixel
        return float(np.percentile(displaced, PERCENTILE))

    def profile(self) -> tuple[FloatArray, FloatArray]:
        """Heights [m], close together and closest at the ground, and n − 1 there."""
        low, high = self.lowest_and_highest
        share = np.linspace(0.0, 1.0, _SAMPLES)
        z = low + (high - low) * share * (0.02 + 0.98 * share)
        types = self.field.types
        n, _ = self.field.value_and_gradient(types.Array3f(0, 0, types.Float(z)))
        return z, np.asarray(n, dtype=np.float64) - 1.0


def measure_panes(fan: Fan, most: int = MOST_PANES, *, progress: ProgressMeter = SILENT) -> dict[str, Any]:
    """How many panes of constant index err as little as the bent ray, and how long they take.

    Parameters
    ----------
    fan : Fan
    most : int
        Most panes that are tried; beyond them errors follow the fitted power law, and times are
        proportional to the panes.
    progress : ProgressMeter

    Returns
    -------
    dict
        ``errors_pixels`` by number of panes, ``panes`` at `EQUAL_ERROR` (None where no number of them
        gets there), ``extrapolated``, ``order`` (the fitted power), and the seconds of panes and of the bent
        ray on the same rays with their ratio.
    """
    counts = [2**power for power in range(6, int(math.log2(most)) + 1)]
    errors = [fan.error(fan.heights(_crossed(fan, _panes(fan, count)))) for count in counts]
    panes, order = power_law(counts, errors, EQUAL_ERROR)
    extrapolated = panes > most
    timed = most if extrapolated else max(2, round(panes))
    many, layers = fan.repeated(_TIMED_RAYS), _panes(fan, timed)
    angle = EQUAL_ERROR * fan.pixel
    works: dict[str, Callable[[], Any]] = {
        "panes": lambda: _crossed(many, layers),
        "bent": lambda: many.marched(**control(angle)),
    }
    seconds = alternate(works, SELDOM, label="panes", progress=progress)
    reached = math.isfinite(panes)
    of_panes = seconds["panes"] * max(1.0, panes / timed) if reached else None
    return {
        "errors_pixels": dict(zip(map(str, counts), errors, strict=True)),
        "equal_error_pixels": EQUAL_ERROR,
        "panes": panes if reached else None,
        "extrapolated": extrapolated,
        "order": order,
        "rays": len(many.elevations),
        "bent_error_pixels": fan.error(fan.heights(fan.marched(**control(angle)))),
        "bent_seconds": seconds["bent"],
        "timed_panes": timed,
        "timed_panes_seconds": seconds["panes"],
        "panes_seconds": of_panes,
        "panes_over_bent": None if of_panes is None else of_panes / seconds["bent"],
    }


def power_law(counts: list[int], errors: list[float], wanted: float) -> tuple[float, float]:
    """Count at which the error is `wanted`, and the power p of the errors' fall, error ∝ count⁻ᵖ.

    Between two counts the law goes through both; beyond the last it is fitted to the largest counts. The
    count is infinite where errors do not fall.

    Examples
    --------
    >>> count, order = power_law([16, 32, 64], [4.0, 2.0, 1.0], 0.25)
    >>> round(count), round(order, 3)
    (256, 1.0)
    """
    size, missed = np.log(counts), np.log(errors)
    slope, intercept = np.polyfit(size[-_FITTED:], missed[-_FITTED:], 1)
    if errors[-1] > wanted:
        if slope >= 0.0:
            return math.inf, float(-slope)
        return float(np.exp((math.log(wanted) - intercept) / slope)), float(-slope)
    last = max((k for k, error in enumerate(errors) if error > wanted), default=-1)
    if last < 0:
        return float(counts[0]), float(-slope)
    share = (missed[last] - math.log(wanted)) / (missed[last] - missed[last + 1])
    return float(np.exp(size[last] + share * (size[last + 1] - size[last]))), float(-slope)


def measure_ray_by_ray(fan: Fan, count: int = 20, *, progress: ProgressMeter = SILENT) -> dict[str, Any]:
    """Seconds per ray of SciPy's DOP853, one ray after another, against ours at the same error.

    Parameters
    ----------
    fan : Fan
    count : int
        Number of rays that SciPy follows; ours are timed as many as a picture has.
    progress : ProgressMeter

    Returns
    -------
    dict
        ``rtol`` (the loosest power of ten that errs by no more than `EQUAL_ERROR`), seconds per ray of both,
        and their ratio.

    Notes
    -----
    The equations are dx/dσ = p, dp/dσ = n ∇n, and the index a cubic spline through the profile: what one
    writes in an afternoon. `rtol` and `atol` are the same number.
    """
    chosen = np.unique(np.linspace(0, len(fan.elevations) - 1, count).astype(np.int64))
    few = Fan(fan.field, fan.eye, fan.elevations[chosen], fan.distance, fan.pixel, fan.exact[chosen])
    power, error = 3, math.inf
    while error > EQUAL_ERROR and power < 12:
        power += 1
        error = few.error(_by_scipy(few, 10.0**-power))
    rtol = 10.0**-power
    many, angle = fan.repeated(_RAYS_OF_A_PICTURE), EQUAL_ERROR * fan.pixel
    works: dict[str, Callable[[], Any]] = {
        "scipy": lambda: _by_scipy(few, rtol),
        "bent": lambda: many.marched(**control(angle)),
    }
    seconds = alternate(works, SELDOM, label="SciPy", progress=progress)
    scipy, ours = seconds["scipy"] / len(chosen), seconds["bent"] / len(many.elevations)
    return {
        "rays": len(chosen),
        "rtol": rtol,
        "scipy_error_pixels": error,
        "scipy_seconds_per_ray": scipy,
        "bent_seconds_per_ray": ours,
        "scipy_over_bent": scipy / ours,
    }


def _one_column(scene: Scene) -> list[int]:
    return [4, 4, scene.require_heated().grid.cells[2]]


def _panes(fan: Fan, count: int) -> Any:
    from nigemizu import field

    return field.Layers.from_profile(*fan.profile(), count, fan.field.types)


def _crossed(fan: Fan, panes: Any) -> Any:
    from nigemizu import trace

    # every boundary may be met on the way down and on the way up again
    return settle(trace.cross_layers(panes, **fan.launched(), max_crossings=2 * panes.count + 2))


def _by_scipy(fan: Fan, rtol: float) -> FloatArray:
    """Heights [m] at the distance."""
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicSpline

    index = CubicSpline(*fan.profile())
    slope = index.derivative()
    low, high = fan.lowest_and_highest

    def rates(_: float, state: FloatArray) -> FloatArray:
        z = state[2]
        force = (1.0 + index(z)) * slope(z) if low < z < high else 0.0
        return np.array([state[3], state[4], state[5], 0.0, 0.0, force])

    n = 1.0 + float(index(min(max(fan.eye, low), high)))
    heights = []
    for angle in fan.elevations:
        p_x = n * math.cos(angle)  # kept all the way, so that x = p_x σ
        start = np.array([0.0, 0.0, fan.eye, p_x, 0.0, n * math.sin(angle)])
        way = solve_ivp(rates, (0.0, fan.distance / p_x), start, method="DOP853", rtol=rtol, atol=rtol)
        heights.append(float(way.y[2, -1]))
    return np.array(heights)
