"""All benchmarks in one run."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, TypeAlias, final

from nigemizu.cli.bench.fan import MOST_PANES, Fan, measure_panes, measure_ray_by_ray
from nigemizu.cli.bench.heat import measure_convection, measure_heat
from nigemizu.cli.bench.memory import measure_memory
from nigemizu.cli.bench.pictures import (
    fluctuating_road,
    measure_film,
    measure_growth,
    measure_picture,
)
from nigemizu.cli.bench.rays import FLAT, Voxels, measure_march
from nigemizu.cli.bench.superior import measure_far_view
from nigemizu.cli.bench.timing import OFTEN, SELDOM
from nigemizu.cli.meter import meter
from nigemizu.progress import ProgressMeter

if TYPE_CHECKING:
    from nigemizu.scene import Scene
    from nigemizu.scene.running import AirVolume

__all__ = ["BENCHMARKS", "FULL", "Sizes", "run_all"]

Nodes: TypeAlias = tuple[int, int, int]

PYRAMID_DISTANCE: Final = 700.0  # m
BENCHMARKS: Final = (
    "pyramid",
    "road",
    "march",
    "stratified",
    "panes",
    "ray_by_ray",
    "heat",
    "convection",
    "film",
    "growth",
    "memory",
)
"""In the order in which they run."""
_PACKAGES: Final = ("mitsuba", "drjit", "numpy", "scipy", "numba")


@final
@dataclass(frozen=True)
class Sizes:
    """How much is measured; the defaults are the benchmark, smaller ones try it out.

    Attributes
    ----------
    picture, road_picture, film, growth, growth_road_picture : (int, int)
        Width and height in pixels.
    samples, road_samples, growth_samples : int
        Rays per pixel.
    road, growth_road, memory : (int, int, int)
        Nodes along x, y and z.
    march : Voxels
    rays, steps : int
        Of the march.
    far : (int, int)
        Width and height in pixels of the view over 40 km.
    panes : int
        Most panes that are tried.
    by_scipy : int
        Rays that SciPy follows.
    heat, convection : (int, int, int)
        Cells along x, y and z.
    frames : int
    often, seldom : int
        Rounds of which the median counts, of quick and of slow contestants.
    changes : mapping
        What else is changed in both scenes, by dotted key.
    """

    picture: tuple[int, int] = (960, 540)
    samples: int = 16
    road_picture: tuple[int, int] = (480, 270)
    road_samples: int = 4
    road: Nodes = (512, 128, 64)
    march: Voxels = FLAT
    rays: int = 2**19
    steps: int = 256
    far: tuple[int, int] = (960, 600)
    panes: int = MOST_PANES
    by_scipy: int = 20
    heat: Nodes = (256, 128, 96)
    convection: Nodes = (128, 128, 64)
    film: tuple[int, int] = (480, 270)
    frames: int = 3
    growth: tuple[int, int] = (480, 270)
    growth_samples: int = 4
    growth_road_picture: tuple[int, int] = (320, 180)
    growth_road: Nodes = (256, 64, 32)
    memory: Nodes = (256, 192, 256)
    often: int = OFTEN
    seldom: int = SELDOM
    changes: Mapping[str, Any] = field(default_factory=dict)

    def scene(self, name: str, size: tuple[int, int], samples: int) -> Scene:
        """A built-in scene with a picture of this size and so many rays per pixel."""
        from nigemizu.scene import Scene

        camera = {"camera.width": size[0], "camera.height": size[1], "camera.samples": samples}
        return Scene.load(name, {**camera, **self.changes})


FULL: Final = Sizes()


def run_all(sizes: Sizes = FULL, *, quiet: bool = False) -> dict[str, Any]:
    """Every benchmark and the machine it ran on.

    Parameters
    ----------
    sizes : Sizes
    quiet : bool
        No progress bars, even on a terminal.

    Returns
    -------
    dict
        JSON-ready: ``machine``, one entry per benchmark, and ``seconds``, how long all took. Times in s,
        rates in 1/s, memory in bytes, errors in pixels; what could not be measured is None.
    """
    began = time.perf_counter()
    results: dict[str, Any] = {"machine": _machine()}
    suite = _Suite(sizes)
    with meter(quiet=quiet) as progress:
        progress.start("benchmarks", len(BENCHMARKS))
        for name in BENCHMARKS:
            results[name] = getattr(suite, name)(progress)
            progress.advance()
        progress.finish()
    return {**results, "seconds": time.perf_counter() - began}


@final
class _Suite:
    """The benchmarks of `Sizes`, with what several of them share."""

    def __init__(self, sizes: Sizes) -> None:
        self._sizes = sizes

    @cached_property
    def _pyramid(self) -> Scene:
        return self._sizes.scene("pyramid", self._sizes.picture, self._sizes.samples)

    @cached_property
    def _pyramid_air(self) -> AirVolume:
        return self._pyramid.air_at()

    @cached_property
    def _fan(self) -> Fan:
        return Fan.of(self._pyramid, PYRAMID_DISTANCE)

    def pyramid(self, progress: ProgressMeter) -> dict[str, Any]:
        scene, air, repeats = self._pyramid, self._pyramid_air, self._sizes.often
        return measure_picture(scene, air, repeats, label="pyramid", progress=progress)

    def road(self, progress: ProgressMeter) -> dict[str, Any]:
        sizes = self._sizes
        scene = sizes.scene("road", sizes.road_picture, sizes.road_samples)
        air = fluctuating_road(scene, sizes.road)
        return measure_picture(scene, air, sizes.seldom, label="road", progress=progress)

    def march(self, progress: ProgressMeter) -> dict[str, Any]:
        sizes = self._sizes
        return measure_march(sizes.march, sizes.rays, sizes.steps, sizes.often, progress=progress)

    def stratified(self, progress: ProgressMeter) -> dict[str, Any]:
        return measure_far_view(self._sizes.far, repeats=self._sizes.often, progress=progress)

    def panes(self, progress: ProgressMeter) -> dict[str, Any]:
        return measure_panes(self._fan, self._sizes.panes, progress=progress)

    def ray_by_ray(self, progress: ProgressMeter) -> dict[str, Any]:
        return measure_ray_by_ray(self._fan, self._sizes.by_scipy, progress=progress)

    def heat(self, progress: ProgressMeter) -> dict[str, Any]:
        return measure_heat(self._sizes.heat, progress=progress)

    def convection(self, progress: ProgressMeter) -> dict[str, Any]:
        from nigemizu.scene.running import flow_arrays

        cells = self._sizes.convection
        return measure_convection(cells, card=flow_arrays("auto", math.prod(cells)), progress=progress)

    def film(self, progress: ProgressMeter) -> dict[str, Any]:
        sizes = self._sizes
        scene = sizes.scene("road", sizes.film, sizes.samples)
        return measure_film(scene, sizes.frames, progress=progress)

    def growth(self, progress: ProgressMeter) -> dict[str, Any]:
        sizes = self._sizes
        pyramid = sizes.scene("pyramid", sizes.growth, sizes.growth_samples)
        road = sizes.scene("road", sizes.growth_road_picture, sizes.growth_samples)
        air = self._pyramid_air
        return measure_growth(pyramid, air, road, sizes.growth_road, sizes.seldom, progress=progress)

    def memory(self, progress: ProgressMeter) -> dict[str, Any]:
        return measure_memory(self._sizes.memory, progress=progress)


def _machine() -> dict[str, Any]:
    from nigemizu.cli.doctor import examine

    found = examine()
    told = {key: found[key] for key in ("processor", "cores", "platform", "python", "nigemizu")}
    packages = {name: found["packages"][name] for name in _PACKAGES}
    return {**told, "llvm": found["llvm"]["version"], "packages": packages}
