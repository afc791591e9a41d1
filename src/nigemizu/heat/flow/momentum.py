"""Compiled loops of the momentum: what carries it, what shears it, and buoyancy.

Arrays are padded by two cells on every side. Staggered (Arakawa's C): u on the left, v on the right-hand
(low y), w on the lower face of the cell of the same index; temperature, viscosity and pressure at its centre.

Symbols: `rdx`, `rdy` 1/Δx, 1/Δy; `dz` heights of the cells, `rdz` 1/Δz; `rdzf` 1/distance between the centres
beside a lower face; `nu` viscosity at the centres; `a`, `dt` coefficients of a stage, G ← a G + dt N.

References
----------
R. W. C. P. Verstappen, A. E. P. Veldman (2003), Symmetry-preserving discretization of turbulent flow,
Journal of Computational Physics 187, 343–368, doi:10.1016/S0021-9991(03)00126-8: averages that conserve
energy on stretched meshes.
"""

from __future__ import annotations

from nigemizu.heat.kernels import compiled

__all__ = ["push_u", "push_v", "push_w"]


@compiled(fastmath={"contract"})
def push_u(first, last, u, v, w, nu, low, high, g, a, dt, rdx, rdy, rdz, rdzf):  # type: ignore[no-untyped-def]
    """Levels first…last − 1 of G of u; `low`, `high` (ny, nx): fluxes through the ground and the top."""
    ny, nx = low.shape
    top = u.shape[0] - 3
    below, above = low[0] * 0.0, low[0] * 0.0
    for k in range(first + 2, last + 2):
        for j in range(2, ny + 2):
            for i in range(2, nx + 2):
                below[i - 2] = 0.25 * (w[k, j, i - 1] + w[k, j, i]) * (u[k - 1, j, i] + u[k, j, i])
                below[i - 2] -= (
                    0.25
                    * (nu[k - 1, j, i - 1] + nu[k - 1, j, i] + nu[k, j, i - 1] + nu[k, j, i])
                    * ((u[k, j, i] - u[k - 1, j, i]) * rdzf[k] + (w[k, j, i] - w[k, j, i - 1]) * rdx)
                )
            for i in range(2, nx + 2):
                above[i - 2] = 0.25 * (w[k + 1, j, i - 1] + w[k + 1, j, i]) * (u[k, j, i] + u[k + 1, j, i])
                above[i - 2] -= (
                    0.25
                    * (nu[k, j, i - 1] + nu[k, j, i] + nu[k + 1, j, i - 1] + nu[k + 1, j, i])
                    * (
                        (u[k + 1, j, i] - u[k, j, i]) * rdzf[k + 1]
                        + (w[k + 1, j, i] - w[k + 1, j, i - 1]) * rdx
                    )
                )
            if k == 2:
                for i in range(nx):
                    below[i] = low[j - 2, i]
            if k == top:
                for i in range(nx):
                    above[i] = high[j - 2, i]
            for i in range(2, nx + 2):
                east = 0.25 * (u[k, j, i] + u[k, j, i + 1]) ** 2
                east -= 2.0 * nu[k, j, i] * (u[k, j, i + 1] - u[k, j, i]) * rdx
                west = 0.25 * (u[k, j, i - 1] + u[k, j, i]) ** 2
                west -= 2.0 * nu[k, j, i - 1] * (u[k, j, i] - u[k, j, i - 1]) * rdx
                north = 0.25 * (v[k, j + 1, i - 1] + v[k, j + 1, i]) * (u[k, j, i] + u[k, j + 1, i])
                north -= (
                    0.25
                    * (nu[k, j, i - 1] + nu[k, j, i] + nu[k, j + 1, i - 1] + nu[k, j + 1, i])
                    * ((u[k, j + 1, i] - u[k, j, i]) * rdy + (v[k, j + 1, i] - v[k, j + 1, i - 1]) * rdx)
                )
                south = 0.25 * (v[k, j, i - 1] + v[k, j, i]) * (u[k, j - 1, i] + u[k, j, i])
                south -= (
                    0.25
                    * (nu[k, j - 1, i - 1] + nu[k, j - 1, i] + nu[k, j, i - 1] + nu[k, j, i])
                    * ((u[k, j, i] - u[k, j - 1, i]) * rdy + (v[k, j, i] - v[k, j, i - 1]) * rdx)
                )
                change = (east - west) * rdx + (north - south) * rdy + (above[i - 2] - below[i - 2]) * rdz[k]
                g[k - 2, j - 2, i - 2] = a * g[k - 2, j - 2, i - 2] - dt * change


