"""The generated air against von Kármán, Kolmogorov and Taylor: computed at each build of the page."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import gamma, kv

from generators.figures import BLUE, INK, RED, SAND, panels, plain
from generators.text import table, write_if_changed
from nigemizu.heat import GridSpec, Wind
from nigemizu.heat.turbulence import Turbulence, TurbulentField

__all__ = ["write"]

INERTIAL = float(gamma(8 / 3)) * math.sin(math.pi / 3) / (4 * math.pi**2)
STRENGTH = 0.3
"""C_T² of all cases [K² m^(−2/3)]."""

TINY = 5e-4
"""Inner scale far below the cells [m]."""

INSTANTS, TOLERANCE, DEVIATIONS = 12, 0.015, 4.0


@dataclass(frozen=True)
class Row:
    """Independent samples of what theory gives as one number."""

    what: str
    source: str
    expected: float
    samples: np.ndarray
    unit: str
    tolerance: float = TOLERANCE

    @property
    def obtained(self) -> float:
        return float(np.mean(self.samples))

    @property
    def deviation(self) -> float:
        return self.obtained / self.expected - 1

    @property
    def allowed(self) -> float:
        scatter = float(np.std(self.samples, ddof=1)) / math.sqrt(self.samples.size)
        return DEVIATIONS * scatter / abs(self.expected) + self.tolerance


def write(path: Path, figure: Path) -> None:
    space, spectrum, lives, taylor = _space(), _spectrum(), _lives(), _taylor()
    rows = [*space["rows"], *spectrum["rows"], *taylor["rows"], *lives["rows"]]
    if wrong := [row.what for row in rows if abs(row.deviation) > row.allowed]:
        raise AssertionError(f"validation fails for {', '.join(wrong)}")
    cells = [
        (row.what, row.source, f"{row.expected:.4g} {row.unit}", f"{row.obtained:.4g} {row.unit}",
         f"{100 * row.deviation:+.1f} %", f"{100 * row.allowed:.1f} %")
        for row in rows
    ]  # fmt: skip
    header = ("case", "source", "expected", "obtained", "deviation", "allowed")
    write_if_changed(path, table(header, cells, (30, 24, 16, 16, 10, 10)))
    with panels(figure, 2, 2, height=3.4) as drawn:
        _draw_space(drawn[0], space)
        _draw_spectrum(drawn[1], spectrum)
        _draw_taylor(drawn[2], taylor)
        _draw_lives(drawn[3], lives)


def _field(grid: GridSpec, wind: Wind | None = None, **settings: Any) -> TurbulentField:
    # short-lived unless stated otherwise: instants far apart share nothing
    stated = {
        "ct2": STRENGTH,
        "exponent": 0.0,
        "inner_scale": TINY,
        "eddy_lifetime": 0.01,
        "seed": 5,
    } | settings
    return TurbulentField(grid.build(), Turbulence(**stated), wind)


def structure_function(r: np.ndarray | float, outer_scale: float) -> np.ndarray:
    """Von Kármán's, in closed form, less what the inner scale takes off at these distances [K²]."""
    k0 = 2 * math.pi / outer_scale
    variance = 2 * math.pi * INERTIAL * gamma(1.5) * gamma(1 / 3) / gamma(11 / 6) * k0 ** (-2 / 3)
    x = k0 * np.asarray(r)
    whole = 2 * variance * (1 - 2 ** (2 / 3) / gamma(1 / 3) * x ** (1 / 3) * kv(1 / 3, x))
    # 0.515 l0^(2/3)
    return np.asarray(STRENGTH * (whole - 12 * math.pi * INERTIAL * gamma(2 / 3) * (TINY / 5.91) ** (2 / 3)))


def _horizontal(kx: np.ndarray, ky: np.ndarray, outer_scale: float) -> np.ndarray:
    """The spectrum with all vertical wave numbers together [K² m²]."""
    constant = STRENGTH * INERTIAL * math.sqrt(math.pi) * gamma(4 / 3) / gamma(11 / 6)
    return np.asarray(constant * (kx**2 + ky**2 + (2 * math.pi / outer_scale) ** 2) ** (-4 / 3))


def _legendre(low: float, high: float, pieces: int) -> tuple[np.ndarray, np.ndarray]:
    nodes, weights = np.polynomial.legendre.leggauss(8)
    ends = np.linspace(low, high, pieces + 1)
    half, middle = np.diff(ends) / 2, (ends[1:] + ends[:-1]) / 2
    return (middle[:, None] + half[:, None] * nodes).ravel(), (half[:, None] * weights).ravel()


# --- structure function ---------------------------------------------------------------------------------


