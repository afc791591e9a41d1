"""Moving air against linear theory and benchmarks; flows by ``make validation``, theory at each build."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eig

from generators.convection_runs import DATA
from generators.figures import BLUE, INK, RED, SAND, panels, plain
from generators.flows import CRITICAL_NUMBER, PRANDTL
from generators.text import table, write_if_changed

__all__ = ["write"]

CRITICAL = 1707.7617771047182
"""Chandrasekhar (1961); rigid plates."""

NUSSELT = {"rolls": 2.652502, 1e4: 2.244816, 1e5: 4.521636}
"""Spectral solutions, computed apart from this program."""


@dataclass(frozen=True)
class Row:
    what: str
    source: str
    expected: str
    obtained: str
    deviation: float
    allowed: float
    relative: bool = True

    def cells(self) -> tuple[str, ...]:
        if self.relative:
            shown = f"{100 * self.deviation:+.2f} %", f"{100 * self.allowed:g} %"
        else:
            shown = f"{self.deviation:+.1e}", f"{self.allowed:.0e}"
        return self.what, self.source, self.expected, self.obtained, *shown


def write(path: Path, figure: Path) -> None:
    data = json.loads(DATA.read_text(encoding="utf-8"))
    rows = [*_onset(data), *_heat_carried(data), *_kept(data)]
    if wrong := [row.what for row in rows if abs(row.deviation) > row.allowed]:
        raise AssertionError(f"validation fails for {', '.join(wrong)}")
    header = ("case", "source", "expected", "obtained", "deviation", "allowed")
    write_if_changed(path, table(header, [row.cells() for row in rows], (30, 28, 12, 12, 10, 8)))
    with panels(figure, 2, 2, height=3.4) as drawn:
        _draw_field(drawn[0], data["shown"]["rolls"], 2 * math.pi / 3.117, "rolls, Ra = 10⁴")
        _draw_field(drawn[1], data["shown"]["cavity"], 1.0, "cavity, Ra = 10⁵")
        _draw_growth(drawn[2], data)
        _draw_orders(drawn[3], data)


def growth_rate(rayleigh: float, number: float, points: int = 24) -> float:
    """Largest growth rate of exp(σt + iax) between rigid plates, in units of κ/h².

    σ ζ = Pr (D² − a²) ζ − Ra Pr a² θ, 0 = (D² − a²) w − ζ, σ θ = (D² − a²) θ + w, and w = Dw = θ = 0 at the
    plates. Chebyshev collocation.
    """
    k = np.arange(points + 1)
    x = np.cos(np.pi * k / points)
    c = np.where((k == 0) | (k == points), 2.0, 1.0) * (-1.0) ** k
    d = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(points + 1))
    d = 2 * (d - np.diag(d.sum(axis=1)))  # on a layer of height 1
    one, none = np.eye(points + 1), np.zeros((points + 1, points + 1))
    laplace = d @ d - number**2 * one
    curl = [PRANDTL * laplace, none, -rayleigh * PRANDTL * number**2 * one]
    lift, heat = [-one, laplace, none], [none, one, laplace]
    left = np.block([curl, lift, heat])
    right = np.block([[one, none, none], [none, none, none], [none, none, one]])
    n = points + 1
    for end in (0, points):
        # Dw = 0 in the place of the first equation, w = 0 of the second, θ = 0 of the third
        for row, column, values in ((0, n, d[end]), (n, n, one[end]), (2 * n, 2 * n, one[end])):
            left[row + end], right[row + end] = 0.0, 0.0
            left[row + end, column : column + n] = values
    values = eig(left, right, right=False)
    return float(np.max(values.real[np.isfinite(values) & (np.abs(values) < 1e6)]))


def _extrapolated(coarse: float, fine: float) -> float:
    """Of second order, on meshes one of which is twice as fine."""
    return fine + (fine - coarse) / 3


def _onset(data: dict[str, Any]) -> list[Row]:
    numbers = [number for number, *_ in data["growth"]]
    rates = [_extrapolated(coarse, fine) for _, coarse, fine in data["growth"]]
    theory = [growth_rate(number, CRITICAL_NUMBER) for number in numbers]
    # the rate is nearly straight in Ra: what it bends is taken from the theory
    bend = float(np.interp(0.0, theory, numbers)) - CRITICAL
    zero = float(np.interp(0.0, rates, numbers)) - bend
    rows = [
        Row("Rayleigh number at which rolls of the critical wavelength neither grow nor fade",
            "Chandrasekhar 1961", f"{CRITICAL:.2f}", f"{zero:.1f}", zero / CRITICAL - 1, 0.01)
    ]  # fmt: skip
    for number, rate, expected in zip(numbers, rates, theory, strict=True):
        if number in (numbers[0], numbers[-1]):
            rows.append(
                Row(f"growth rate there at Ra = {number:g}, in units of κ/h²", "linear theory",
                    f"{expected:.4f}", f"{rate:.4f}", rate - expected, 0.08, relative=False)
            )  # fmt: skip
    return rows


def _heat_carried(data: dict[str, Any]) -> list[Row]:
    coarse, fine = data["rolls"]["nusselt"][-2:]
    spectral = "spectral Newton iteration; {}"
    cases = [
        ("Nu of steady rolls, Ra = 10⁴, Pr = 0.71, wavelength 2π/3.117", "Clever and Busse 1974 print 2.661",
         NUSSELT["rolls"], _extrapolated(coarse, fine)),
    ]  # fmt: skip
    for one, words, printed in zip(data["cavities"], ("10⁴", "10⁵"), ("2.243", "4.519"), strict=True):
        coarse, fine = one["nusselt"][-2:]
        cases.append(
            (f"Nu of the heated cavity, Ra = {words}, Pr = 0.71", f"de Vahl Davis 1983 prints {printed}",
             NUSSELT[one["rayleigh"]], _extrapolated(coarse, fine))
        )  # fmt: skip
    return [
        Row(what, spectral.format(source), f"{expected:.4f}", f"{value:.4f}", value / expected - 1, 0.01)
        for what, source, expected, value in cases
    ]


def _kept(data: dict[str, Any]) -> list[Row]:
    kept = data["kept"]
    lost = kept["energy"]
    order = math.log2(lost[0] / lost[1]), math.log2(lost[1] / lost[2])
    orders = [
        math.log2(abs(nusselt[0] - nusselt[1]) / abs(nusselt[1] - nusselt[2]))
        for nusselt in (data["rolls"]["nusselt"], *(one["nusselt"] for one in data["cavities"]))
    ]
    names = ("rolls, Ra = 10⁴", "cavity, Ra = 10⁴", "cavity, Ra = 10⁵")
    return [
        Row("largest divergence of the velocity, in units of u/Δz", "none", "0", f"{kept['divergence']:.1e}",
            kept["divergence"], 1e-13, relative=False),
        Row("heat that an insulated box gains beyond what comes in", "none", "0", f"{kept['heat']:.1e}",
            kept["heat"], 1e-12, relative=False),
        Row("order in the step of the energy that inviscid air loses",
            "third: averages that keep the symmetry do no work (Verstappen and Veldman 2003)",
            "3", f"{order[1]:.2f}", order[1] - 3, 0.3, relative=False),
        *(Row(f"order of Nu in the cell, {name}", "second", "2", f"{found:.2f}", found - 2, 0.4, False)
          for name, found in zip(names, orders, strict=True)),
    ]  # fmt: skip


def _draw_field(axes: Any, temperature: list[list[float]], length: float, title: str) -> None:
    values = np.array(temperature)
    x = (np.arange(values.shape[1]) + 0.5) / values.shape[1] * length
    z = (np.arange(values.shape[0]) + 0.5) / values.shape[0]
    axes.contourf(x, z, values, levels=np.linspace(299.5, 300.5, 21), cmap="RdYlBu_r")
    axes.contour(x, z, values, levels=np.linspace(299.5, 300.5, 11), colors=INK, linewidths=0.5)
    axes.set(aspect="equal", xlabel="x / h", ylabel="z / h", title=title)


def _draw_growth(axes: Any, data: dict[str, Any]) -> None:
    numbers, at = np.linspace(1450, 2250, 15), [row[0] for row in data["growth"]]
    axes.plot(
        numbers,
        [growth_rate(one, CRITICAL_NUMBER) for one in numbers],
        color=INK,
        lw=1.4,
        label="linear theory",
    )
    for index, colour, marker in ((1, SAND, "s"), (2, BLUE, "o")):
        rates = [row[index] for row in data["growth"]]
        axes.plot(
            at, rates, marker, color=colour, ms=4, mfc="none", label=f"{data['levels'][index - 1]} levels"
        )
    best = [_extrapolated(coarse, fine) for _, coarse, fine in data["growth"]]
    axes.plot(at, best, "o", color=RED, ms=4.5, label="extrapolated")
    axes.axhline(0.0, color=INK, lw=0.6, alpha=0.5)
    axes.axvline(CRITICAL, color=INK, lw=0.6, ls=(0, (4, 3)))
    axes.set(xlabel="Rayleigh number", ylabel=r"growth rate ($\kappa/h^2$)", title="onset")
    axes.legend(frameon=False, fontsize=8)


def _draw_orders(axes: Any, data: dict[str, Any]) -> None:
    lines = [
        ("rolls, Ra = 10⁴", data["rolls"]["levels"], data["rolls"]["nusselt"], NUSSELT["rolls"], RED, "o")
    ]
    for one, words, colour, marker in zip(data["cavities"], ("10⁴", "10⁵"), (BLUE, SAND), "s^", strict=True):
        expected = NUSSELT[one["rayleigh"]]
        lines.append((f"cavity, Ra = {words}", one["cells"], one["nusselt"], expected, colour, marker))
    for name, counts, nusselt, expected, colour, marker in lines:
        error = np.abs(np.array(nusselt) / expected - 1)
        axes.loglog(1 / np.array(counts), error, marker + "-", color=colour, ms=4.5, lw=1.0, label=name)
    cell = np.array([0.018, 0.16])
    axes.loglog(cell, 2.0 * cell**2, color=INK, lw=0.9, ls=(0, (4, 3)), label="second order")
    axes.set(xlabel="cell / h", ylabel="relative error of Nu", title="order")
    plain(axes.xaxis)
    axes.legend(frameon=False, fontsize=8)
