"""Error against time of the bent ray: every rule of steps, interpolant and precision.

    python benchmarks/work_precision.py [-o work_precision.svg] [--json] [--rays N] [--steps M ...]

Two airs, in both of which every ray is known. In one n² = a − A exp(−z/h), where rays have a closed form.
The other is a hot road, its index given on the nodes of a volume; there the rays of the continuous profile
come from SciPy's DOP853, so that what an interpolant loses counts as error. The error is the 99th percentile
of the rays' displacement at 1 km, as an angle seen from the eye. Where rays are lost there is no point.
"""

from __future__ import annotations

import argparse
import io
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np

from nigemizu import field, trace
from nigemizu.cli.bench.fan import Fan
from nigemizu.cli.bench.timing import SELDOM, alternate

DISTANCE = 1000.0  # m
MICRORADIAN = 1e-6
MOST_STEPS = 100_000
STEPS = (32.0, 16.0, 8.0, 4.0, 2.0, 1.0)  # m
ACCURACIES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # rad
CONTROLLED = "error-controlled"
LOG_COSH = "exact ray, field in closed form"
ROAD = "hot road, {}"
INTERPOLATIONS = ("trilinear", "stratified", "tricubic")

A, AMPLITUDE, SCALE = 1.00027**2, 5e-5, 0.05  # 1, 1, m
EYE = 1.5  # m
TENTH_OF_A_PIXEL = 5.1  # µrad, in the built-in picture of the road

Making = Callable[[field.Types, float], field.Field]


@dataclass(frozen=True)
class Case:
    """Rays whose ends are known, and the field that they cross.

    Attributes
    ----------
    title : str
    make : callable
        ``make(types, accuracy)``: the field, as a march to `accuracy` [rad] would have it (0: a fixed step).
    elevations : (N,) float64, rad
    exact : (N,) float64, m
        Heights at 1 km.
    """

    title: str
    make: Making
    elevations: np.ndarray
    exact: np.ndarray

    def fan(self, types: field.Types, accuracy: float = 0.0) -> Fan:
        """The rays in these array types; errors are in µrad."""
        return Fan(self.make(types, accuracy), EYE, self.elevations, DISTANCE, MICRORADIAN, self.exact)


@dataclass(frozen=True)
class Point:
    """One measurement: how a case was marched, and what came of it."""

    case: str
    method: str
    precision: str
    control: float  # step in m, or accuracy in rad
    error: float  # µrad
    seconds: float  # per ray


def log_cosh(count: int) -> Case:
    """Rays that turn over the hot layer n² = a − A exp(−z/h).

    z = z_t + 2h ln cosh(p∞ (σ − σ_t)/2h) with p∞² = A exp(−z_t/h), written so that no digits cancel.
    """
    elevations = np.linspace(-6e-3, -1.6e-3, count)
    less = AMPLITUDE * math.exp(-EYE / SCALE)
    n = math.sqrt(A - less)
    p_x, p_z = n * np.cos(elevations), n * np.sin(elevations)
    far = np.sqrt(less + p_z**2)
    turn = -SCALE * np.log(far**2 / AMPLITUDE)
    # artanh r = ln((1 + r)²/(1 − r²))/2, and 1 − r² = A exp(−z₀/h)/p∞²
    to_turn = SCALE / far * np.log((1.0 - p_z / far) ** 2 * far**2 / less)
    phase = np.abs(far * (DISTANCE / p_x - to_turn) / (2.0 * SCALE))
    exact = turn + 2.0 * SCALE * (phase + np.log1p(np.exp(-2.0 * phase)) - math.log(2.0))
    return Case(
        LOG_COSH, lambda types, _: field.ExponentialSquare(types, A, AMPLITUDE, SCALE), elevations, exact
    )


def road_refractivity(z: np.ndarray) -> np.ndarray:
    """n − 1 at the heights `z` [m] over the built-in road before any heat has spread."""
    temperature = 308.168 + 6.37 * np.exp(-10.08 * z) + 22.0 * np.exp(-z / 0.01)
    return np.asarray(7.86e-4 * 101.325 / temperature)


