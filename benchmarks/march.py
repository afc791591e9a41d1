"""Ray-steps per second of `nigemizu.trace.march` through a voxel volume, without geometry.

    python benchmarks/march.py [--json] [--rays N] [--steps N] [--repeat N]

Each case marches the same rays at a fixed step through 256×256×128 nodes. Beside it stands a loop written
by hand for this one volume (uniform axes, single precision, no status, no escape): the machine's ceiling in
the same run, so that a loaded machine shows in both.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np

from nigemizu import field, trace
from nigemizu.cli.bench.rays import FLAT, STEP, Voxels, by_hand, flat_rays, settle
from nigemizu.cli.bench.timing import SELDOM, alternate

Case = tuple[field.Types, np.ndarray, dict[str, Any]]


def cases(shape: Voxels) -> dict[str, Case]:
    """Array types, heights of the nodes and options of the march, by name."""
    uniform, stretched = shape.even_heights, shape.stretched_heights
    single, double = field.types("llvm"), field.types("llvm", "double")
    loose = {"surface": trace.ground_plane(-1.0), "chord_tolerance": 1e-5}
    return {
        "uniform": (single, uniform, {}),
        "uniform, ground plane": (single, uniform, loose),
        "uniform, differentiable types": (field.types("llvm", differentiable=True), uniform, {}),
        "stretched": (single, stretched, {}),
        "uniform, double positions": (double, uniform, {}),
        "stretched, double positions": (double, stretched, {}),
    }


def measure(count: int, steps: int, repeat: int, shape: Voxels = FLAT) -> dict[str, dict[str, float]]:
    """Speed of each case: million ray-steps per second, and its ratio to the loop by hand."""
    single = field.types("llvm")
    voxels = single.Float(shape.air(shape.even_heights).astype(np.float32).ravel())
    origin, direction = flat_rays(single, count)
    marched = len(direction.x) * steps / 1e6
    results: dict[str, dict[str, float]] = {}
    hand = 0.0
    for name, (types, z, options) in cases(shape).items():
        volume = field.TrilinearVolume(*shape.horizontal, z, shape.air(z), types, storage="single")
        start, ahead = flat_rays(types, count)

        def ours(
            volume: Any = volume, start: Any = start, ahead: Any = ahead, options: dict[str, Any] = options
        ) -> Any:
            return settle(trace.march(volume, start, ahead, step=STEP, max_steps=steps, **options))

        def theirs() -> Any:
            return settle(by_hand(single, voxels, shape, origin, direction, steps))

        made = float(np.sum(np.array(ours().steps), dtype=np.float64)) / 1e6
        seconds = alternate({"ours": ours, "theirs": theirs}, repeat)
        speed, here = made / seconds["ours"], marched / seconds["theirs"]
        results[name] = {"million_ray_steps_per_second": speed, "ratio": speed / here}
        hand = max(hand, here)
    return {"by hand": {"million_ray_steps_per_second": hand, "ratio": 1.0}, **results}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--rays", type=int, default=1_000_000, help="number of rays (default 1 million)")
    parser.add_argument("--steps", type=int, default=500, help="steps per ray (default 500)")
    parser.add_argument("--repeat", type=int, default=SELDOM, help="runs of which the median counts")
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