@compiled(fastmath={"contract"})
def push_v(first, last, u, v, w, nu, low, high, g, a, dt, rdx, rdy, rdz, rdzf):  # type: ignore[no-untyped-def]
    """The same of v."""
    ny, nx = low.shape
    top = v.shape[0] - 3
    below, above = low[0] * 0.0, low[0] * 0.0
    for k in range(first + 2, last + 2):
        for j in range(2, ny + 2):
            for i in range(2, nx + 2):
                below[i - 2] = 0.25 * (w[k, j - 1, i] + w[k, j, i]) * (v[k - 1, j, i] + v[k, j, i])
                below[i - 2] -= (
                    0.25
                    * (nu[k - 1, j - 1, i] + nu[k - 1, j, i] + nu[k, j - 1, i] + nu[k, j, i])
                    * ((v[k, j, i] - v[k - 1, j, i]) * rdzf[k] + (w[k, j, i] - w[k, j - 1, i]) * rdy)
                )
            for i in range(2, nx + 2):
                above[i - 2] = 0.25 * (w[k + 1, j - 1, i] + w[k + 1, j, i]) * (v[k, j, i] + v[k + 1, j, i])
                above[i - 2] -= (
                    0.25
                    * (nu[k, j - 1, i] + nu[k, j, i] + nu[k + 1, j - 1, i] + nu[k + 1, j, i])
                    * (
                        (v[k + 1, j, i] - v[k, j, i]) * rdzf[k + 1]
                        + (w[k + 1, j, i] - w[k + 1, j - 1, i]) * rdy
                    )
                )
            if k == 2:
                for i in range(nx):
                    below[i] = low[j - 2, i]
            if k == top:
                for i in range(nx):
                    above[i] = high[j - 2, i]
            for i in range(2, nx + 2):
                north = 0.25 * (v[k, j, i] + v[k, j + 1, i]) ** 2
                north -= 2.0 * nu[k, j, i] * (v[k, j + 1, i] - v[k, j, i]) * rdy
                south = 0.25 * (v[k, j - 1, i] + v[k, j, i]) ** 2
                south -= 2.0 * nu[k, j - 1, i] * (v[k, j, i] - v[k, j - 1, i]) * rdy
                east = 0.25 * (u[k, j - 1, i + 1] + u[k, j, i + 1]) * (v[k, j, i] + v[k, j, i + 1])
                east -= (
                    0.25
                    * (nu[k, j - 1, i] + nu[k, j, i] + nu[k, j - 1, i + 1] + nu[k, j, i + 1])
                    * ((v[k, j, i + 1] - v[k, j, i]) * rdx + (u[k, j, i + 1] - u[k, j - 1, i + 1]) * rdy)
                )
                west = 0.25 * (u[k, j - 1, i] + u[k, j, i]) * (v[k, j, i - 1] + v[k, j, i])
                west -= (
                    0.25
                    * (nu[k, j - 1, i - 1] + nu[k, j, i - 1] + nu[k, j - 1, i] + nu[k, j, i])
                    * ((v[k, j, i] - v[k, j, i - 1]) * rdx + (u[k, j, i] - u[k, j - 1, i]) * rdy)
                )
                change = (east - west) * rdx + (north - south) * rdy + (above[i - 2] - below[i - 2]) * rdz[k]
                g[k - 2, j - 2, i - 2] = a * g[k - 2, j - 2, i - 2] - dt * change


