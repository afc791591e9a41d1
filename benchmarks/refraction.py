"""Speed and accuracy of the refraction integral: a table from the horizon to the zenith at nine wavelengths.

The air is the US Standard Atmosphere 1976, dry; the errors are differences from the same table at the finest
tolerance. A second figure is a sunset over warm water, whose rays turn between kinks of the profile.

    python benchmarks/refraction.py [--json] [--step DEGREES] [--repeat N]
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
from numpy.typing import NDArray

from nigemizu.air import refractivity
from nigemizu.trace import astronomical_refraction

FloatArray = NDArray[np.float64]

RADIUS = 6371e3  # m
WAVELENGTHS = np.array([400, 450, 486, 500, 550, 589, 650, 656, 700]) * 1e-9
TOLERANCES = (1e-6, 1e-9, 1e-12)
SECOND = np.pi / 180 / 3600

STANDARD = ([0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3, 84852], [288.15, 216.65, 216.65, 228.65, 270.65, 270.65])
SUNSET = (
    [0, 0.8, 1.8, 2.7, 4, 5.9, 8.9, 18.1, 32.5, 50, 11000],
    [288, 287.5, 287.3, 287.2, 287.1, 287, 286.9],
)


class Layers:
    """n − 1 of an ideal gas at rest whose temperature is linear between heights."""

    top = 86e3

    def __init__(self, surface: FloatArray, heights: list[float], temperatures: list[float]) -> None:
        self.surface = surface
        self.heights, self.warmth = np.array(heights, dtype=float), np.array(temperatures, dtype=float)
        self.lapse = np.append(np.diff(self.warmth) / np.diff(self.heights), 0.0)
        self.fall = 9.80665 * 28.9644 / 8314.32
        self.logs = np.zeros(len(heights))
        for layer in range(len(heights) - 1):
            rise = self.heights[layer + 1] - self.heights[layer]
            self.logs[layer + 1] = self.logs[layer] + self._thinned(np.array(layer), rise)
        self.breaks = tuple(heights[1:])

    def _thinned(self, layer: NDArray[np.intp], rise: FloatArray) -> FloatArray:
        lapse, base = self.lapse[layer], self.warmth[layer]
        still = lapse == 0
        exponent = self.fall / np.where(still, 1.0, lapse) + 1
        return np.where(still, -self.fall * rise / base, -exponent * np.log1p(lapse * rise / base))

    def __call__(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        layer = np.maximum(np.searchsorted(self.heights, height, side="right") - 1, 0)
        rise = height - self.heights[layer]
        excess = self.surface * np.exp(self.logs[layer] + self._thinned(layer, rise))
        warmth = self.warmth[layer] + self.lapse[layer] * rise
        return excess, -(self.fall + self.lapse[layer]) / warmth * excess


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print a JSON object instead of the table")
    parser.add_argument("--step", type=float, default=0.1, help="degrees between elevations")
    parser.add_argument("--repeat", type=int, default=5, help="the least time of so many runs counts")
    arguments = parser.parse_args()
    figures = measure(arguments.step, arguments.repeat)
    if arguments.json:
        print(json.dumps(figures, indent=2))
        return
    print(f"{'':<34}{'rays':>8}{'seconds':>12}{'µs per ray':>12}{'error, rad':>12}")
    for name, row in figures.items():
        per_ray = 1e6 * row["seconds"] / row["rays"]
        print(f"{name:<34}{row['rays']:>8}{row['seconds']:>12.4f}{per_ray:>12.2f}{row['error_rad']:>12.1e}")


def measure(step: float, repeat: int) -> dict[str, dict[str, float]]:
    """Rays (times wavelengths), seconds and greatest error, by case."""
    surface = refractivity(288.15, 101325.0, wavelength=WAVELENGTHS)
    standard = Layers(surface, STANDARD[0], [*STANDARD[1], 214.65, 186.946])
    sunset = Layers(surface, SUNSET[0], [*SUNSET[1], 286.7, 286.5, 286.3, 216])
    table = np.radians(np.linspace(0.0, 90.0, round(90.0 / step) + 1))
    fan = np.radians(np.linspace(-7.0, 30.0, len(table)) / 60.0)
    figures = {}
    for name, air, elevations, eye in (("table", standard, table, 0.0), ("sunset", sunset, fan, 9.28)):
        exact = _timed(air, elevations, eye, 1e-14, 1)[0]
        for tolerance in TOLERANCES:
            found, seconds = _timed(air, elevations, eye, tolerance, repeat)
            figures[f"{name}, tolerance {tolerance:g} rad"] = {
                "rays": found.size,
                "seconds": seconds,
                "error_rad": float(np.abs(found - exact).max()),
            }
    return figures


def _timed(
    air: Layers, elevations: FloatArray, eye: float, tolerance: float, repeat: int
) -> tuple[FloatArray, float]:
    least = np.inf
    for _ in range(repeat):
        started = time.perf_counter()
        found = astronomical_refraction(
            air, elevations, radius=RADIUS, observer_height=eye, tolerance=tolerance
        )
        least = min(least, time.perf_counter() - started)
    return found, least


if __name__ == "__main__":
    main()
