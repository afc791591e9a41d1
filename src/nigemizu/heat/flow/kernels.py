"""Compiled loops of the temperature, the eddy viscosity, the divergence and the step control.

Layout and symbols as in `nigemizu.heat.flow.momentum`; `rprt` 1 / turbulent Prandtl number, `kappa` molecular
diffusivity, `molecular` molecular viscosity.
"""

from __future__ import annotations

import numpy as np

from nigemizu.heat.flow.momentum import balance, cover
from nigemizu.heat.kernels import compiled

__all__ = ["add", "correct", "divergence", "eddy_viscosity", "fastest", "push_warmth", "solve_columns"]


@compiled(fastmath={"contract"})
def _carried(up2, up, down, limited):  # type: ignore[no-untyped-def]
    """Value at a face between `up` and `down`, with `up2` further upwind; Koren's limiter."""
    ahead, behind = down - up, up - up2
    if not limited:
        return up + 0.5 * ahead
    if ahead * behind <= 0.0:
        return up
    p, q = abs(ahead), abs(behind)
    step = min(2.0 * p, min((q + 2.0 * p) / 3.0, 2.0 * q))
    return up + (0.5 * step if ahead > 0.0 else -0.5 * step)


@compiled(fastmath={"contract"})
def _flux(s2, s1, s0, sm, speed, conductance, limited):  # type: ignore[no-untyped-def]
    """Through the face between s1, behind it, and s0; s2 lies behind s1, sm beyond s0."""
    carried = _carried(s2, s1, s0, limited) if speed > 0.0 else _carried(sm, s0, s1, limited)
    return speed * carried - conductance * (s0 - s1)


@compiled(fastmath={"contract"})
def _heat_along_x(k, j, s, u, nu, kappa, molecular, rprt, limited, rdx, across):  # type: ignore[no-untyped-def]
    for i in range(2, across.size + 2):
        c = kappa + (0.5 * (nu[k, j, i - 1] + nu[k, j, i]) - molecular) * rprt
        across[i - 2] = _flux(
            s[k, j, i - 2], s[k, j, i - 1], s[k, j, i], s[k, j, i + 1], u[k, j, i], c * rdx, limited
        )


@compiled(fastmath={"contract"})
def _heat_along_y(k, j, s, v, nu, kappa, molecular, rprt, limited, rdy, rows, row):  # type: ignore[no-untyped-def]
    for i in range(2, rows.shape[1] + 2):
        c = kappa + (0.5 * (nu[k, j - 1, i] + nu[k, j, i]) - molecular) * rprt
        rows[row, i - 2] = _flux(
            s[k, j - 2, i], s[k, j - 1, i], s[k, j, i], s[k, j + 1, i], v[k, j, i], c * rdy, limited
        )


@compiled(fastmath={"contract"})
def _heat_along_z(k, j, s, w, nu, kappa, molecular, rprt, limited, rise, plane):  # type: ignore[no-untyped-def]
    for i in range(2, plane.shape[1] + 2):
        c = kappa + (0.5 * (nu[k - 1, j, i] + nu[k, j, i]) - molecular) * rprt
        plane[j - 2, i - 2] = _flux(
            s[k - 2, j, i], s[k - 1, j, i], s[k, j, i], s[k + 1, j, i], w[k, j, i], c * rise, limited
        )


@compiled(fastmath={"contract"})
def push_warmth(  # type: ignore[no-untyped-def]
    first, last, u, v, w, s, nu, low, high, g, a, dt, kappa, molecular, rprt, limited, rdx, rdy, rdz, rdzf
):
    """Levels first…last − 1 of G of the temperature; `low`, `high` (ny, nx): fluxes through ground and top.

    References
    ----------
    B. Koren (1993), A robust upwind discretization method for advection, diffusion and source terms, in:
    Numerical Methods for Advection–Diffusion Problems, Vieweg, 117–138.
    """
    ny, nx = low.shape
    top = s.shape[0] - 3
    law = (kappa, molecular, rprt, limited)
    across, rows = np.empty(nx + 1), np.empty((2, nx))
    below, above = np.empty((ny, nx)), np.empty((ny, nx))
    for j in range(2, ny + 2):
        _heat_along_z(first + 2, j, s, w, nu, *law, rdzf[first + 2], below)
    for k in range(first + 2, last + 2):
        if k == 2:
            cover(below, low)
        if k == top:
            cover(above, high)
        near = 0
        _heat_along_y(k, 2, s, v, nu, *law, rdy, rows, near)
        for j in range(2, ny + 2):
            _heat_along_x(k, j, s, u, nu, *law, rdx, across)
            _heat_along_y(k, j + 1, s, v, nu, *law, rdy, rows, 1 - near)
            if k < top:
                _heat_along_z(k + 1, j, s, w, nu, *law, rdzf[k + 1], above)
            balance(k, j, g, a, dt, across, rows, near, below, above, rdx, rdy, rdz[k])
            near = 1 - near
        below, above = above, below


