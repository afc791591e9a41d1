"""Compiled loops: transport by the wind and diffusion along x and y; diffusion of columns along z.

In the horizontal every level of the air moves on its own: it has one wind and one pair of diffusivities,
and it fits into the processor's cache, where all four passes are made before the next level is fetched.
Plain loops only: a slice assigned to a slice would make the first compilation twice as long.

Symbols: `c` Courant number left after whole cells (0 ≤ c < 1), `U`, `C`, `D` the cells upwind, at, and
downwind of a face's donor, `f` the value carried through the face.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

__all__ = ["compiled", "move_levels", "spread_columns", "spread_groups"]


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile without the interpreter's lock, and keep the machine code for the next process."""

    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return njit(cache=True, nogil=True, error_model="numpy", **options)(function)
        except RuntimeError:  # neither beside this file nor in a home is there a folder to keep it in
            return njit(nogil=True, error_model="numpy", **options)(function)

    return decorate


PAD = 3  # cells of padding on each side: the donor before the first cell, and two more


@compiled()
def _beyond(index, count, periodic, reflecting):  # type: ignore[no-untyped-def]
    """The cell that stands for `index` outside 0..count-1: wrapped, mirrored, or the outermost one."""
    if periodic:
        return index % count
    if reflecting:
        index = index % (2 * count)
        return index if index < count else 2 * count - 1 - index
    return min(max(index, 0), count - 1)


@compiled()
def _fill(source, padded, pad, shift, periodic, reflecting):  # type: ignore[no-untyped-def]
    """Copy a row, moved by `shift` cells, with `pad` cells of what lies beyond on each side."""
    count = source.size
    first = min(max(pad + shift, 0), count + 2 * pad)  # padded[m] holds source[m - pad - shift]
    last = min(max(first, pad + shift + count), count + 2 * pad)
    for m in range(first):
        padded[m] = source[_beyond(m - pad - shift, count, periodic, reflecting)]
    for m in range(first, last):
        padded[m] = source[m - pad - shift]
    for m in range(last, count + 2 * pad):
        padded[m] = source[_beyond(m - pad - shift, count, periodic, reflecting)]


@compiled()
def _face_flux(a, b, C, d, e, w, c, flux):  # type: ignore[no-untyped-def]
    """What leaves the donor cells `C` through their downwind face; `a`, `b` lie upwind, `d`, `e` downwind.

    The value that a quintic through the running sum of the cells gives, limited so that the next value of
    each cell lies between its old one and that of its upwind neighbour (Leonard 1991, for one constant
    Courant number).
    """
    room = 1.0 / c - 1.0
    for i in range(flux.size):
        centre = C[i]
        high = w[0] * a[i] + w[1] * b[i] + w[2] * centre + w[3] * d[i] + w[4] * e[i] - centre
        down = d[i] - centre
        up = (centre - b[i]) * room
        highest = max(0.0, min(down, up))
        lowest = min(0.0, max(down, up))
        flux[i] = c * (centre + min(highest, max(lowest, high)))


@compiled()
def _carry_x(source, target, shift, c, w, periodic, row, flux):  # type: ignore[no-untyped-def]
    ny, nx = source.shape
    for j in range(ny):
        _fill(source[j], row, PAD, shift, periodic, False)
        out = target[j]
        if c == 0.0:
            for i in range(nx):
                out[i] = row[i + PAD]
        else:
            n = nx + 1  # faces, the first one on the left of cell 0
            _face_flux(
                row[:n], row[1 : n + 1], row[2 : n + 2], row[3 : n + 3], row[4 : n + 4], w, c, flux[:n]
            )
            for i in range(nx):
                out[i] = row[i + PAD] - (flux[i + 1] - flux[i])


@compiled()
def _carry_y(source, target, shift, c, w, periodic, before, after):  # type: ignore[no-untyped-def]
    ny, nx = source.shape
    for j in range(-1, ny):
        rows = source[_beyond(j - shift, ny, periodic, False)]
        if c > 0.0:
            _face_flux(
                source[_beyond(j - shift - 2, ny, periodic, False)],
                source[_beyond(j - shift - 1, ny, periodic, False)],
                rows,
                source[_beyond(j - shift + 1, ny, periodic, False)],
                source[_beyond(j - shift + 2, ny, periodic, False)],
                w,
                c,
                after[:nx],
            )
        if j >= 0:
            out = target[j]
            if c > 0.0:
                for i in range(nx):
                    out[i] = rows[i] - (after[i] - before[i])
            else:
                for i in range(nx):
                    out[i] = rows[i]
        before, after = after, before


@compiled()
def _spread_x(source, target, half, weights, periodic, row):  # type: ignore[no-untyped-def]
    ny, nx = source.shape
    for j in range(ny):
        _fill(source[j], row, half, 0, periodic, True)
        out = target[j]
        for i in range(nx):
            out[i] = weights[0] * row[i + half]
        for k in range(1, half + 1):
            left, right, weight = row[half - k : half - k + nx], row[half + k : half + k + nx], weights[k]
            for i in range(nx):
                out[i] += weight * (left[i] + right[i])


@compiled()
def _spread_y(source, target, half, weights, periodic):  # type: ignore[no-untyped-def]
    ny, nx = source.shape
    for j in range(ny):
        out, middle = target[j], source[j]
        for i in range(nx):
            out[i] = weights[0] * middle[i]
        for k in range(1, half + 1):
            left = source[_beyond(j - k, ny, periodic, True)]
            right = source[_beyond(j + k, ny, periodic, True)]
            weight = weights[k]
            for i in range(nx):
                out[i] += weight * (left[i] + right[i])


