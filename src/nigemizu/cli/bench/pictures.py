"""Pictures: bent light against straight light, Mitsuba's own and ours; the film; how the cost grows."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from nigemizu.cli.bench.timing import OFTEN, SELDOM, alternate, exponent
from nigemizu.progress import SILENT, ProgressMeter

if TYPE_CHECKING:
    from nigemizu.scene import Scene
    from nigemizu.scene.picture import RenderedPicture
    from nigemizu.scene.running import AirVolume, Variant

__all__ = ["VARIANT", "fluctuating_road", "measure_film", "measure_growth", "measure_picture"]

VARIANT: Final[Variant] = "llvm"
STOCK: Final = {"type": "direct"}
"""Mitsuba's own integrator of direct light."""
DIRECT: Final = 2
"""Segments of a path of light that reaches the eye from a source by one surface."""
FLUCTUATION: Final = 0.5  # K, root mean square

_REPORTED: Final = {
    "steps_per_ray": "steps",
    "queries_per_ray": "queries",
    "worst_error_pixels": "worst",
    "mean_error_pixels": "mean",
}
"""Our names → those of the report of a picture."""


def measure_picture(
    scene: Scene, air: AirVolume, repeats: int = OFTEN, *, label: str, progress: ProgressMeter = SILENT
) -> dict[str, Any]:
    """Time of one picture by our bent and straight light and by Mitsuba's own integrator.

    Parameters
    ----------
    scene : Scene
    air : AirVolume
    repeats : int
    label : str
        What the meter calls it.
    progress : ProgressMeter

    Returns
    -------
    dict
        Seconds of each and their ratios to Mitsuba's, and ``report``: steps and geometry queries per ray and
        the estimated errors in pixels of the bent picture.

    Notes
    -----
    ``bent`` and ``straight`` are the scene's pictures as a film takes them, frame after frame: air onto the
    device (bent only), haze, light scattered once, the report of errors, and the picture in NumPy. Mitsuba's
    ``direct`` has neither haze nor scattered light. ``bent_alike`` and ``straight_alike`` do without them
    too, and are timed like it, from camera to radiance; the bent one lays its shared paths anew each time.
    """
    import drjit as dr

    from nigemizu import field
    from nigemizu.render import build
    from nigemizu.render.variant import current_backend
    from nigemizu.scene.rendering import Studio

    studio, camera = Studio(scene, VARIANT), scene.camera
    built = build(camera, scene.light, scene.objects, integrator=STOCK)
    bent, put_air_in = _alike(scene, air)
    straight, _ = _alike(scene.with_changes({"tracer.method": "straight"}), None)
    taken: list[RenderedPicture] = []

    def radiance(integrator: Any) -> None:
        seed = dr.opaque(field.types(current_backend(), differentiable=True).UInt32, camera.seed)
        dr.eval(integrator.render(built, built.sensors()[0], seed=seed, spp=camera.samples))
        dr.sync_thread()

    def bent_alike() -> None:
        put_air_in()
        radiance(bent)

    works: dict[str, Callable[[], object]] = {
        "stock": lambda: radiance(built.integrator()),
        "bent_alike": bent_alike,
        "straight_alike": lambda: radiance(straight),
        "bent": lambda: taken.append(studio.shoot(air)),
        "straight": partial(studio.shoot, None),
    }
    seconds = alternate(works, repeats, label=label, progress=progress)
    nz, ny, nx = air.refractivity.shape
    return {
        "size": [camera.width, camera.height],
        "samples": camera.samples,
        "nodes": [nx, ny, nz],
        **{f"{name}_seconds": value for name, value in seconds.items()},
        **{
            f"{name}_over_stock": value / seconds["stock"]
            for name, value in seconds.items()
            if name != "stock"
        },
        "report": _report(taken[-1]),
    }


def _alike(scene: Scene, air: AirVolume | None) -> tuple[Any, Callable[[], None]]:
    """Our integrator of direct light without haze, and what puts the air in, which lies on the device."""
    from nigemizu.render import Settings, integrator, medium_of

    settings = Settings(tracer=scene.tracer, visibility=None, max_depth=DIRECT)
    ours = integrator(settings=settings)
    if air is None:
        return ours, lambda: None
    angle = scene.tracer.angle(scene.camera.pixel_angle)
    make = partial(medium_of, *air[:4], tracer=scene.tracer, angle=angle)
    medium = make()
    # In air that varies with height alone the shared paths are double; elsewhere nothing asks for it here.
    double = make(precision="double", storage="single") if medium.stratified else medium
    return ours, lambda: ours.set_medium(medium, lambda: double)


def _report(picture: RenderedPicture) -> dict[str, float] | None:
    report = getattr(picture, "report", None)
    if report is None:
        return None
    return {ours: float(getattr(report, theirs)) for ours, theirs in _REPORTED.items()}