@compiled(fastmath={"contract"})
def add(first, last, target, g, b):  # type: ignore[no-untyped-def]
    """target += b G, also on walls."""
    _, ny, nx = g.shape
    for k in range(first, last):
        for j in range(ny):
            for i in range(nx):
                target[k + 2, j + 2, i + 2] += b * g[k, j, i]


@compiled(fastmath={"contract"})
def divergence(first, last, u, v, w, result, rdx, rdy, rdz):  # type: ignore[no-untyped-def]
    """Of the velocity, at the centres (nz, ny, nx)."""
    _, ny, nx = result.shape
    for k in range(first + 2, last + 2):
        for j in range(2, ny + 2):
            for i in range(2, nx + 2):
                result[k - 2, j - 2, i - 2] = (
                    (u[k, j, i + 1] - u[k, j, i]) * rdx
                    + (v[k, j + 1, i] - v[k, j, i]) * rdy
                    + (w[k + 1, j, i] - w[k, j, i]) * rdz[k]
                )


@compiled(fastmath={"contract"})
def correct(first, last, u, v, w, phi, rdx, rdy, rdzf):  # type: ignore[no-untyped-def]
    """Take the gradient of φ (nz, ny, nx), which is periodic, from the velocity; also on walls."""
    _, ny, nx = phi.shape
    for k in range(first, last):
        for j in range(ny):
            before = j - 1 if j > 0 else ny - 1
            for i in range(nx):
                v[k + 2, j + 2, i + 2] -= (phi[k, j, i] - phi[k, before, i]) * rdy
            u[k + 2, j + 2, 2] -= (phi[k, j, 0] - phi[k, j, nx - 1]) * rdx
            for i in range(1, nx):
                u[k + 2, j + 2, i + 2] -= (phi[k, j, i] - phi[k, j, i - 1]) * rdx
            if k > 0:
                rise = rdzf[k + 2]
                for i in range(nx):
                    w[k + 2, j + 2, i + 2] -= (phi[k, j, i] - phi[k - 1, j, i]) * rise