def road(interpolation: str, count: int) -> Case:
    """Rays through the rows of the road's picture that do not meet the ground within 1 km."""
    from nigemizu.scene import Scene

    scene = Scene.load("road")
    camera, edges = scene.camera, scene.grid.build().z_edges
    half = 0.5 * camera.height * camera.pixel_angle
    turned_back = math.sqrt(2.0 * float(road_refractivity(np.array(EYE)) - road_refractivity(np.array(0.0))))
    elevations = np.linspace(-min(half, 0.95 * turned_back), half, count)
    x = np.linspace(*scene.grid.x, scene.grid.cells[0] + 1)
    y = np.linspace(*scene.grid.y, scene.grid.cells[1] + 1)
    # so little that no ray feels it, but no volume takes the air for stratified
    uneven = 1e-13 * np.random.default_rng(0).standard_normal((edges.size, y.size, x.size))
    refractivity = road_refractivity(edges)[:, None, None] + uneven

    def make(types: field.Types, accuracy: float) -> field.Field:
        if interpolation == "tricubic":
            return field.TricubicVolume(x, y, edges, refractivity, types, "extend")
        # over the whole way, a gradient that is wrong by this displaces a ray by half the accuracy
        volume = field.StratifiedVolume if interpolation == "stratified" else field.TrilinearVolume
        return volume(x, y, edges, refractivity, types, "extend", flatness=accuracy / DISTANCE)

    return Case(ROAD.format(interpolation), make, elevations, by_scipy(elevations))


def by_scipy(elevations: np.ndarray) -> np.ndarray:
    """Heights [m] at 1 km of rays over the continuous profile of the road: d²z/dσ² = n dn/dz."""
    from scipy.integrate import solve_ivp

    n = 1.0 + float(road_refractivity(np.array(EYE)))
    p_x, p_z = n * np.cos(elevations), n * np.sin(elevations)

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        z, p = np.split(state, 2)
        warmth, skin = 6.37 * np.exp(-10.08 * z), 22.0 * np.exp(-z / 0.01)
        refractivity = road_refractivity(z)
        slope = refractivity / (308.168 + warmth + skin) * (10.08 * warmth + skin / 0.01)
        # σ differs from ray to ray: all are followed over the same share of their way
        return np.concatenate([p, (1.0 + refractivity) * slope]) * np.tile(DISTANCE / p_x, 2)

    start = np.concatenate([np.full_like(elevations, EYE), p_z])
    way = solve_ivp(rates, (0.0, 1.0), start, method="DOP853", rtol=1e-12, atol=1e-14)
    return np.asarray(way.y[: elevations.size, -1])


def measure(
    cases: Sequence[Case],
    rays: int,
    steps: Sequence[float] = STEPS,
    accuracies: Sequence[float] = ACCURACIES,
    repeat: int = SELDOM,
) -> list[Point]:
    """Error and time of every method on every case."""
    points = []
    for case in cases:
        for precision in ("single", "double"):
            types = field.types("llvm", precision)
            # Opaque: one kernel serves all steps, and one all accuracies.
            fan, most = case.fan(types), dr.opaque(types.UInt32, MOST_STEPS)
            for name, stepper in trace.STEPPERS.items():
                for step in steps:
                    how = {"step": dr.opaque(types.Float, step), "stepper": stepper, "max_steps": most}
                    error, seconds = error_and_time(fan, how, rays, repeat)
                    points.append(Point(case.title, name, precision, step, error, seconds))
            for accuracy in accuracies:
                how = {"accuracy": dr.opaque(types.Float, accuracy), "max_steps": most}
                error, seconds = error_and_time(case.fan(types, accuracy), how, rays, repeat)
                points.append(Point(case.title, CONTROLLED, precision, accuracy, error, seconds))
    return [point for point in points if math.isfinite(point.error)]


def error_and_time(fan: Fan, how: dict[str, Any], rays: int, repeat: int) -> tuple[float, float]:
    """Error [µrad] of the fan's rays, and seconds per ray where `rays` of them are marched together."""
    error = fan.error(fan.heights(fan.marched(**how)))
    if not math.isfinite(error):
        return error, math.nan
    many = fan.repeated(rays)
    seconds = alternate({"march": lambda: many.marched(**how)}, repeat)["march"]
    return error, seconds / len(many.elevations)


COLOURS = {
    "euler": "#cc79a7",
    "leapfrog": "#e69f00",
    "yoshida4": "#56b4e9",
    "suzuki4": "#0072b2",
    CONTROLLED: "#000000",
}
"""Of Okabe and Ito, who made them to be told apart by the colour-blind."""
MARKERS = {"euler": "v", "leapfrog": "o", "yoshida4": "s", "suzuki4": "^", CONTROLLED: "D"}
INK = "#22303a"
SHOWN = (1e-3, 1e3)  # µrad