def fluctuating_road(scene: Scene, nodes: tuple[int, int, int], seed: int = 0) -> AirVolume:
    """Air that fluctuates at the scale of its cells, the hardest to march through.

    Parameters
    ----------
    scene : Scene
        Whose grid is filled, and whose air without its unevenness gives the mean profile.
    nodes : (int, int, int)
        Number of nodes along x, y and z; those along z are stretched like the scene's.
    seed : int
        Of the fluctuations.

    Returns
    -------
    AirVolume

    Notes
    -----
    n(x, y, z) = n̄(z) + (dn/dT)(z) T'(x, y, z). T' is white noise on the nodes, smoothed by a Gaussian of one
    cell's standard deviation along each axis: normal, of 0.5 K root mean square everywhere, with the
    correlation exp(−d²/4) at d cells, which has fallen to 1/e at two cells. It is no turbulence.
    """
    from scipy.ndimage import gaussian_filter

    from nigemizu.scene.running import AirVolume

    nx, ny, nz = nodes
    # the skin of the ground is a node of its own, below the lowest cell
    still = scene.with_changes({"grid.cells": [4, 4, nz - 1], "initial.unevenness": []}).air_at()
    z, mean = still.z, still.refractivity.mean(axis=(1, 2))
    temperature = still.temperature
    assert temperature is not None  # the heat stage always gives it
    pressure = scene.air.hydrostatic_pressure(z, temperature)
    warmer, colder = (scene.air.refractivity(temperature + half, pressure) for half in (0.5, -0.5))
    white = np.random.default_rng(seed).standard_normal((nz, ny, nx), dtype=np.float32)
    uneven = gaussian_filter(white, 1.0, mode="wrap")
    refractivity = uneven * (FLUCTUATION / uneven.std(dtype=np.float64) * (warmer - colder))[:, None, None]
    refractivity += mean[:, None, None]
    grid = scene.require_heated().grid
    x, y = np.linspace(*grid.x, nx), np.linspace(*grid.y, ny)
    return AirVolume(x, y, z, refractivity, temperature)


def measure_film(scene: Scene, frames: int = 4, *, progress: ProgressMeter = SILENT) -> dict[str, Any]:
    """Frames per minute of a scene's film: air, picture and file, in one process that is warm.

    Parameters
    ----------
    scene : Scene
    frames : int
        Frames that are timed together. The one before them, with the air's way to it, does not count.
    progress : ProgressMeter
    """
    from nigemizu.scene.rendering import Studio
    from nigemizu.scene.running import air_instants

    studio, camera = Studio(scene, VARIANT), scene.camera
    progress.start("film", frames + 1)
    with tempfile.TemporaryDirectory() as folder:
        began = 0.0
        instants = air_instants(scene, scene.film.times[: frames + 1], None, SILENT)
        for index, air in enumerate(instants):
            studio.shoot(air, frame=index).save(Path(folder) / f"{index}.png")
            began = began or time.perf_counter()
            progress.advance()
        elapsed = time.perf_counter() - began
    progress.finish()
    return {
        "size": [camera.width, camera.height],
        "samples": camera.samples,
        "frames_per_minute": 60.0 * frames / elapsed,
    }


def measure_growth(
    pyramid: Scene,
    air: AirVolume,
    road: Scene,
    nodes: tuple[int, int, int] = (256, 64, 32),
    repeats: int = SELDOM,
    *,
    progress: ProgressMeter = SILENT,
) -> dict[str, float]:
    """How the time of a bent picture grows: exponents from two points each.

    Parameters
    ----------
    pyramid : Scene
        The smallest picture of its air; others have four times its pixels or samples.
    air : AirVolume
        The pyramid's.
    road : Scene
    nodes : (int, int, int)
        Nodes along x, y and z of the smaller volume of the road; the finer has twice as many along each.
    repeats : int
    progress : ProgressMeter

    Returns
    -------
    dict
        Powers of the number of ``pixels``, ``samples`` and ``cells`` (of air that fluctuates at the scale of
        its cells) and of the ``path_length`` (the pyramid's air, whole and its first quarter). What a
        picture costs at the least pulls them below 1.
    """
    from nigemizu.scene.rendering import Studio

    camera, double = pyramid.camera, (2 * nodes[0], 2 * nodes[1], 2 * nodes[2])
    wide = {"camera.width": 2 * camera.width, "camera.height": 2 * camera.height}
    changes = {"base": {}, "pixels": wide, "samples": {"camera.samples": 4 * camera.samples}}
    outside = {"tracer.beyond": "straight"}  # light that has left the first quarter is not bent any more
    studios = {name: Studio(pyramid.with_changes({**outside, **change}), VARIANT)
               for name, change in changes.items()}  # fmt: skip
    on_road = Studio(road, VARIANT)
    quarter, reached = _first_part(air, 0.25)
    works = {
        **{name: partial(studio.shoot, air) for name, studio in studios.items()},
        "quarter": partial(studios["base"].shoot, quarter),
        "coarse": partial(on_road.shoot, fluctuating_road(road, nodes)),
        "fine": partial(on_road.shoot, fluctuating_road(road, double)),
    }
    seconds = alternate(works, repeats, label="growth", progress=progress)
    return {
        "pixels": exponent(seconds["base"], seconds["pixels"], 4.0),
        "samples": exponent(seconds["base"], seconds["samples"], 4.0),
        "cells": exponent(seconds["coarse"], seconds["fine"], 8.0),
        "path_length": exponent(seconds["quarter"], seconds["base"], reached),
    }


def _first_part(air: AirVolume, share: float) -> tuple[AirVolume, float]:
    """The air as far as a share of its length, and how many times longer the whole is."""
    end = max(2, round(share * len(air.x)))
    part = air._replace(x=air.x[:end], refractivity=np.ascontiguousarray(air.refractivity[:, :, :end]))
    return part, float((air.x[-1] - air.x[0]) / (part.x[-1] - part.x[0]))
