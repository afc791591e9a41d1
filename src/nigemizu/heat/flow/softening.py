r"""Increments softened by vertical diffusion, so that thin cells do not shorten the steps.

A stage adds δ = b G. Where eddies mix across cells of a centimetre, diffusion over them is faster than
anything else in the air, and an explicit step has to follow it. Instead the increment solves

.. math:: (1 - b \Delta t\, \partial_z K \partial_z)\, \delta' = \delta,

column by column. Steady states, where δ = 0, stay what they were. The scheme is stable for any K Δt/Δz²:
with z = −λΔt ≥ 0 its amplification lies between −0.67 and 1, also with oscillations up to 1.2 per step. It is
of first order in what diffusion alone changes within a step.

Layout as in `nigemizu.heat.flow.momentum`; `c` and `d` hold what elimination leaves, level by level.
"""

from __future__ import annotations

import numpy as np

from nigemizu.heat.kernels import compiled

__all__ = ["add_softly", "add_softly_on_faces"]


@compiled(fastmath={"contract"})
def _conductances(p, j, nu, down, up, molecular, over, least, lower, upper):  # type: ignore[no-untyped-def]
    """Through the lower and the upper faces of a row of cells, over their heat."""
    for i in range(lower.size):
        here = nu[p, j + 2, i + 2]
        lower[i] = down * (least + (0.5 * (nu[p - 1, j + 2, i + 2] + here) - molecular) * over)
        upper[i] = up * (least + (0.5 * (here + nu[p + 1, j + 2, i + 2]) - molecular) * over)


@compiled(fastmath={"contract"})
def _eliminate(k, j, g, b, bottom, lower, upper, pivot, c, d):  # type: ignore[no-untyped-def]
    # two loops: a compiler that has to prove that six arrays do not overlap gives up
    for i in range(pivot.size):
        pivot[i] = 1.0 / (1.0 + bottom + lower[i] + upper[i] - lower[i] * c[k, i])
        c[k + 1, i] = upper[i] * pivot[i]
    for i in range(pivot.size):
        d[k + 1, i] = (b * g[k, j, i] + lower[i] * d[k, i]) * pivot[i]


@compiled(fastmath={"contract"})
def _put(k, j, target, c, d):  # type: ignore[no-untyped-def]
    """Put in what is known one level above, and add the increments."""
    for i in range(d.shape[1]):
        d[k + 1, i] += c[k + 1, i] * d[k + 2, i]
        target[k + 2, j + 2, i + 2] += d[k + 1, i]


@compiled(fastmath={"contract"})
def add_softly(  # type: ignore[no-untyped-def]
    first, last, target, g, b, time, nu, molecular, over, least, wall, rdz, rdzf
):
    """Rows first…last − 1 of values at the height of the cells' centres, target += δ'; also on walls.

    The diffusivity is `least` + (ν − `molecular`) · `over`; `time` is b Δt [s], `wall` the conductance [m/s]
    of the ground for what it holds fast.
    """
    nz, _, nx = g.shape
    c, d = np.zeros((nz + 2, nx)), np.zeros((nz + 2, nx))
    lower, upper, pivot = np.empty(nx), np.empty(nx), np.empty(nx)
    for j in range(first, last):
        for k in range(nz):
            p = k + 2
            down = time * rdz[p] * rdzf[p] if k > 0 else 0.0
            up = time * rdz[p] * rdzf[p + 1] if k < nz - 1 else 0.0
            bottom = time * rdz[p] * wall if k == 0 else 0.0
            _conductances(p, j, nu, down, up, molecular, over, least, lower, upper)
            _eliminate(k, j, g, b, bottom, lower, upper, pivot, c, d)
        for k in range(nz - 1, -1, -1):
            _put(k, j, target, c, d)


@compiled(fastmath={"contract"})
def _face_conductances(p, j, nu, down, up, lower, upper):  # type: ignore[no-untyped-def]
    for i in range(lower.size):
        lower[i] = down * nu[p - 1, j + 2, i + 2]
        upper[i] = up * nu[p, j + 2, i + 2]


@compiled(fastmath={"contract"})
def add_softly_on_faces(first, last, target, g, b, time, nu, rdz, rdzf):  # type: ignore[no-untyped-def]
    """The same of w, on lower faces: 2ν ∂w/∂z; the faces of ground and top do not move."""
    nz, _, nx = g.shape
    c, d = np.zeros((nz + 2, nx)), np.zeros((nz + 2, nx))
    lower, upper, pivot = np.empty(nx), np.empty(nx), np.empty(nx)
    for j in range(first, last):
        for i in range(nx):
            c[1, i] = d[1, i] = 0.0
        for k in range(1, nz):
            p = k + 2
            between = 2.0 * time * rdzf[p]
            _face_conductances(p, j, nu, between * rdz[p - 1], between * rdz[p], lower, upper)
            _eliminate(k, j, g, b, 0.0, lower, upper, pivot, c, d)
        for k in range(nz - 1, 0, -1):
            _put(k, j, target, c, d)