def _space() -> dict[str, Any]:
    grid = GridSpec(x=(0, 8), y=(0, 4), height=2.0, cells=(128, 128, 24), first_cell=0.02)
    field = _field(grid, outer_scale=1.0, unresolved="folded")
    heights, sides = field.grid.z, {"x": 8 / 128, "y": 4 / 128}
    volumes = [field.at(10.0 * number) for number in range(INSTANTS)]
    found: dict[str, list[tuple[float, np.ndarray]]] = {"x": [], "y": [], "z": []}
    for axis, number in (("x", 2), ("y", 1)):
        for cells in (1, 2, 4, 8, 16, 32):
            moved = [np.mean((np.roll(v, cells, number) - v) ** 2) for v in volumes]
            found[axis].append((cells * sides[axis], np.array(moved)))
    for low, high in ((0, 2), (0, 4), (3, 8), (5, 12), (4, 16), (2, 20)):
        apart = [np.mean((v[high] - v[low]) ** 2) for v in volumes]
        found["z"].append((heights[high] - heights[low], np.array(apart)))
    source = "von Kármán's closed form (Bessel function)"
    rows = [
        Row(f"mean squared difference {r:.3g} m apart along {axis}", source,
            float(structure_function(r, 1.0)), samples, "K²")
        for axis, index in (("x", 0), ("y", 2), ("x", 4), ("z", 1), ("z", 4))
        for r, samples in (found[axis][index],)
    ]  # fmt: skip
    return {"found": found, "rows": rows}


def _draw_space(axes: Any, space: dict[str, Any]) -> None:
    r = np.geomspace(0.015, 2.2, 200)
    axes.loglog(r, STRENGTH * r ** (2 / 3), color=INK, lw=0.9, ls=(0, (4, 3)), label=r"$C_T^2\, r^{2/3}$")
    axes.loglog(r, structure_function(r, 1.0), color=INK, lw=1.4, label="von Kármán")
    for (axis, points), colour, marker in zip(space["found"].items(), (BLUE, RED, SAND), "os^", strict=True):
        apart, samples = zip(*points, strict=True)
        axes.plot(apart, [one.mean() for one in samples], marker, color=colour, ms=4.5, label=f"along {axis}")
    axes.set(xlabel="distance (m)", ylabel="mean squared difference (K²)", title="structure function")
    plain(axes.xaxis, axes.yaxis)
    axes.legend(frameon=False, fontsize=8)


# --- spectrum -------------------------------------------------------------------------------------------


def _spectrum() -> dict[str, Any]:
    length, width, outer = 25.6, 6.4, 4.0
    grid = GridSpec(x=(0, length), y=(0, width), height=0.2, cells=(1024, 256, 1))
    field = _field(grid, outer_scale=outer)
    k = 2 * math.pi / length * np.arange(1, 500)
    powers = np.array([
        np.mean(np.abs(np.fft.rfft(field.at(10.0 * n), axis=2)) ** 2, axis=(0, 1))[1:500]
        for n in range(INSTANTS)
    ])  # fmt: skip
    powers *= length / (2 * math.pi) / 1024**2
    ky, weights = _legendre(0, math.pi / width * 255, 40)
    theory = 2 * _horizontal(k[:, None], ky, outer) @ weights
    inertial = (k > 10) & (k < 30)
    slopes = np.array([np.polyfit(np.log(k[inertial]), np.log(p[inertial]), 1)[0] for p in powers])
    slope = float(np.polyfit(np.log(k[inertial]), np.log(theory[inertial]), 1)[0])
    rows = [
        Row("slope of the spectrum along x, 10 to 30 m⁻¹",
            "−5/3, with the outer scale and without the eddies that have no room along y", slope, slopes, ""),
        Row("power along x, 10 to 30 m⁻¹", "von Kármán, as above", float(theory[inertial].sum()),
            powers[:, inertial].sum(axis=1), "K² m"),
    ]  # fmt: skip
    return {"k": k, "power": powers.mean(axis=0), "theory": theory, "rows": rows}


def _draw_spectrum(axes: Any, spectrum: dict[str, Any]) -> None:
    k = spectrum["k"]
    axes.loglog(k, spectrum["power"], ".", color=BLUE, ms=2.5, label="of the field")
    axes.loglog(k, spectrum["theory"], color=INK, lw=1.4, label="von Kármán")
    shown = (k > 8) & (k < 90)
    slope = 1.6 * spectrum["theory"][shown][0] * (k[shown] / k[shown][0]) ** (-5 / 3)
    axes.loglog(k[shown], slope, color=RED, lw=0.9, ls=(0, (4, 3)), label=r"$k^{-5/3}$")
    axes.set(xlabel="wave number along x (1/m)", ylabel="power (K² m)", title="spectrum")
    axes.legend(frameon=False, fontsize=8)


# --- time -----------------------------------------------------------------------------------------------