@compiled()
def move_levels(  # type: ignore[no-untyped-def]
    air, first, stride, y_first, shifts, parts, carry_weights, halves, spread_weights, periodic
):
    """Move the levels ``first, first + stride, …`` of `air` in place.

    Parameters
    ----------
    air : (nz, ny, nx) float64, K
    first, stride : int
        Which levels.
    y_first : bool
        Whether y comes before x.
    shifts : (2, nz) int64
        Whole cells by which a level is carried along x and y.
    parts : (2, nz) float64
        Courant numbers that are left, 0 ≤ c < 1.
    carry_weights : (2, nz, 5) float64
        Weights of the cells about the donor for the value carried through a face.
    halves : (2, nz) int64
        Half-widths of the kernels of diffusion; 0 leaves the level alone.
    spread_weights : (2, nz, widest + 1) float64
        Kernels of diffusion, from the centre outwards.
    periodic : (2,) bool
        Periodic (True) or insulated along x and y.
    """
    nz, ny, nx = air.shape
    widest = max(PAD, spread_weights.shape[2] - 1)
    level = np.empty((ny, nx))
    row = np.empty(nx + 2 * widest)
    before, after = np.empty(nx + 1), np.empty(nx + 1)
    for k in range(first, nz, stride):
        source, target = air[k], level
        moved = False
        for axis in range(2):
            along = 1 - axis if y_first else axis
            shift, c = shifts[along, k], parts[along, k]
            if shift == 0 and c == 0.0:
                continue
            if along == 0:
                _carry_x(source, target, shift, c, carry_weights[0, k], periodic[0], row, before)
            else:
                _carry_y(source, target, shift, c, carry_weights[1, k], periodic[1], before, after)
            source, target, moved = target, source, not moved
        for axis in range(2):
            along = 1 - axis if y_first else axis
            half = halves[along, k]
            if half == 0:
                continue
            if along == 0:
                _spread_x(source, target, half, spread_weights[0, k], periodic[0], row)
            else:
                _spread_y(source, target, half, spread_weights[1, k], periodic[1])
            source, target, moved = target, source, not moved
        if moved:
            for j in range(ny):
                for i in range(nx):
                    target[j, i] = source[j, i]


BLOCK = 128  # columns that are treated together: a block of a hundred levels fits into the second cache


@njit(inline="always")
def _multiply_row(row, begin, end, levels, block, line, count):  # type: ignore[no-untyped-def]
    """One row of the matrix times the block, into `line`."""
    rows = row.size
    for m in range(count):
        line[m] = 0.0
    k = begin
    while k < rows:
        if k >= end and k < levels:
            k = levels  # on to the boundaries
            continue
        # four levels in one sweep over the columns
        if k + 4 <= end:
            w0, w1, w2, w3 = row[k], row[k + 1], row[k + 2], row[k + 3]
            for m in range(count):
                line[m] += (
                    w0 * block[k, m] + w1 * block[k + 1, m] + w2 * block[k + 2, m] + w3 * block[k + 3, m]
                )
            k += 4
        else:
            weight = row[k]
            if weight != 0.0:
                for m in range(count):
                    line[m] += weight * block[k, m]
            k += 1


@compiled(fastmath={"contract"})
def spread_columns(matrix, begins, ends, air, result, first, last):  # type: ignore[no-untyped-def]
    """Multiply the columns ``first … last - 1`` of `air` by `matrix`.

    A product of matrices of its own: it skips what is zero, and leaves no idle threads of a linear algebra
    library that compete with the other loops. ``contract`` lets a product and a sum round once instead of
    twice; no other freedom is given to the compiler.

    Parameters
    ----------
    matrix : (nz, nz + extra) float64
    begins, ends : (nz,) int64
        The first `nz` columns of row i of `matrix` vanish outside ``begins[i] … ends[i] - 1``.
    air : (nz + extra, columns) float64
    result : (at least nz, columns) float64
        Its first `nz` rows are written.
    first, last : int
    """
    levels, rows = matrix.shape
    block, line = np.empty((rows, BLOCK)), np.empty(BLOCK)
    for corner in range(first, last, BLOCK):
        count = min(BLOCK, last - corner)
        for k in range(rows):
            for m in range(count):
                block[k, m] = air[k, corner + m]
        for i in range(levels):
            _multiply_row(matrix[i], begins[i], ends[i], levels, block, line, count)
            for m in range(count):
                result[i, corner + m] = line[m]


@compiled(fastmath={"contract"})
def spread_groups(  # type: ignore[no-untyped-def]
    matrices, begins, ends, firsts, columns, weights, air, result, first, last
):
    """Multiply the columns ``first … last - 1`` of `air` by weighted means of several matrices.

    Parameters
    ----------
    matrices, begins, ends
        As for `spread_columns`, stacked along a first axis of n.
    firsts : (n + 1,) int64
        Matrix g is applied to the columns ``columns[firsts[g]] … columns[firsts[g + 1] - 1]``.
    columns : (entries,) int64
        All of them between `first` and ``last - 1``.
    weights : (entries,) float64
        With which the product counts; those of one column sum to one.
    air, result, first, last
        As for `spread_columns`.
    """
    groups, levels, rows = matrices.shape
    block, line = np.empty((rows, BLOCK)), np.empty(BLOCK)
    for i in range(levels):
        for column in range(first, last):
            result[i, column] = 0.0
    for g in range(groups):
        for corner in range(firsts[g], firsts[g + 1], BLOCK):
            count = min(BLOCK, firsts[g + 1] - corner)
            for k in range(rows):
                for m in range(count):
                    block[k, m] = air[k, columns[corner + m]]
            for i in range(levels):
                _multiply_row(matrices[g, i], begins[g, i], ends[g, i], levels, block, line, count)
                for m in range(count):
                    result[i, columns[corner + m]] += weights[corner + m] * line[m]
