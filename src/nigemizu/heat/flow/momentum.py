"""Compiled loops of the momentum: what carries it, what shears it, and buoyancy.

Arrays are padded by two cells on every side. Staggered (Arakawa's C): u on the left, v on the right-hand
(low y), w on the lower face of the cell of the same index; temperature, viscosity and pressure at its centre.
Every flux is computed once, row by row: what passes through the far face of a cell is kept for the next one.

Symbols: `rdx`, `rdy` 1/Δx, 1/Δy; `dz` heights of the cells, `rdz` 1/Δz; `rdzf` 1/distance between the centres
beside a lower face; `nu` viscosity at the centres; `a`, `dt` coefficients of a stage, G ← a G + dt N.

References
----------
R. W. C. P. Verstappen, A. E. P. Veldman (2003), Symmetry-preserving discretization of turbulent flow,
Journal of Computational Physics 187, 343–368, doi:10.1016/S0021-9991(03)00126-8: averages that conserve
energy on stretched meshes.
"""

from __future__ import annotations

import numpy as np

from nigemizu.heat.kernels import compiled

__all__ = ["balance", "cover", "push_u", "push_v", "push_w"]


@compiled(fastmath={"contract"})
def balance(k, j, g, a, dt, across, rows, near, below, above, rdx, rdy, rise):  # type: ignore[no-untyped-def]
    """G of a row: a G less dt times what leaves each cell.

    `across` (nx + 1,): through the faces along x; row `near` of `rows` (2, nx): through the near ones along
    y, the other row: through the far ones; `below`, `above` (ny, nx): along z.
    """
    nx, far = g.shape[2], 1 - near
    for i in range(nx):
        change = (across[i + 1] - across[i]) * rdx + (rows[far, i] - rows[near, i]) * rdy
        change += (above[j - 2, i] - below[j - 2, i]) * rise
        g[k - 2, j - 2, i] = a * g[k - 2, j - 2, i] - dt * change


@compiled(fastmath={"contract"})
def cover(plane, given):  # type: ignore[no-untyped-def]
    """Put the fluxes that are given at ground or top into a plane."""
    for j in range(given.shape[0]):
        for i in range(given.shape[1]):
            plane[j, i] = given[j, i]


# ---------------------------------------------------------------------- u


@compiled(fastmath={"contract"})
def _u_along_x(k, j, u, nu, rdx, across):  # type: ignore[no-untyped-def]
    """At the centres, from that of the cell before the first on."""
    for i in range(1, across.size + 1):
        mean = u[k, j, i] + u[k, j, i + 1]
        across[i - 1] = 0.25 * mean * mean - 2.0 * nu[k, j, i] * (u[k, j, i + 1] - u[k, j, i]) * rdx


@compiled(fastmath={"contract"})
def _u_along_y(k, j, u, v, nu, rdx, rdy, rows, row):  # type: ignore[no-untyped-def]
    for i in range(2, rows.shape[1] + 2):
        speed = v[k, j, i - 1] + v[k, j, i]
        eddies = nu[k, j - 1, i - 1] + nu[k, j - 1, i] + nu[k, j, i - 1] + nu[k, j, i]
        shear = (u[k, j, i] - u[k, j - 1, i]) * rdy + (v[k, j, i] - v[k, j, i - 1]) * rdx
        rows[row, i - 2] = 0.25 * (speed * (u[k, j - 1, i] + u[k, j, i]) - eddies * shear)


@compiled(fastmath={"contract"})
def _u_along_z(k, j, u, w, nu, rdx, rise, plane):  # type: ignore[no-untyped-def]
    for i in range(2, plane.shape[1] + 2):
        speed = w[k, j, i - 1] + w[k, j, i]
        eddies = nu[k - 1, j, i - 1] + nu[k - 1, j, i] + nu[k, j, i - 1] + nu[k, j, i]
        shear = (u[k, j, i] - u[k - 1, j, i]) * rise + (w[k, j, i] - w[k, j, i - 1]) * rdx
        plane[j - 2, i - 2] = 0.25 * (speed * (u[k - 1, j, i] + u[k, j, i]) - eddies * shear)