def _taylor() -> dict[str, Any]:
    """Differences in time at one place, under a wind, against differences in space."""
    speed, outer = 2.0, 1.0
    grid = GridSpec(x=(0, 8), y=(0, 4), height=0.2, cells=(256, 127, 1))
    kx, weights_x = _legendre(0, math.pi / 8 * 255, 60)
    ky, weights_y = _legendre(0, math.pi / 4 * 127, 40)
    spectrum = 8 * _horizontal(kx[:, None], ky, outer) * weights_x[:, None] * weights_y
    lags, curve = np.array([0.01, 0.02, 0.04, 0.08, 0.16, 0.32]), np.geomspace(0.008, 0.4, 40)
    theory, line = (
        np.array([np.sum(spectrum * (1 - np.cos(kx * speed * lag))[:, None]) for lag in at])
        for at in (lags, curve)
    )
    found = {}
    for name, lifetime in (("frozen", 1e3), ("living", 0.05)):
        field = _field(grid, Wind(speed=speed), outer_scale=outer, eddy_lifetime=lifetime)
        starts = [field.at(50.0 * number) for number in range(INSTANTS)]
        found[name] = np.array(
            [
                [np.mean((field.at(50.0 * n + lag) - start) ** 2) for lag in lags]
                for n, start in enumerate(starts)
            ]
        )
    rows = [
        Row(f"difference at one place after {lags[i]:g} s, wind {speed:g} m/s", "Taylor: that of places"
            f" {speed * lags[i]:g} m apart", float(theory[i]), found["frozen"][:, i], "K²", 0.03)
        for i in (1, 3)
    ]  # fmt: skip
    return {"lags": lags, "curve": curve, "line": line, "found": found, "rows": rows}


def _draw_taylor(axes: Any, taylor: dict[str, Any]) -> None:
    lags = taylor["lags"]
    axes.loglog(taylor["curve"], taylor["line"], color=INK, lw=1.4, label="in space, r = U τ")
    styles = (("frozen", BLUE, "o", "eddies that live long"), ("living", RED, "s", "lifetime 0.05 s at 1 m"))
    for name, colour, marker, words in styles:
        axes.plot(lags, taylor["found"][name].mean(axis=0), marker, color=colour, ms=4.5, label=words)
    axes.set(xlabel="lag τ (s)", ylabel="mean squared difference (K²)", title="in time, wind of 2 m/s")
    plain(axes.xaxis, axes.yaxis)
    axes.legend(frameon=False, fontsize=8)


def _lives() -> dict[str, Any]:
    """Integral time scales of eddies by size, in still air."""
    grid = GridSpec(x=(0, 8), y=(0, 4), height=2.0, cells=(64, 33, 4))
    stated = 2.0
    field = _field(grid, outer_scale=1.0, eddy_lifetime=stated)
    kx, ky = 2 * math.pi / 8 * np.fft.fftfreq(64, 1 / 64), 2 * math.pi / 4 * np.fft.fftfreq(33, 1 / 33)
    k = np.hypot(kx, ky[:, None])
    points, rows = [], []
    for low, high in ((4.0, 6.0), (7.0, 10.0), (14.0, 18.0)):
        chosen = (k > low) & (k < high)
        typical = float(np.mean(k[chosen]))
        theory = stated * float(np.mean((2 * math.pi / k[chosen]) ** (2 / 3)))
        lags = np.linspace(0, 3.2 * theory, 13)
        integrals = []
        for number in range(3 * INSTANTS):
            start = 11.3 * theory * number
            waves = [np.fft.fft2(field.at(start + lag))[:, chosen] for lag in lags]
            along = [np.mean((waves[0].conj() * one).real) for one in waves]
            integrals.append(np.trapezoid(along, lags) / along[0])
        samples = np.array(integrals)
        points.append((typical, samples))
        what = f"integral time of eddies of {2 * math.pi / typical:.2g} m"
        rows.append(Row(what, "lifetime · wavelength^(2/3), Kolmogorov", theory, samples, "s", 0.06))
    return {"points": points, "rows": rows, "stated": stated}


def _draw_lives(axes: Any, lives: dict[str, Any]) -> None:
    k = np.geomspace(3, 25, 50)
    axes.loglog(
        k, lives["stated"] * (2 * math.pi / k) ** (2 / 3), color=INK, lw=1.4, label=r"$\tau \propto k^{-2/3}$"
    )
    for typical, samples in lives["points"]:
        error = 2 * samples.std(ddof=1) / math.sqrt(samples.size)
        axes.errorbar(typical, samples.mean(), error, fmt="o", color=BLUE, ms=4.5, capsize=2)
    axes.set(xlabel="wave number (1/m)", ylabel="integral time (s)", title="lifetime of eddies")
    plain(axes.xaxis, axes.yaxis)
    axes.legend(frameon=False, fontsize=8)
