"""Ray-steps per second of `nigemizu.trace.march` through a voxel volume, without geometry.

    python benchmarks/march.py [--json] [--rays N] [--steps N] [--repeat N]

Each case marches the same rays at a fixed step through 256×256×128 nodes. Beside it stands a loop written
by hand for this one volume (uniform axes, single precision, no status, no escape): the machine's ceiling in
the same run, so that a loaded machine shows in both.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np

from nigemizu import field, trace

NX, NY, NZ = 256, 256, 128
LENGTH, WIDTH, HEIGHT = 700.0, 60.0, 12.8  # m
STEP = 1.0  # m


def stretched_heights() -> np.ndarray:
    """NZ heights whose spacing grows from 1 mm by a constant ratio up to HEIGHT."""
    low, high = 1.0, 1.5
    for _ in range(200):
        ratio = 0.5 * (low + high)
        total = 0.001 * np.sum(ratio ** np.arange(NZ - 1))
        low, high = (ratio, high) if total < HEIGHT else (low, ratio)
    edges = np.concatenate([[0.0], np.cumsum(0.001 * ratio ** np.arange(NZ - 1))])
    return edges * (HEIGHT / edges[-1])


def air(z: np.ndarray) -> np.ndarray:
    """Refractivity of uneven air over a hot ground, shape (NZ, NY, NX)."""
    random = np.random.default_rng(7)
    layer = 2.7e-4 - 2e-5 * np.exp(-z / 0.3)
    return layer[:, None, None] + 1e-8 * random.standard_normal((NZ, NY, NX))


def rays(types: field.Types, count: int) -> tuple[Any, Any]:
    """A grid of flat rays in the order of a picture's pixels."""
    side = int(np.sqrt(count))
    across, up = np.meshgrid(np.linspace(-0.03, 0.03, side), np.linspace(-0.001, 0.008, side))
    direction = np.stack([np.ones_like(up), across, up]).reshape(3, -1)
    direction /= np.linalg.norm(direction, axis=0)
    return types.Array3f(0.5, 0, 1.5), types.Array3f(direction)


@dr.syntax
def by_hand(types: field.Types, voxels: Any, origin: Any, direction: Any, steps: int) -> Any:
    """The least that a leapfrog march through this volume can do."""
    lower = types.Array3f(0, -WIDTH / 2, 0)
    scale = types.Array3f((NX - 1) / LENGTH, (NY - 1) / WIDTH, (NZ - 1) / HEIGHT)
    x, p = types.Array3f(origin), types.Array3f(direction)
    k = types.UInt32(0)
    while dr.hint(k < steps, label="by hand"):
        x += p * (0.5 * STEP)
        q = (x - lower) * scale
        i = dr.minimum(types.UInt32(dr.maximum(q.x, 0)), NX - 2)
        j = dr.minimum(types.UInt32(dr.maximum(q.y, 0)), NY - 2)
        m = dr.minimum(types.UInt32(dr.maximum(q.z, 0)), NZ - 2)
        u, v, w = q.x - types.Float(i), q.y - types.Float(j), q.z - types.Float(m)
        c = (m * NY + j) * NX + i
        row, layer = NX, NX * NY
        f000, f001 = dr.gather(types.Float, voxels, c), dr.gather(types.Float, voxels, c + 1)
        f010, f011 = dr.gather(types.Float, voxels, c + row), dr.gather(types.Float, voxels, c + row + 1)
        c += layer
        f100, f101 = dr.gather(types.Float, voxels, c), dr.gather(types.Float, voxels, c + 1)
        f110, f111 = dr.gather(types.Float, voxels, c + row), dr.gather(types.Float, voxels, c + row + 1)
        x00, x01, x10, x11 = f001 - f000, f011 - f010, f101 - f100, f111 - f110
        e00, e01 = dr.fma(u, x00, f000), dr.fma(u, x01, f010)
        e10, e11 = dr.fma(u, x10, f100), dr.fma(u, x11, f110)
        f0, f1 = dr.fma(v, e01 - e00, e00), dr.fma(v, e11 - e10, e10)
        slope = types.Array3f(
            dr.lerp(dr.lerp(x00, x01, v), dr.lerp(x10, x11, v), w), dr.lerp(e01 - e00, e11 - e10, w), f1 - f0
        )
        n = 1 + dr.fma(w, f1 - f0, f0)
        p += slope * scale * (n * STEP)
        x += p * (0.5 * STEP)
        k += 1
    return x