@compiled(fastmath={"contract"})
def push_u(first, last, u, v, w, nu, low, high, g, a, dt, rdx, rdy, rdz, rdzf):  # type: ignore[no-untyped-def]
    """Levels first…last − 1 of G of u; `low`, `high` (ny, nx): fluxes through the ground and the top."""
    ny, nx = low.shape
    top = u.shape[0] - 3
    across, rows = np.empty(nx + 1), np.empty((2, nx))
    below, above = np.empty((ny, nx)), np.empty((ny, nx))
    for j in range(2, ny + 2):
        _u_along_z(first + 2, j, u, w, nu, rdx, rdzf[first + 2], below)
    for k in range(first + 2, last + 2):
        if k == 2:
            cover(below, low)
        if k == top:
            cover(above, high)
        near = 0
        _u_along_y(k, 2, u, v, nu, rdx, rdy, rows, near)
        for j in range(2, ny + 2):
            _u_along_x(k, j, u, nu, rdx, across)
            _u_along_y(k, j + 1, u, v, nu, rdx, rdy, rows, 1 - near)
            if k < top:
                _u_along_z(k + 1, j, u, w, nu, rdx, rdzf[k + 1], above)
            balance(k, j, g, a, dt, across, rows, near, below, above, rdx, rdy, rdz[k])
            near = 1 - near
        below, above = above, below


# ---------------------------------------------------------------------- v


@compiled(fastmath={"contract"})
def _v_along_x(k, j, u, v, nu, rdx, rdy, across):  # type: ignore[no-untyped-def]
    for i in range(2, across.size + 2):
        speed = u[k, j - 1, i] + u[k, j, i]
        eddies = nu[k, j - 1, i - 1] + nu[k, j, i - 1] + nu[k, j - 1, i] + nu[k, j, i]
        shear = (v[k, j, i] - v[k, j, i - 1]) * rdx + (u[k, j, i] - u[k, j - 1, i]) * rdy
        across[i - 2] = 0.25 * (speed * (v[k, j, i - 1] + v[k, j, i]) - eddies * shear)


@compiled(fastmath={"contract"})
def _v_along_y(k, j, v, nu, rdy, rows, row):  # type: ignore[no-untyped-def]
    """At the centres of a row of cells."""
    for i in range(2, rows.shape[1] + 2):
        mean = v[k, j, i] + v[k, j + 1, i]
        stretch = (v[k, j + 1, i] - v[k, j, i]) * rdy
        rows[row, i - 2] = 0.25 * mean * mean - 2.0 * nu[k, j, i] * stretch


@compiled(fastmath={"contract"})
def _v_along_z(k, j, v, w, nu, rdy, rise, plane):  # type: ignore[no-untyped-def]
    for i in range(2, plane.shape[1] + 2):
        speed = w[k, j - 1, i] + w[k, j, i]
        eddies = nu[k - 1, j - 1, i] + nu[k - 1, j, i] + nu[k, j - 1, i] + nu[k, j, i]
        shear = (v[k, j, i] - v[k - 1, j, i]) * rise + (w[k, j, i] - w[k, j - 1, i]) * rdy
        plane[j - 2, i - 2] = 0.25 * (speed * (v[k - 1, j, i] + v[k, j, i]) - eddies * shear)


@compiled(fastmath={"contract"})
def push_v(first, last, u, v, w, nu, low, high, g, a, dt, rdx, rdy, rdz, rdzf):  # type: ignore[no-untyped-def]
    """The same of v."""
    ny, nx = low.shape
    top = v.shape[0] - 3
    across, rows = np.empty(nx + 1), np.empty((2, nx))
    below, above = np.empty((ny, nx)), np.empty((ny, nx))
    for j in range(2, ny + 2):
        _v_along_z(first + 2, j, v, w, nu, rdy, rdzf[first + 2], below)
    for k in range(first + 2, last + 2):
        if k == 2:
            cover(below, low)
        if k == top:
            cover(above, high)
        near = 0
        _v_along_y(k, 1, v, nu, rdy, rows, near)
        for j in range(2, ny + 2):
            _v_along_x(k, j, u, v, nu, rdx, rdy, across)
            _v_along_y(k, j, v, nu, rdy, rows, 1 - near)
            if k < top:
                _v_along_z(k + 1, j, v, w, nu, rdy, rdzf[k + 1], above)
            balance(k, j, g, a, dt, across, rows, near, below, above, rdx, rdy, rdz[k])
            near = 1 - near
        below, above = above, below


