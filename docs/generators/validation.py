"""The table of numbers from elsewhere against what this version computes, run at each build."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from generators.flows import cavity, rolls
from generators.text import heading, table, write_if_changed
from nigemizu import air, field, heat, trace

__all__ = ["Case", "row_of", "write"]

ALPHA = 2.2e-5
"""Thermal diffusivity of the heat cases [m2/s]."""


@dataclass(frozen=True)
class Case:
    what: str
    source: str
    expected: float
    obtained: float
    allowed: float
    scale: float = 1.0
    unit: str = ""


def write(path: Path) -> None:
    text = ""
    for title, cases in (
        ("Refractive index of air", _refractivity()),
        ("Heat", _heat()),
        ("Moving air", _flows()),
        ("Rays", _rays()),
    ):
        # The page must never show a deviation that the tests would not allow.
        wrong = [case.what for case in cases if not abs(case.obtained - case.expected) <= case.allowed]
        if wrong:
            raise AssertionError(f"validation fails for {', '.join(wrong)}")
        rows = [row_of(case) for case in cases]
        header = ("case", "source", "expected", "obtained", "deviation", "allowed")
        text += heading(title, "-") + table(header, rows, (26, 26, 14, 14, 10, 10))
    write_if_changed(path, text)


def row_of(case: Case) -> tuple[str, ...]:
    unit = f" {case.unit}" if case.unit else ""
    return (
        case.what,
        case.source,
        f"{case.expected / case.scale:.10g}{unit}",
        f"{case.obtained / case.scale:.10g}{unit}",
        f"{(case.obtained - case.expected) / case.scale:+.1e}",
        f"{case.allowed / case.scale:.0e}",
    )


def _refractivity() -> list[Case]:
    ciddor = "Ciddor 1996, table {}"
    nist = "NIST Engineering Metrology Toolbox"
    # source, wavelength [m], °C, Pa, relative humidity, n − 1, allowed
    rows = [
        (ciddor.format(1), 633e-9, 20, 80000, 0.0, 21458.0e-8, 1e-9),
        (ciddor.format(1), 633e-9, 10, 100000, 0.0, 27774.7e-8, 1e-9),
        (ciddor.format(3), 633e-9, 40, 120000, 0.75, 29941.8e-8, 1e-9),
        (ciddor.format(3), 633e-9, 50, 120000, 1.0, 28792.4e-8, 1e-9),
        (nist, 633e-9, 20, 101325, 0.0, 271.8e-6, 1e-9),
        (nist, 633e-9, -40, 100000, 0.0, 337.58e-6, 1e-9),
        (nist, 300e-9, 40, 110000, 1.0, 289.0e-6, 1e-9),
        (nist, 1700e-9, 40, 110000, 1.0, 270.247e-6, 1e-9),
    ]
    cases = []
    for source, wavelength, celsius, pressure, humidity, expected, allowed in rows:
        obtained = air.refractivity(
            celsius + 273.15, pressure, relative_humidity=humidity, wavelength=wavelength
        )
        what = f"n − 1 at {celsius} °C, {pressure / 1000:g} kPa, {humidity:.0%}, {wavelength * 1e9:.0f} nm"
        cases.append(Case(what, source, expected, float(obtained), allowed, 1e-8, "× 10⁻⁸"))
    return cases


def _heat() -> list[Case]:
    still = heat.Diffusivity(molecular=ALPHA)
    deep = heat.Grid(np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.linspace(0.0, 0.6, 601))
    held = heat.HeldGround(temperature=330.0)
    cold = np.full(deep.shape, 300.0)
    states = list(heat.evolve(deep, cold, ground=held, times=[10.0, 60.0], diffusivity=still, time_step=0.05))
    source = "300 K + 30 K erfc(z / 2√(αt)) (Carslaw and Jaeger)"
    cases = []
    for z, state, expected in ((0.01, states[0], 319.00660426130503), (0.02, states[1], 320.9127483001789)):
        obtained = float(np.interp(z, deep.z, state.temperature[:, 0, 0]))
        what = f"half-space heated by 30 K, {100 * z:g} cm after {state.time:g} s"
        cases.append(Case(what, source, expected, obtained, 2e-2, unit="K"))
    length = 0.1
    slab = heat.Grid(np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.linspace(0.0, length, 201))
    cold = np.full(slab.shape, 300.0)
    (state,) = heat.evolve(
        slab,
        cold,
        ground=held,
        top=heat.Top(kind="held", temperature=300.0),
        times=[100.0],
        diffusivity=still,
        time_step=0.05,
    )
    obtained = float(np.interp(0.05, slab.z, state.temperature[:, 0, 0]))
    what = "slab of 10 cm between 330 K and 300 K, its middle after 100 s"
    cases.append(Case(what, "Fourier series and image sum", 312.82222938774044, obtained, 2e-3, unit="K"))
    return cases


def _flows() -> list[Case]:
    spectral = "spectral Newton iteration; {}"
    return [
        Case(
            "Nu of rolls, Ra = 10⁴, Pr = 0.71", spectral.format("Clever and Busse 1974 print 2.661"),
            2.652502, rolls(1e4), 0.0265,
        ),
        Case(
            "Nu of the heated cavity, Ra = 10⁴", spectral.format("de Vahl Davis 1983 prints 2.243"),
            2.244816, cavity(1e4), 0.0224,
        ),
    ]  # fmt: skip


def _rays() -> list[Case]:
    types = field.types("llvm", precision="double")
    cases = []
    # n² = 1.00027² − 5e-5 exp(−z / 5 cm), from 1.5 m at −2 mrad: the closed log-cosh ray.
    layer = field.ExponentialSquare(types, 1.00027**2, 5e-5, 0.05)
    for name, step, allowed in (("leapfrog", 0.5, 5e-6), ("suzuki4", 2.0, 1e-6)):
        end = trace.march(
            layer,
            types.Array3f(0.0, 0.0, 1.5),
            types.Array3f(math.cos(0.002), 0.0, -math.sin(0.002)),
            step=step,
            max_steps=10_000,
            stepper=trace.stepper_named(name),
            max_distance=1000.0,
        )
        # To first order in the slope, the height at x = 1000 m follows from the end of the path.
        x, z = end.position.x.numpy()[0], end.position.z.numpy()[0]
        dx, dz = end.direction.x.numpy()[0], end.direction.z.numpy()[0]
        obtained = float(z + (1000.0 - x) * dz / dx)
        what = f"height 1 km away of a ray that turned over a hot layer; {name}, step {step:g} m"
        cases.append(
            Case(
                what, "z = z_t + 2h ln cosh(…), closed form", 0.6138936891052358, obtained, allowed, unit="m"
            )
        )
    # Maxwell's fish-eye: a ray from (0.5, 0) meets its image at (−2, 0) after an optical path of π.
    angle = math.radians(60.0)
    end = trace.march(
        field.Fisheye(types),
        types.Array3f(0.5, 0.0, 0.0),
        types.Array3f(math.cos(angle), math.sin(angle), 0.0),
        step=0.005,
        max_steps=100_000,
        stepper=trace.SUZUKI4,
        max_distance=_fisheye_arc(),
    )
    x, y = end.position.x.numpy()[0], end.position.y.numpy()[0]
    off = math.hypot(float(x) + 2.0, float(y))
    cases.append(
        Case("distance from the image in Maxwell's fish-eye", "point (−2, 0), closed form", 0.0, off, 1e-6)
    )
    # Snell's law from 300 K down to ground 20 K hotter.
    hot, cold = (1.0 + float(air.refractivity(kelvin, 101325.0)) for kelvin in (320.0, 300.0))
    obtained = math.degrees(float(air.critical_angle(hot, cold))) * 60.0
    what = "flattest ray that still meets a road 20 K hotter than the air"
    cases.append(Case(what, "Snell's law with Ciddor's index", 19.87406403608685, obtained, 1e-6, unit="′"))
    return cases


def _fisheye_arc() -> float:
    """Length of the circular arc from (0.5, 0) to (−2, 0), about (−0.75, 0.7216878364870322)."""
    cx, cy = -0.75, 0.7216878364870322
    radius = math.hypot(0.5 - cx, cy)
    start, end = math.atan2(-cy, 0.5 - cx), math.atan2(-cy, -2.0 - cx)
    return radius * ((end - start) % (2.0 * math.pi))