def best_times(works: list[Callable[[], Any]], repeat: int) -> list[float]:
    """Least seconds of several runs of each piece of work, taken in turns; the compilation left out."""
    times: list[list[float]] = [[] for _ in works]
    for turn in range(repeat + 1):
        for work, kept in zip(works, times, strict=True):
            start = time.perf_counter()
            dr.eval(work())
            dr.sync_thread()
            if turn > 0:
                kept.append(time.perf_counter() - start)
    return [min(kept) for kept in times]


def measure(count: int, steps: int, repeat: int) -> dict[str, dict[str, float]]:
    """Speed of each case: million ray-steps per second, and its ratio to the loop by hand."""
    uniform, stretched = np.linspace(0, HEIGHT, NZ), stretched_heights()
    x, y = np.linspace(0, LENGTH, NX), np.linspace(-WIDTH / 2, WIDTH / 2, NY)
    single, double = field.types("llvm"), field.types("llvm", "double")
    loose = {"surface": trace.ground_plane(-1.0), "chord_tolerance": 1e-5}
    cases: dict[str, tuple[field.Types, np.ndarray, dict[str, Any]]] = {
        "uniform": (single, uniform, {}),
        "uniform, ground plane": (single, uniform, loose),
        "uniform, differentiable types": (field.types("llvm", differentiable=True), uniform, {}),
        "stretched": (single, stretched, {}),
        "uniform, double positions": (double, uniform, {}),
        "stretched, double positions": (double, stretched, {}),
    }
    voxels = single.Float(air(uniform).astype(np.float32).ravel())
    origin, direction = rays(single, count)
    marched = len(direction.x) * steps / 1e6
    results = {}
    hand = 0.0
    for name, (types, z, options) in cases.items():
        volume = field.TrilinearVolume(x, y, z, air(z), types, storage="single")
        start, ahead = rays(types, count)

        def work(
            volume: Any = volume, start: Any = start, ahead: Any = ahead, options: dict[str, Any] = options
        ) -> Any:
            return trace.march(volume, start, ahead, step=STEP, max_steps=steps, **options)

        made = float(np.sum(np.array(work().steps), dtype=np.float64)) / 1e6
        # In turns with the loop by hand, so that a load that comes and goes does not decide the ratio.
        ours, theirs = best_times([work, lambda: by_hand(single, voxels, origin, direction, steps)], repeat)
        speed, here = made / ours, marched / theirs
        results[name] = {"million_ray_steps_per_second": speed, "ratio": speed / here}
        hand = max(hand, here)
    return {"by hand": {"million_ray_steps_per_second": hand, "ratio": 1.0}, **results}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--rays", type=int, default=1_000_000, help="number of rays (default 1 million)")
    parser.add_argument("--steps", type=int, default=500, help="steps per ray (default 500)")
    parser.add_argument("--repeat", type=int, default=3, help="runs of which the best counts (default 3)")
    arguments = parser.parse_args()
    results = measure(arguments.rays, arguments.steps, arguments.repeat)
    if arguments.json:
        print(json.dumps(results, indent=2))
        return
    print(f"{'case':<32}{'million ray-steps/s':>20}{'ratio':>8}")
    for name, result in results.items():
        print(f"{name:<32}{result['million_ray_steps_per_second']:>20.0f}{result['ratio']:>8.2f}")


if __name__ == "__main__":
    main()
