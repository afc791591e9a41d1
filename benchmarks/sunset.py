"""Time of a sunset in many wavelengths, and of each wavelength more.

    python benchmarks/sunset.py [--size 960x540] [--samples 64] [--wavelengths 16] [--repeat 3] [--json]

The first picture compiles; it is timed apart. Sky: light scattered along bent rays, tables for one place of
the Sun. Picture: laying the paths of every wavelength, following them, and their light.
"""

from __future__ import annotations

import argparse
import json
import time

from nigemizu.scene import Scene
from nigemizu.scene.rendering import Studio


def measure(size: tuple[int, int], samples: int, wavelengths: int, repeat: int) -> dict[str, float]:
    """Seconds of sky and picture, the least of `repeat` after the first, and of the first."""
    scene = Scene.load(
        "sunset-mock",
        {
            "camera.width": size[0],
            "camera.height": size[1],
            "camera.samples": samples,
            "light.wavelengths": wavelengths,
        },
    )
    air = scene.air_at()
    timed = []
    for _ in range(1 + repeat):
        begin = time.perf_counter()
        studio = Studio(scene, "auto")
        middle = time.perf_counter()
        studio.shoot(air)
        timed.append((middle - begin, time.perf_counter() - middle))
    sky, picture = (min(row[part] for row in timed[1:]) for part in (0, 1))
    return {"first": sum(timed[0]), "sky": sky, "picture": picture, "together": sky + picture}


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", default="960x540")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--wavelengths", type=int, default=16)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    width, height = (int(part) for part in options.size.split("x"))
    figures = measure((width, height), options.samples, options.wavelengths, options.repeat)
    if options.json:
        print(json.dumps(figures, indent=2))
        return
    for name, seconds in figures.items():
        print(f"{name:10}{seconds:8.2f} s")


if __name__ == "__main__":
    main()
