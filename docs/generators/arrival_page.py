"""Angles of arrival and their differences: measured in films of our own, beside theory.

The films are made by ``make validation`` (`generators.arrival_films`); the theory is computed at each build.
"""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from generators.arrival_films import DATA, SCENE
from generators.arrival_theory import View, closed_form, difference, variance
from generators.figures import BLUE, INK, RED, panels
from generators.text import table, write_if_changed
from nigemizu.heat.turbulence import rytov_variance

__all__ = ["write"]

SQUARE = 1e12  # µrad²
COMMON = 1e-14  # Cn² for which differences of all films are drawn [m^(−2/3)]
LEVEL = 0.95
SAME_AIR = 0.05  # relative deviation from straight rays through the same air


def write(folder: Path, images: Path) -> None:
    """The tables ``arrival.rst`` and ``differences.rst`` in `folder`, and the figures in `images`."""
    films = json.loads(DATA.read_text(encoding="utf-8"))["films"]
    views = [_view(film) for film in films]
    write_if_changed(folder / "arrival.rst", _arrival_table(films, views))
    write_if_changed(folder / "differences.rst", _difference_table(films, views))
    with panels(images / "arrival.svg", 2, height=3.8) as (left, right):
        _draw_variances(left, films, views)
        _draw_ratios(right, films, views)
    with panels(images / "differences.svg", 2, height=3.8) as drawn:
        for panel, aperture in zip(drawn, sorted({film["aperture"] for film in films}), strict=True):
            _draw_differences(panel, aperture, films, views)


def _view(film: dict[str, Any]) -> View:
    scene = tomllib.loads(SCENE.read_text(encoding="utf-8"))
    air, grid, angle = scene["turbulence"], scene["grid"], film["pixel_angle"]
    box = tuple(grid[axis][1] - grid[axis][0] for axis in "xy")
    return View(
        length=scene["camera"]["focus_distance"], aperture=film["aperture"], inner_scale=air["inner_scale"],
        outer_scale=air["outer_scale"], side=film["tile"] * angle, blur=angle, cell=box[1] / grid["cells"][1],
        box=(box[0], box[1]),
    )  # fmt: skip


def _mean_variance(view: View) -> float:
    return (variance(view, 0) + variance(view, 1)) / 2


def _mean_difference(film: dict[str, Any], view: View) -> float:
    """Mean over all pairs of the row of tiles, and over both axes."""
    count = film["tiles"]
    apart = np.arange(1, count)
    angles = [float(view.side * n) for n in apart]
    values = [(difference(view, 0, angle) + difference(view, 1, angle)) / 2 for angle in angles]
    return float(np.average(values, weights=count - apart))


def _checked(films: list[dict[str, Any]], name: str, theory: list[float]) -> list[float]:
    """Measured over theory; the build fails where the films contradict theory, or the air that they show."""
    ratios = [film["quantities"][name][0] / one for film, one in zip(films, theory, strict=True)]
    for film in films:
        if abs(film["quantities"][name][0] / film["straight"][name] - 1) > SAME_AIR:
            raise AssertionError(f"validation fails: {name} of the film of seed {film['seed']}, same air")
    mean, error = _pooled(films, name, ratios)
    if abs(math.log(mean)) > error:
        raise AssertionError(f"validation fails: {name} of all films together")
    return ratios


def _row(film: dict[str, Any], name: str, expected: float, *others: str) -> tuple[str, ...]:
    value, low, high, _ = (SQUARE * one for one in film["quantities"][name])
    return (
        f"{film['cn2']:.0e}", f"{1e3 * film['aperture']:.0f} mm", *others, f"{SQUARE * expected:.4g}",
        f"{value:.4g}", f"{low:.4g} to {high:.4g}", f"{100 * (value / SQUARE / expected - 1):+.1f} %",
        f"{100 * (value / SQUARE / film['straight'][name] - 1):+.1f} %",
    )  # fmt: skip


def _arrival_table(films: list[dict[str, Any]], views: list[View]) -> str:
    theory = [film["cn2"] * _mean_variance(view) for film, view in zip(films, views, strict=True)]
    ratios = _checked(films, "variance", theory)
    rows = [
        _row(
            film, "variance", expected,
            f"{rytov_variance(film['cn2'], view.length, wave='spherical'):.1e}",
            f"{SQUARE * film['cn2'] * closed_form(view.length, view.aperture):.4g}",
        )
        for film, view, expected in zip(films, views, theory, strict=True)
    ]  # fmt: skip
    header = ("Cn² (m⁻²ᐟ³)", "aperture", "Rytov variance", "no scales (µrad²)", "expected (µrad²)",
              "obtained (µrad²)", "95 % interval", "deviation", "same air")  # fmt: skip
    return table(header, rows, (11, 10, 11, 12, 12, 12, 16, 11, 9)) + _together(films, "variance", ratios)


def _difference_table(films: list[dict[str, Any]], views: list[View]) -> str:
    theory = [film["cn2"] * _mean_difference(film, view) for film, view in zip(films, views, strict=True)]
    ratios = _checked(films, "difference", theory)
    rows = [_row(f, "difference", expected) for f, expected in zip(films, theory, strict=True)]
    header = ("Cn² (m⁻²ᐟ³)", "aperture", "expected (µrad²)", "obtained (µrad²)", "95 % interval", "deviation",
              "same air")  # fmt: skip
    return table(header, rows, (12, 11, 15, 15, 22, 12, 10)) + _together(films, "difference", ratios)