@compiled(fastmath={"contract"})
def push_w(first, last, u, v, w, nu, warmth, lift, zero, g, a, dt, rdx, rdy, dz, rdzf):  # type: ignore[no-untyped-def]
    """Levels first…last − 1 of G of w, on lower faces (the ground's is left at 0).

    `warmth` − `zero` is the difference of temperature that lifts [K], `lift` g/T₀ [m/s²/K]. The volume of a
    face reaches from the middle of the cell below to that of the cell above.
    """
    _, ny, nx = g.shape
    for k in range(max(first, 1) + 2, last + 2):
        of_lower, of_upper = 0.5 * dz[k - 1] * rdzf[k], 0.5 * dz[k] * rdzf[k]
        for j in range(2, ny + 2):
            for i in range(2, nx + 2):
                east = 0.5 * (of_lower * u[k - 1, j, i + 1] + of_upper * u[k, j, i + 1])
                east *= w[k, j, i] + w[k, j, i + 1]
                east -= (
                    0.25
                    * (nu[k - 1, j, i] + nu[k, j, i] + nu[k - 1, j, i + 1] + nu[k, j, i + 1])
                    * ((w[k, j, i + 1] - w[k, j, i]) * rdx + (u[k, j, i + 1] - u[k - 1, j, i + 1]) * rdzf[k])
                )
                west = 0.5 * (of_lower * u[k - 1, j, i] + of_upper * u[k, j, i])
                west *= w[k, j, i - 1] + w[k, j, i]
                west -= (
                    0.25
                    * (nu[k - 1, j, i - 1] + nu[k, j, i - 1] + nu[k - 1, j, i] + nu[k, j, i])
                    * ((w[k, j, i] - w[k, j, i - 1]) * rdx + (u[k, j, i] - u[k - 1, j, i]) * rdzf[k])
                )
                north = 0.5 * (of_lower * v[k - 1, j + 1, i] + of_upper * v[k, j + 1, i])
                north *= w[k, j, i] + w[k, j + 1, i]
                north -= (
                    0.25
                    * (nu[k - 1, j, i] + nu[k, j, i] + nu[k - 1, j + 1, i] + nu[k, j + 1, i])
                    * ((w[k, j + 1, i] - w[k, j, i]) * rdy + (v[k, j + 1, i] - v[k - 1, j + 1, i]) * rdzf[k])
                )
                south = 0.5 * (of_lower * v[k - 1, j, i] + of_upper * v[k, j, i])
                south *= w[k, j - 1, i] + w[k, j, i]
                south -= (
                    0.25
                    * (nu[k - 1, j - 1, i] + nu[k, j - 1, i] + nu[k - 1, j, i] + nu[k, j, i])
                    * ((w[k, j, i] - w[k, j - 1, i]) * rdy + (v[k, j, i] - v[k - 1, j, i]) * rdzf[k])
                )
                up = 0.25 * (w[k, j, i] + w[k + 1, j, i]) ** 2
                up -= 2.0 * nu[k, j, i] * (w[k + 1, j, i] - w[k, j, i]) / dz[k]
                down = 0.25 * (w[k - 1, j, i] + w[k, j, i]) ** 2
                down -= 2.0 * nu[k - 1, j, i] * (w[k, j, i] - w[k - 1, j, i]) / dz[k - 1]
                change = (east - west) * rdx + (north - south) * rdy + (up - down) * rdzf[k]
                # linear between the centres: each counts as the other's cell is high
                warm = of_upper * warmth[k - 1, j, i] + of_lower * warmth[k, j, i] - zero
                g[k - 2, j - 2, i - 2] = a * g[k - 2, j - 2, i - 2] + dt * (lift * warm - change)
