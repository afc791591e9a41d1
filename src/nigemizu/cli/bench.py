"""The benchmark table: how fast this machine heats air and bends light, in under two minutes.

Every rate comes with one that bounds it on the same machine in the same run (copying memory, straight light):
compare the ratios, since a second load on the machine halves both.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

__all__ = ["copy_rate", "heat_rate", "march_rate", "picture_times", "run_all", "table"]


def best_of(repeats: int, work: Callable[[], object]) -> float:
    """Shortest time [s] that `work` takes; the first run, which compiles, does not count."""
    work()
    taken = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return min(taken)


def copy_rate(megabytes: int = 256) -> float:
    """Bytes read and written per second when an array is copied [1/s]."""
    source = np.ones(megabytes * 2**17)  # zeros would be one page of the system, read over and over
    target = np.empty_like(source)
    return 2 * source.nbytes / best_of(3, lambda: np.copyto(target, source))


def heat_rate(cells: tuple[int, int, int] = (256, 128, 96), steps: int = 4) -> float:
    """Cell-updates per second of the heat stage [1/s] in a stretched grid with wind and eddy diffusivity."""
    from nigemizu.heat import Diffusivity, GridSpec, HeldGround, Wind, evolve

    grid = GridSpec(x=(0.0, 512.0), y=(0.0, 128.0), height=4.0, cells=cells, first_cell=0.004).build()
    temperature = np.full(grid.shape, 300.0)
    temperature += np.random.default_rng(0).normal(0.0, 0.1, grid.shape)

    def work() -> None:
        for _ in evolve(
            grid,
            temperature,
            ground=HeldGround.model_validate({"temperature": 325.0}),
            diffusivity=Diffusivity(kind="eddy", friction_velocity=0.05),
            wind=Wind(speed=2.0, direction=30.0, shear="log"),
            times=[steps * 1.0],
            time_step=1.0,
        ):
            pass

    return temperature.size * steps / best_of(2, work)


def march_rate(nodes: tuple[int, int, int] = (256, 256, 128), rays: int = 2**19, steps: int = 256) -> float:
    """Ray-steps per second through a trilinear voxel volume at a fixed step, without geometry [1/s]."""
    import drjit as dr

    from nigemizu import field, trace

    types = field.types("llvm")
    x, y, z = (
        np.linspace(0.0, extent, count) for extent, count in zip((512.0, 512.0, 16.0), nodes, strict=True)
    )
    uneven = np.random.default_rng(0).normal(0.0, 1e-7, nodes[::-1])
    volume = field.TrilinearVolume(x, y, z, 2.7e-4 - 2e-5 * np.exp(-z / 0.5)[:, None, None] + uneven, types)
    random = np.random.default_rng(1)
    origin = types.Array3f(
        *(types.Float(random.uniform(*span, rays)) for span in ((1, 2), (1, 511), (4, 12)))
    )
    direction = types.Array3f(types.Float(1.0), types.Float(0.0), types.Float(0.0))
    dr.eval(origin, direction)
    made = 0

    def work() -> None:
        nonlocal made
        end = trace.march(volume, origin, direction, step=1.0, max_steps=steps)
        made = int(dr.sum(types.Float(end.steps))[0])

    taken = best_of(3, work)
    return made / taken


def picture_times(size: tuple[int, int] = (480, 270), samples: int = 16) -> dict[str, float]:
    """Time [s] of the built-in pyramid, bent and straight, compiled already."""
    from nigemizu.scene import Scene
    from nigemizu.scene.rendering import Studio

    small = {"camera.width": size[0], "camera.height": size[1], "camera.samples": samples}
    scene = Scene.load("pyramid", small)
    air = scene.air_at()
    taken = {}
    for method in ("bent", "straight"):
        studio = Studio(scene.with_changes({"tracer.method": method}), "auto")
        volume = air if method == "bent" else None
        taken[method] = best_of(2, partial(studio.shoot, volume))
    return taken


def run_all() -> dict[str, Any]:
    """Every benchmark and the machine it ran on; rates in 1/s, times in s."""
    from nigemizu.cli.doctor import examine

    found = examine()
    copied, heated, marched, seconds = copy_rate(), heat_rate(), march_rate(), picture_times()
    return {
        "machine": {
            key: found[key] for key in ("processor", "cores", "platform", "python", "nigemizu", "llvm")
        },
        "memory_copy_bytes_per_second": copied,
        "heat_cell_updates_per_second": heated,
        # one update reads and writes the temperature once at the very least
        "heat_share_of_memory_copy": heated * 16 / copied,
        "march_ray_steps_per_second": marched,
        "picture_bent_seconds": seconds["bent"],
        "picture_straight_seconds": seconds["straight"],
        "picture_bent_over_straight": seconds["bent"] / seconds["straight"],
    }


def table(results: dict[str, Any]) -> str:
    """The results as lines to read."""
    machine = results["machine"]
    rows = [
        ("machine", f"{machine['cores']} cores of {machine['processor']}, {machine['platform']}"),
        ("nigemizu", f"{machine['nigemizu']}, LLVM {machine['llvm']['version']}, Python {machine['python']}"),
        ("memory copied", f"{results['memory_copy_bytes_per_second'] / 1e9:.1f} GB/s"),
        ("heat stage", f"{results['heat_cell_updates_per_second'] / 1e6:.1f} million cell-updates/s"),
        ("  of the copying limit", f"{results['heat_share_of_memory_copy']:.1%}"),
        ("marching rays", f"{results['march_ray_steps_per_second'] / 1e6:.0f} million ray-steps/s"),
        ("small picture, bent", f"{results['picture_bent_seconds']:.2f} s"),
        ("small picture, straight", f"{results['picture_straight_seconds']:.2f} s"),
        ("  bent over straight", f"{results['picture_bent_over_straight']:.2f}"),
    ]
    return "\n".join(f"{name:24} {text}" for name, text in rows)