def _pooled(films: list[dict[str, Any]], name: str, ratios: list[float]) -> tuple[float, float]:
    """Mean ratio of all films, whose air is independent, and half the width of its interval in logarithm."""
    normal = norm.ppf(0.5 + LEVEL / 2)
    ends = [film["quantities"][name][1:3] for film in films]
    weights = np.array([(2 * normal / math.log(high / low)) ** 2 for low, high in ends])
    mean = float(np.average(np.log(ratios), weights=weights))
    return math.exp(mean), normal / math.sqrt(float(weights.sum()))


def _together(films: list[dict[str, Any]], name: str, ratios: list[float]) -> str:
    ends = [film["quantities"][name][:3] for film in films]
    inside = sum(low <= value / ratio <= high for (value, low, high), ratio in zip(ends, ratios, strict=True))
    mean, error = _pooled(films, name, ratios)
    low, high = mean * math.exp(-error), mean * math.exp(error)
    return (
        f"{inside} of {len(films)} intervals hold the expected value. All films together: "
        f"obtained over expected {mean:.3f}, 95 % interval {low:.3f} to {high:.3f}.\n"
    )


def _draw_variances(axes: Any, films: list[dict[str, Any]], views: list[View]) -> None:
    strengths = np.geomspace(5e-16, 2e-13, 20)
    for aperture, colour in _colours(films):
        view = next(view for view in views if view.aperture == aperture)
        axes.loglog(strengths, SQUARE * strengths * _mean_variance(view), color=colour, lw=1.4)
        simple = SQUARE * strengths * closed_form(view.length, aperture)
        axes.loglog(strengths, simple, color=colour, lw=0.9, ls=(0, (4, 3)))
        mine = [film for film in films if film["aperture"] == aperture]
        value, low, high = (
            SQUARE * np.array([film["quantities"]["variance"][i] for film in mine]) for i in range(3)
        )
        axes.errorbar(
            [film["cn2"] for film in mine], value, (value - low, high - value), fmt="o", color=colour, ms=4.5,
            capsize=2.5, label=f"{1e3 * aperture:.0f} mm",
        )  # fmt: skip
    axes.plot([], [], color=INK, lw=1.4, label="theory of what the film holds")
    axes.plot([], [], color=INK, lw=0.9, ls=(0, (4, 3)), label=r"$\frac{3}{8}\cdot 2.914\, C_n^2 L D^{-1/3}$")
    axes.set(xlabel=r"$C_n^2$ (m$^{-2/3}$)", ylabel="variance of the angle of arrival (µrad²)")
    axes.legend(frameon=False, fontsize=8.5)


def _draw_ratios(axes: Any, films: list[dict[str, Any]], views: list[View]) -> None:
    """Measured over theory, with intervals."""
    axes.axhline(1.0, color=INK, lw=1.0)
    for place, (film, view) in enumerate(zip(films, views, strict=True)):
        expected = film["cn2"] * _mean_variance(view)
        value, low, high, _ = (one / expected for one in film["quantities"]["variance"])
        colour = dict(_colours(films))[film["aperture"]]
        axes.errorbar(
            place, value, [[value - low], [high - value]], fmt="o", color=colour, ms=4.5, capsize=2.5
        )
        simple = closed_form(view.length, view.aperture) * film["cn2"] / expected
        axes.plot(place, simple, "_", color=INK, ms=14, label=None if place else "textbook, no outer scale")
    names = [f"{film['cn2']:.0e}\n{1e3 * film['aperture']:.0f} mm" for film in films]
    axes.set_xticks(range(len(films)), names, fontsize=8)
    axes.set(ylabel="measured / theory", ylim=(0.0, 2.2))
    axes.legend(frameon=False, fontsize=8.5, loc="upper left", ncols=2)


def _draw_differences(axes: Any, aperture: float, films: list[dict[str, Any]], views: list[View]) -> None:
    """Mean squared difference over Cn² against separation; all strengths together."""
    mine = [film for film in films if film["aperture"] == aperture]
    view = next(view for view in views if view.aperture == aperture)
    theta = view.side * np.arange(mine[0]["tiles"])
    for axis, name, colour in ((0, "along", RED), (1, "across", BLUE)):
        line = [SQUARE * COMMON * difference(view, axis, float(one)) for one in theta]
        axes.plot(1e3 * theta, line, color=colour, lw=1.4, label=f"{name}, theory")
        for film, marker in zip(mine, "os^", strict=True):
            points = SQUARE * np.array(film[name], dtype=float) * COMMON / film["cn2"]
            axes.plot(
                1e3 * np.array(film["separation"]), points, marker, color=colour, ms=4, alpha=0.8,
                label=f"$C_n^2$ = {film['cn2']:.0e}" if name == "across" else None,
            )  # fmt: skip
    axes.set(xlabel="separation (mrad)", ylabel=r"mean squared difference for $C_n^2 = 10^{-14}$ (µrad²)",
             title=f"aperture {1e3 * aperture:.0f} mm", ylim=(0, None), xlim=(0, None))  # fmt: skip
    axes.legend(frameon=False, fontsize=8)


def _colours(films: list[dict[str, Any]]) -> list[tuple[float, str]]:
    return list(zip(sorted({film["aperture"] for film in films}), (RED, BLUE), strict=True))