# ---------------------------------------------------------------------- w


@compiled(fastmath={"contract"})
def _w_along_x(k, j, u, w, nu, of_lower, of_upper, rdx, rise, across):  # type: ignore[no-untyped-def]
    for i in range(2, across.size + 2):
        speed = of_lower * u[k - 1, j, i] + of_upper * u[k, j, i]
        eddies = nu[k - 1, j, i - 1] + nu[k, j, i - 1] + nu[k - 1, j, i] + nu[k, j, i]
        shear = (w[k, j, i] - w[k, j, i - 1]) * rdx + (u[k, j, i] - u[k - 1, j, i]) * rise
        across[i - 2] = 0.5 * speed * (w[k, j, i - 1] + w[k, j, i]) - 0.25 * eddies * shear


@compiled(fastmath={"contract"})
def _w_along_y(k, j, v, w, nu, of_lower, of_upper, rdy, rise, rows, row):  # type: ignore[no-untyped-def]
    for i in range(2, rows.shape[1] + 2):
        speed = of_lower * v[k - 1, j, i] + of_upper * v[k, j, i]
        eddies = nu[k - 1, j - 1, i] + nu[k, j - 1, i] + nu[k - 1, j, i] + nu[k, j, i]
        shear = (w[k, j, i] - w[k, j - 1, i]) * rdy + (v[k, j, i] - v[k - 1, j, i]) * rise
        rows[row, i - 2] = 0.5 * speed * (w[k, j - 1, i] + w[k, j, i]) - 0.25 * eddies * shear


@compiled(fastmath={"contract"})
def _w_along_z(k, j, w, nu, rise, plane):  # type: ignore[no-untyped-def]
    """At the centres of a level of cells."""
    for i in range(2, plane.shape[1] + 2):
        mean = w[k, j, i] + w[k + 1, j, i]
        stretch = (w[k + 1, j, i] - w[k, j, i]) * rise
        plane[j - 2, i - 2] = 0.25 * mean * mean - 2.0 * nu[k, j, i] * stretch


@compiled(fastmath={"contract"})
def _lift(k, j, warmth, of_lower, of_upper, lift, zero, dt, g):  # type: ignore[no-untyped-def]
    # linear between the centres: each counts as the other's cell is high
    for i in range(g.shape[2]):
        warm = of_upper * warmth[k - 1, j, i + 2] + of_lower * warmth[k, j, i + 2] - zero
        g[k - 2, j - 2, i] += dt * lift * warm


@compiled(fastmath={"contract"})
def push_w(first, last, u, v, w, nu, warmth, lift, zero, g, a, dt, rdx, rdy, rdz, dz, rdzf):  # type: ignore[no-untyped-def]
    """Levels first…last − 1 of G of w, on lower faces (the ground's is left at 0).

    `warmth` − `zero` is the difference of temperature that lifts [K], `lift` g/T₀ [m/s²/K]. The volume of a
    face reaches from the middle of the cell below to that of the cell above.
    """
    _, ny, nx = g.shape
    start = max(first, 1) + 2
    across, rows = np.empty(nx + 1), np.empty((2, nx))
    below, above = np.empty((ny, nx)), np.empty((ny, nx))
    for j in range(2, ny + 2):
        _w_along_z(start - 1, j, w, nu, rdz[start - 1], below)
    for k in range(start, last + 2):
        rise = rdzf[k]
        of_lower, of_upper = 0.5 * dz[k - 1] * rise, 0.5 * dz[k] * rise
        near = 0
        _w_along_y(k, 2, v, w, nu, of_lower, of_upper, rdy, rise, rows, near)
        for j in range(2, ny + 2):
            _w_along_x(k, j, u, w, nu, of_lower, of_upper, rdx, rise, across)
            _w_along_y(k, j + 1, v, w, nu, of_lower, of_upper, rdy, rise, rows, 1 - near)
            _w_along_z(k, j, w, nu, rdz[k], above)
            balance(k, j, g, a, dt, across, rows, near, below, above, rdx, rdy, rise)
            _lift(k, j, warmth, of_lower, of_upper, lift, zero, dt, g)
            near = 1 - near
        below, above = above, below