@compiled(fastmath={"contract"})
def eddy_viscosity(first, last, u, v, w, nu, molecular, constant, rdx, rdy, dz, rdz):  # type: ignore[no-untyped-def]
    """Viscosity at the centres with Vreman's eddies: ν + c √(B_β / α²) (his equations 5 to 8).

    Symbols: `a`ij = ∂u_j/∂x_i; `b`ij = Σₘ Δₘ² αₘᵢ αₘⱼ.
    """
    ny, nx = nu.shape[1] - 4, nu.shape[2] - 4
    dx2, dy2 = 1.0 / (rdx * rdx), 1.0 / (rdy * rdy)
    for k in range(first + 2, last + 2):
        dz2 = dz[k] * dz[k]
        over = 0.5 / (0.5 * dz[k - 1] + dz[k] + 0.5 * dz[k + 1])
        for j in range(2, ny + 2):
            for i in range(2, nx + 2):
                a11 = (u[k, j, i + 1] - u[k, j, i]) * rdx
                a22 = (v[k, j + 1, i] - v[k, j, i]) * rdy
                a33 = (w[k + 1, j, i] - w[k, j, i]) * rdz[k]
                a21 = 0.25 * rdy * (u[k, j + 1, i] + u[k, j + 1, i + 1] - u[k, j - 1, i] - u[k, j - 1, i + 1])
                a31 = over * (u[k + 1, j, i] + u[k + 1, j, i + 1] - u[k - 1, j, i] - u[k - 1, j, i + 1])
                a12 = 0.25 * rdx * (v[k, j, i + 1] + v[k, j + 1, i + 1] - v[k, j, i - 1] - v[k, j + 1, i - 1])
                a32 = over * (v[k + 1, j, i] + v[k + 1, j + 1, i] - v[k - 1, j, i] - v[k - 1, j + 1, i])
                a13 = 0.25 * rdx * (w[k, j, i + 1] + w[k + 1, j, i + 1] - w[k, j, i - 1] - w[k + 1, j, i - 1])
                a23 = 0.25 * rdy * (w[k, j + 1, i] + w[k + 1, j + 1, i] - w[k, j - 1, i] - w[k + 1, j - 1, i])
                b11 = dx2 * a11 * a11 + dy2 * a21 * a21 + dz2 * a31 * a31
                b22 = dx2 * a12 * a12 + dy2 * a22 * a22 + dz2 * a32 * a32
                b33 = dx2 * a13 * a13 + dy2 * a23 * a23 + dz2 * a33 * a33
                b12 = dx2 * a11 * a12 + dy2 * a21 * a22 + dz2 * a31 * a32
                b13 = dx2 * a11 * a13 + dy2 * a21 * a23 + dz2 * a31 * a33
                b23 = dx2 * a12 * a13 + dy2 * a22 * a23 + dz2 * a32 * a33
                b = b11 * b22 - b12 * b12 + b11 * b33 - b13 * b13 + b22 * b33 - b23 * b23
                size = a11 * a11 + a12 * a12 + a13 * a13 + a21 * a21 + a22 * a22 + a23 * a23
                size += a31 * a31 + a32 * a32 + a33 * a33
                eddies = 0.0
                if b > 0.0 and size > 1e-30:
                    eddies = constant * np.sqrt(b / size)
                nu[k, j, i] = molecular + eddies


@compiled(fastmath={"contract"})
def fastest(first, last, u, v, w, nu, s, lift, largest, upwards, rdx, rdy, rdz, rdzf):  # type: ignore[no-untyped-def]
    """Greatest rates [1/s] on the levels: of crossing cells, of diffusion across them, of buoyancy.

    `largest` is the diffusivity of heat or momentum in units of the viscosity, whichever is more; `upwards`
    counts diffusion along z, too.
    """
    ny, nx = nu.shape[1] - 4, nu.shape[2] - 4
    crossing, spreading, lifting = 0.0, 0.0, 0.0
    for k in range(first + 2, last + 2):
        room = 4.0 * (rdx * rdx + rdy * rdy) * largest
        if upwards:
            room += 4.0 * max(rdzf[k], rdzf[k + 1]) * rdz[k] * largest
        for j in range(2, ny + 2):
            for i in range(2, nx + 2):
                rate = max(abs(u[k, j, i]), abs(u[k, j, i + 1])) * rdx
                rate += max(abs(v[k, j, i]), abs(v[k, j + 1, i])) * rdy
                rate += max(abs(w[k, j, i]), abs(w[k + 1, j, i])) * rdz[k]
                crossing = max(crossing, rate)
                spreading = max(spreading, nu[k, j, i] * room)
                lifting = max(lifting, abs(s[k, j, i] - s[k - 1, j, i]) * rdzf[k])
    return crossing, spreading, np.sqrt(lift * lifting)


@compiled(fastmath={"contract"})
def solve_columns(first, last, modes, inverse, lower, upper):  # type: ignore[no-untyped-def]
    """Solve the tridiagonal systems of rows first…last − 1 of `modes` (nz, rows, columns), in place (Thomas).

    `inverse` holds the inverse pivots, `lower` and `upper` (nz,) the coefficients of the neighbours.
    """
    nz, _, columns = modes.shape
    for j in range(first, last):
        for m in range(columns):
            modes[0, j, m] *= inverse[0, j, m]
        for k in range(1, nz):
            here, before, pivot = modes[k, j], modes[k - 1, j], inverse[k, j]
            factor = lower[k]
            for m in range(columns):
                here[m] = (here[m] - factor * before[m]) * pivot[m]
        if j == 0:
            modes[nz - 1, 0, 0] = 0.0  # the mean along x and y is free by a constant
        for k in range(nz - 2, -1, -1):
            here, after, pivot = modes[k, j], modes[k + 1, j], inverse[k, j]
            factor = upper[k]
            for m in range(columns):
                here[m] -= factor * pivot[m] * after[m]