def draw(points: Sequence[Point], path: Path) -> None:
    """Write the plot, .svg, .png or .pdf: one panel per case, error to the right, time upwards."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from nigemizu.output.files import write_bytes

    titles = list(dict.fromkeys(point.case for point in points))
    rows = math.ceil(len(titles) / 2)
    buffer = io.BytesIO()
    style = {"font.size": 9.5, "text.color": INK, "axes.labelcolor": INK, "axes.edgecolor": INK}
    # a fixed salt and no date: equal measurements give equal files
    with rc_context({**style, "svg.hashsalt": "nigemizu"}):
        figure = Figure(figsize=(9.5, 0.8 + 3.5 * rows), layout="constrained")
        panels = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False).ravel()
        for panel, title in zip(panels, titles, strict=False):
            _draw_panel(panel, [point for point in points if point.case == title], title)
        for panel in panels[len(titles) :]:
            panel.set_visible(False)
        figure.supxlabel("displacement in the picture (µrad), 99th percentile of the rays", fontsize=9.5)
        figure.supylabel("time per ray over 1 km (µs)", fontsize=9.5)
        figure.legend(handles=_legend(), loc="outside upper center", ncols=7, frameon=False, fontsize=9)
        about = {"Date": None} if path.suffix == ".svg" else {}
        figure.savefig(buffer, format=path.suffix[1:], dpi=160, metadata=about)
    write_bytes(path, buffer.getvalue())


def _draw_panel(panel: Any, points: Sequence[Point], title: str) -> None:
    for method, colour in COLOURS.items():
        for precision, dash in (("single", (0, (4, 2))), ("double", "-")):
            line = [point for point in points if (point.method, point.precision) == (method, precision)]
            panel.plot(
                [point.error for point in line],
                [1e6 * point.seconds for point in line],
                color=colour,
                ls=dash,
                lw=_width(method),
                marker=MARKERS[method],
                ms=4,
                markerfacecolor=colour if precision == "double" else "white",
                zorder=3 if method == CONTROLLED else 2,
            )
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlim(SHOWN)
    panel.axvline(TENTH_OF_A_PIXEL, color="#999999", lw=0.9, zorder=1)
    panel.annotate(
        "0.1 pixel", (TENTH_OF_A_PIXEL, 0.985), xycoords=("data", "axes fraction"), xytext=(3, 0),
        textcoords="offset points", va="top", fontsize=8, color="#666666",
    )  # fmt: skip
    panel.set_title(title, fontsize=9.5, loc="left")
    panel.grid(color="#e4e4e4", lw=0.6, zorder=0)
    panel.spines[["top", "right"]].set_visible(False)


def _width(method: str) -> float:
    return 2.2 if method == CONTROLLED else 1.3


def _legend() -> list[Any]:
    from matplotlib.lines import Line2D

    methods = [
        Line2D([], [], color=colour, marker=MARKERS[name], ms=5, lw=_width(name), label=name)
        for name, colour in COLOURS.items()
    ]
    double = Line2D([], [], color=INK, lw=1.3, marker="o", ms=4, label="double")
    single = Line2D(
        [], [], color=INK, lw=1.3, marker="o", ms=4, ls=(0, (4, 2)), markerfacecolor="white", label="single"
    )
    return [*methods, double, single]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="plot to write: .svg, .png or .pdf")
    parser.add_argument("--json", action="store_true", help="print every measurement as JSON")
    parser.add_argument("--rays", type=int, default=2**16, help="rays that are timed together")
    parser.add_argument("--fan", type=int, default=256, help="different rays among them")
    parser.add_argument("--steps", type=float, nargs="+", default=STEPS, help="fixed steps in m")
    parser.add_argument("--repeat", type=int, default=SELDOM, help="runs of which the median counts")
    arguments = parser.parse_args()
    if arguments.output is not None and arguments.output.suffix not in (".svg", ".png", ".pdf"):
        parser.error(f"-o: {arguments.output} must end in .svg, .png or .pdf")
    cases = [log_cosh(arguments.fan), *(road(kind, arguments.fan) for kind in INTERPOLATIONS)]
    points = measure(cases, arguments.rays, arguments.steps, repeat=arguments.repeat)
    if arguments.output is not None:
        draw(points, arguments.output)
    if arguments.json:
        print(json.dumps([vars(point) for point in points], indent=1))
    elif arguments.output is None:
        for point in points:
            print(
                f"{point.case:<34}{point.method:<18}{point.precision:<8}{point.control:>8g}"
                f"{point.error:>12.3g} µrad{1e6 * point.seconds:>12.3g} µs"
            )


if __name__ == "__main__":
    main()
