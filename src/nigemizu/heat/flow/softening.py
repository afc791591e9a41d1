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
def add_softly(  # type: ignore[no-untyped-def]
    first, last, target, g, b, time, nu, molecular, over, least, wall, skip_x, skip_y, rdz, rdzf
):
    """Rows first…last − 1 of values at the height of the cells' centres, target += δ'.

    The diffusivity is `least` + (ν − `molecular`) · `over`; `time` is b Δt [s], `wall` the conductance [m/s]
    of the ground for what it holds fast.
    """
    nz, _, nx = g.shape
    c, d = np.zeros((nz + 1, nx)), np.zeros((nz + 1, nx))
    for j in range(max(first, skip_y), last):
        for k in range(nz):
            p = k + 2
            down, up = time * rdz[p] * rdzf[p], time * rdz[p] * rdzf[p + 1]
            if k == 0:
                down = 0.0
            if k == nz - 1:
                up = 0.0
            bottom = time * rdz[p] * wall if k == 0 else 0.0
            for i in range(nx):
                here = nu[p, j + 2, i + 2]
                lower = down * (least + (0.5 * (nu[p - 1, j + 2, i + 2] + here) - molecular) * over)
                upper = up * (least + (0.5 * (here + nu[p + 1, j + 2, i + 2]) - molecular) * over)
                pivot = 1.0 / (1.0 + bottom + lower + upper - lower * c[k, i])
                c[k + 1, i] = upper * pivot
                d[k + 1, i] = (b * g[k, j, i] + lower * d[k, i]) * pivot
        for k in range(nz - 1, -1, -1):
            for i in range(skip_x, nx):
                if k < nz - 1:
                    d[k + 1, i] += c[k + 1, i] * d[k + 2, i]
                target[k + 2, j + 2, i + 2] += d[k + 1, i]


@compiled(fastmath={"contract"})
def add_softly_on_faces(first, last, target, g, b, time, nu, rdz, rdzf):  # type: ignore[no-untyped-def]
    """The same of w, on lower faces: 2ν ∂w/∂z; the faces of ground and top do not move."""
    nz, _, nx = g.shape
    c, d = np.zeros((nz + 1, nx)), np.zeros((nz + 1, nx))
    for j in range(first, last):
        for i in range(nx):
            c[1, i] = d[1, i] = 0.0
        for k in range(1, nz):
            p = k + 2
            down, up = 2.0 * time * rdz[p - 1] * rdzf[p], 2.0 * time * rdz[p] * rdzf[p]
            for i in range(nx):
                lower, upper = down * nu[p - 1, j + 2, i + 2], up * nu[p, j + 2, i + 2]
                pivot = 1.0 / (1.0 + lower + upper - lower * c[k, i])
                c[k + 1, i] = upper * pivot
                d[k + 1, i] = (b * g[k, j, i] + lower * d[k, i]) * pivot
        for k in range(nz - 1, 0, -1):
            for i in range(nx):
                if k < nz - 1:
                    d[k + 1, i] += c[k + 1, i] * d[k + 2, i]
                target[k + 2, j + 2, i + 2] += d[k + 1, i]
