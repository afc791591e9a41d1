"""The cells of moving air on a device: the fields, and how a step puts stencils and columns together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import drjit as dr
import numpy as np

from nigemizu.heat.flow.cells import INSIDE, Cells, Fluxes, Frame, Velocity
from nigemizu.heat.flow.device.columns import Softness, soften, soften_faces
from nigemizu.heat.flow.device.lattice import Lattice, X, Y, Z
from nigemizu.heat.flow.device.pressure import DevicePoisson
from nigemizu.heat.flow.device.stencils import (
    Air,
    HeatLaw,
    eddy_viscosity,
    fastest,
    heat_change,
    momentum_change,
    outflow,
)
from nigemizu.heat.flow.padding import PAD, padded
from nigemizu.heat.flow.sources import Part

__all__ = ["DeviceCells"]


@final
class DeviceCells(Cells):
    """The fields in the memory of a device.

    Parameters
    ----------
    frame : Frame
    types : nigemizu.field.Types
        Double-precision array types of the device.

    Notes
    -----
    The laws of the ground are those of the processor: of each stage the lowest level goes there, and the
    fluxes through the ground come back. Values differ from those of `nigemizu.heat.flow.loops` by round-off,
    with which turbulent air drifts apart after some turnovers.

    Limits: one device; some twenty volumes of its memory. The kernels are compiled anew for each shape of the
    mesh and each set of constants, some seconds, and are kept on disk.
    """

    def __init__(self, frame: Frame, types: Any) -> None:
        super().__init__(frame)
        self._types = types
        self._lattice = Lattice(types, frame.grid.shape, self.metric)
        self._poisson = DevicePoisson(frame.grid, frame.walls, self._lattice)
        self._paddings = _paddings(self._lattice, frame)
        zeros = np.zeros(frame.grid.shape)
        self._increments = [types.Float(zeros.ravel()) for _ in range(4)]
        self._parts: dict[int, tuple[Part, Any, Any]] = {}
        self._nu = dr.full(types.Float, frame.flow.viscosity, self._lattice.padded)
        self.put((zeros, zeros, zeros), zeros)

    # ------------------------------------------------------------------ state
    @property
    def fields(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        u, v, w, warmth = (self._lattice.host(field) for field in self._fields)
        return u, v, w, warmth

    @property
    def viscosity(self) -> np.ndarray:
        return self._lattice.host(self._nu)

    def put(self, velocity: Velocity, warmth: np.ndarray) -> None:
        given = (*velocity, warmth)
        self._fill([self._types.Float(np.array(part, dtype=np.float64).ravel()) for part in given])

    def level(self, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        plane = self._lattice.plane
        first = (number % self._lattice.shape[0] + PAD) * plane
        places = dr.arange(self._types.UInt32, first, first + plane)
        u, v, _, warmth = self._fields
        taken = dr.concat([dr.gather(self._types.Float, field, places) for field in (u, v, warmth)])
        u, v, warmth = np.array(taken).reshape(3, *(count + 2 * PAD for count in self._lattice.shape[1:]))
        return u, v, warmth

    def divergence(self) -> np.ndarray:
        found = outflow(self._lattice, self._velocity)
        return np.array(found).reshape(self._lattice.shape)

    @property
    def _velocity(self) -> tuple[Any, Any, Any]:
        u, v, w, _ = self._fields
        return u, v, w

    # ------------------------------------------------------------------ steps
    def rates(self, lift: float, largest: float, upwards: bool) -> tuple[float, float, float]:
        flow, cells = self.frame.flow, self._lattice
        if flow.closure != "none":
            nu = eddy_viscosity(cells, self._velocity, flow.viscosity, flow.closure_constant)
            self._nu = self._paddings[-1].filled(nu)
        air = Air(self._velocity, self._fields[3], self._nu)
        found = dr.concat([dr.max(rate) for rate in fastest(cells, air, largest, upwards)])
        crossing, spreading, rise = (float(rate) for rate in np.array(found))
        return crossing, spreading, float(np.sqrt(lift * rise))

    def push(self, a: float, dt: float, low: Fluxes, high: Fluxes, lift: float, zero: float) -> None:
        cells, flow = self._lattice, self.frame.flow
        air = Air(self._velocity, self._fields[3], self._nu)
        lows, highs = self._planes(low), self._planes(high)
        old, step, lift, zero = (dr.opaque(self._types.Float, number) for number in (a, dt, lift, zero))
        rprt = 1 / flow.turbulent_prandtl if flow.closure == "vreman" else 0.0
        law = HeatLaw(self.frame.diffusivity, flow.viscosity, rprt, flow.advection == "limited")
        changes = (
            momentum_change(cells, air, X, lows[0], highs[0]),
            momentum_change(cells, air, Y, lows[1], highs[1]),
            momentum_change(cells, air, Z, None, None, lift, zero),
            heat_change(cells, air, law, lows[2], highs[2]),
        )
        self._increments = [
            old * before + step * change for before, change in zip(self._increments, changes, strict=True)
        ]
        dr.eval(self._increments)

    def release(self, parts: Sequence[tuple[Part, float]]) -> None:
        for part, time in parts:
            if id(part) not in self._parts:
                self._parts[id(part)] = self._sent(part)
            _, places, rate = self._parts[id(part)]
            step = dr.opaque(self._types.Float, time)
            dr.scatter_add(self._increments[part.field], step * rate, places)

    def add(self, b: float, time: float) -> None:
        flow, cells, nu = self.frame.flow, self._lattice, self._nu
        share, step = (dr.opaque(self._types.Float, number) for number in (b, time))
        if flow.closure == "none":
            grown = [share * increment for increment in self._increments]
        else:
            drag = 0.0 if flow.ground == "rough" else 2 * flow.viscosity * float(self.metric.rdz[PAD])
            held = 2 * self.frame.diffusivity * float(self.metric.rdz[PAD]) if self.frame.holds else 0.0
            momentum = Softness(flow.viscosity, 1.0, flow.viscosity, drag)
            heat = Softness(flow.viscosity, 1 / flow.turbulent_prandtl, self.frame.diffusivity, held)
            gu, gv, gw, gs = self._increments
            grown = [
                soften(cells, gu, share, step, nu, momentum),
                soften(cells, gv, share, step, nu, momentum),
                soften_faces(cells, gw, share, step, nu),
                soften(cells, gs, share, step, nu, heat),
            ]
            dr.eval(grown)
        self._fill([cells.at(field) + more for field, more in zip(self._fields, grown, strict=True)])

    def project(self) -> None:
        self._fill([*self._poisson.corrected(self._velocity), self._lattice.at(self._fields[3])])

    def keep_mean(self, axis: int, mean: float) -> None:
        cells = self._lattice
        inside = [cells.at(field) for field in self._fields]
        heights = cells.of_level(cells.dz)
        total = float(np.sum(self.frame.grid.z_widths)) * cells.shape[1] * cells.shape[2]
        inside[axis] += dr.opaque(self._types.Float, mean) - dr.sum(inside[axis] * heights) / total
        self._fill(inside)

    def _fill(self, inside: list[Any]) -> None:
        """Take values of the cells, and what is beyond them."""
        dr.eval(inside)
        pairs = zip(self._paddings, inside, strict=False)
        self._fields = [padding.filled(values) for padding, values in pairs]
        dr.eval(self._fields)

    def _planes(self, fluxes: Fluxes) -> list[Any]:
        return [self._types.Float(np.array(plane, dtype=np.float64).ravel()) for plane in fluxes]

    def _sent(self, part: Part) -> tuple[Part, Any, Any]:
        """A part on the device; it is kept itself so that no other one has its `id`."""
        return part, self._lattice.flat(part.place), self._types.Float(part.rate.ravel())


@final
class _Beyond:
    """From which cell, with which sign, and with which summand every place of a padded field is filled."""

    def __init__(self, types: Any, numbers: np.ndarray, summand: np.ndarray) -> None:
        self._types = types
        self._cell = types.UInt32(np.maximum(np.abs(numbers).ravel() - 1, 0).astype(np.uint32))
        self._sign = types.Float(np.sign(numbers).astype(np.float64).ravel())
        self._summand = types.Float(summand.ravel()) if np.any(summand) else None

    def filled(self, values: Any) -> Any:
        """The padded field for these values of the cells."""
        filled = dr.gather(self._types.Float, values, self._cell) * self._sign
        return filled if self._summand is None else filled + self._summand


def _paddings(cells: Lattice, frame: Frame) -> list[_Beyond]:
    """Of u, v, w, the warmth and the viscosity: read off what the processor's padding does to numbers."""
    results = []
    for number in (0, 1):
        fields = [padded(cells.shape) for _ in range(5)]
        for field in fields:
            field[INSIDE] = number * np.arange(1, cells.count + 1).reshape(cells.shape)
        frame.padding.fill(*fields[:4])
        frame.padding.fill_viscosity(fields[4])
        results.append(fields)
    return [
        _Beyond(cells.types, np.rint(numbers - summand).astype(np.int64), summand)
        for summand, numbers in zip(*results, strict=True)
    ]
