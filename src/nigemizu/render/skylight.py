"""Compiled loops of the sky: bent lines of sight, light scattered once along them, light scattered often.

Symbols: `p`, `q` the ray's components n′ cos θ and n′ sin θ, `K` wavelengths, `sun` the table of what is left
of sunlight, by the height and by the Sun's elevation above the horizon of that height.
"""

from __future__ import annotations

import math

import numpy as np

from nigemizu.heat.kernels import compiled

__all__ = ["ESCAPED", "GROUNDED", "TRAPPED", "gather", "isotropic", "places", "shine", "sight"]

ESCAPED, GROUNDED, TRAPPED = 0, 1, 2
TURNS = 6  # after which a ray is in a duct

Z_SCALE, Z_GROWTH, X_SCALE = 300.0, 0.07, 15e3  # m, 1, m: over which what lights the air may change


@compiled()
def march(z, n2, eye, p2, s, down, node, share, length, height, sine):  # type: ignore[no-untyped-def]
    """Follow a ray from the eye through layers with n′² linear in z.

    Fills, layer by layer: `node` (the nodes a and b on its sides), `share` (weights of the quantities at a
    and b in the integral over σ), `length` (Δσ), `height` (mean z) and `sine` (mean q).

    Returns
    -------
    status, count
        How it ended, and the number of layers filled.
    last : float
        q at its end, negative at the ground.
    """
    top, cap = z.size - 1, node.shape[0]
    i, step, count, turns = eye, -1 if down else 1, 0, 0
    q = math.sqrt(s)
    while True:
        j = i + step
        if j > top:
            return ESCAPED, count, q
        if j < 0:
            return GROUNDED, count, -q
        if count == cap:
            return TRAPPED, count, q
        square = s + n2[j] - n2[eye]
        thickness = abs(z[j] - z[i])
        node[count, 0], node[count, 1] = i, j
        if square > 0.0:
            after = math.sqrt(square)
            total = q + after
            sigma = 2.0 * thickness / total
            far = sigma * (1.0 + q / total) / 3.0
            height[count] = 0.5 * (z[i] + z[j])
            sine[count] = step * 0.5 * total
            i, q = j, after
        else:  # to where it turns, and back
            fall = q * q - square
            sigma, part = 0.0, 0.0
            if fall > 0.0:
                sigma, part = 4.0 * q * thickness / fall, q * q / fall
            far = sigma * part * 2.0 / 3.0
            height[count] = z[i] + (z[j] - z[i]) * part * 2.0 / 3.0
            sine[count] = 0.0
            step, turns = -step, turns + 1
            if turns > TURNS:
                return TRAPPED, count, q
        length[count] = sigma
        share[count, 0], share[count, 1] = sigma - far, far
        count += 1


@compiled()
def places(z, n2, index, eye, radius, elevations):  # type: ignore[no-untyped-def]
    """Elevation (K, E) [rad] beyond the air against the eye's horizontal; NaN for what does not leave it.

    `n2` is (K, nz), `index` n′ (K,) at the eye.
    """
    cap = (TURNS + 1) * z.size
    node, share = np.empty((cap, 2), np.int64), np.empty((cap, 2))
    length, height, sine = np.empty(cap), np.empty(cap), np.empty(cap)
    found = np.empty((n2.shape[0], elevations.size))
    for k in range(n2.shape[0]):
        for e in range(elevations.size):
            p, q = index[k] * math.cos(elevations[e]), index[k] * math.sin(elevations[e])
            status, count, last = march(
                z, n2[k], eye, p * p, q * q, elevations[e] < 0.0, node, share, length, height, sine
            )
            sigma = 0.0
            for c in range(count):
                sigma += length[c]
            found[k, e] = math.atan2(last, p) - p * sigma / radius if status == ESCAPED else np.nan
    return found


@compiled()
def sight(z, n2, index, eye, elevations, molecules, aerosol, rest, count):  # type: ignore[no-untyped-def]
    """Cut lines of sight into pieces in which the light hardly changes.

    Parameters
    ----------
    z, n2 : (nz,) float64
        Heights in the map and n′² there; the eye is at one of them.
    index : float
        n′ at the eye.
    eye : int
    elevations : (E,) float64, rad
    molecules, aerosol, rest : (nz, K) float64
        n′ e^(z/R) times the coefficients of extinction: of molecules, aerosol, and what only absorbs.
    count : int
        M, pieces of each line of sight.

    Returns
    -------
    where : (E, M, 3) float64
        x [m], z [m] and elevation [rad] in the middle of what a piece scatters.
    depths : (E, M, 3, K) float64
        Optical depths of molecules, aerosol and the rest in each piece.
    status : (E,) int64
    """
    wide, many = molecules.shape[1], elevations.size
    cap = (TURNS + 1) * z.size
    node, share = np.empty((cap, 2), np.int64), np.empty((cap, 2))
    length, height, sine = np.empty(cap), np.empty(cap), np.empty(cap)
    where, depths = np.zeros((many, count, 3)), np.zeros((many, count, 3, wide))
    states = np.empty(many, np.int64)
    for e in range(many):
        p, q = index * math.cos(elevations[e]), index * math.sin(elevations[e])
        status, layers, _ = march(
            z, n2, eye, p * p, q * q, elevations[e] < 0.0, node, share, length, height, sine
        )
        states[e] = status
        whole = 0.0
        for c in range(layers):
            whole += length[c] * (abs(sine[c]) / (Z_SCALE + Z_GROWTH * height[c]) + p / X_SCALE)
        done, x, mass = 0.0, 0.0, 0.0
        piece = -1
        for c in range(layers):
            now = min(int(done / whole * count), count - 1) if whole > 0.0 else 0
            if now != piece:
                if piece >= 0 and mass > 0.0:
                    for part in range(3):
                        where[e, piece, part] /= mass
                piece, mass = now, 0.0
            done += length[c] * (abs(sine[c]) / (Z_SCALE + Z_GROWTH * height[c]) + p / X_SCALE)
            a, b, wa, wb = node[c, 0], node[c, 1], share[c, 0], share[c, 1]
            for k in range(wide):
                depths[e, piece, 0, k] += wa * molecules[a, k] + wb * molecules[b, k]
                depths[e, piece, 1, k] += wa * aerosol[a, k] + wb * aerosol[b, k]
                depths[e, piece, 2, k] += wa * rest[a, k] + wb * rest[b, k]
            k = wide // 2
            weight = wa * (molecules[a, k] + aerosol[a, k]) + wb * (molecules[b, k] + aerosol[b, k]) + 1e-300
            mass += weight
            where[e, piece, 0] += weight * (x + 0.5 * p * length[c])
            where[e, piece, 1] += weight * height[c]
            where[e, piece, 2] += weight * math.atan2(sine[c], p)
            x += p * length[c]
        if piece >= 0 and mass > 0.0:
            for part in range(3):
                where[e, piece, part] /= mass
    return where, depths, states


@compiled()
def shine(sun, first, per_node, scale, top, radius, h, sine, out):  # type: ignore[no-untyped-def]
    """Look up what is left of sunlight at height h [m] with the Sun's elevation given by its sine.

    `sun` is (heights, elevations, K): heights go with the square root of h, elevations above the geometric
    horizon with their area hyperbolic sine in units of `scale`.
    """
    h = min(max(h, 0.0), top)
    place = math.sqrt(h / top) * (sun.shape[0] - 1)
    i = min(int(place), sun.shape[0] - 2)
    v = place - i
    above = math.asin(min(max(sine, -1.0), 1.0)) + math.acos(radius / (radius + h))
    u = (math.asinh(above / scale) - first) * per_node
    if u <= 0.0:
        for k in range(out.size):
            out[k] = 0.0
        return
    j = min(int(u), sun.shape[1] - 2)
    w = min(u - j, 1.0)
    for k in range(out.size):
        low = sun[i, j, k] + w * (sun[i, j + 1, k] - sun[i, j, k])
        high = sun[i + 1, j, k] + w * (sun[i + 1, j + 1, k] - sun[i + 1, j, k])
        out[k] = low + v * (high - low)


@compiled()
def rayleigh(cosine, gamma):  # type: ignore[no-untyped-def]
    """Phase function [1/sr] of molecules; gamma = ρ/(2 − ρ) of the depolarisation ρ."""
    return (
        3.0 / (16.0 * math.pi * (1.0 + 2.0 * gamma)) * (1.0 + 3.0 * gamma + (1.0 - gamma) * cosine * cosine)
    )


@compiled()
def henyey(cosine, g):  # type: ignore[no-untyped-def]
    """Phase function [1/sr] of Henyey and Greenstein with the asymmetry g."""
    return (1.0 - g * g) / (4.0 * math.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)


@compiled()
def gather(  # type: ignore[no-untyped-def]
    where, depths, azimuths, elevation, albedo, g, gamma, sun, sun_grid, often, often_grid
):
    """Radiance (E, A, K) [1/sr, per irradiance of the Sun] along lines of sight that `sight` cut up.

    Parameters
    ----------
    azimuths : (A,) float64, rad
        From the Sun.
    elevation : float, rad
        Of the Sun, without air.
    albedo, g, gamma : float
        Of the aerosol: share scattered and asymmetry; of molecules as in `rayleigh`.
    sun : (heights, elevations, K) float64
        As for `shine`, with ``sun_grid = (first, per_node, scale, top, radius)``.
    often : (heights, elevations, K) float64
        Logarithm of the mean radiance [1/sr] of light that was scattered before, with ``often_grid = (first,
        per_node, scale)``: the Sun's elevation by its area hyperbolic sine.
    """
    many, pieces, wide = depths.shape[0], depths.shape[1], depths.shape[3]
    found = np.zeros((many, azimuths.size, wide))
    left, by_molecules, by_aerosol, light = np.empty(wide), np.empty(wide), np.empty(wide), np.empty(wide)
    first, per_node, scale, top, radius = sun_grid
    for e in range(many):
        for k in range(wide):
            left[k] = 1.0
        for m in range(pieces):
            for k in range(wide):
                molecules, particles = depths[e, m, 0, k], depths[e, m, 1, k]
                depth = molecules + particles + depths[e, m, 2, k]
                mean = -math.expm1(-depth) / depth if depth > 1e-12 else 1.0
                by_molecules[k] = left[k] * mean * molecules
                by_aerosol[k] = left[k] * mean * particles * albedo
                left[k] *= math.exp(-depth)
            x, z, own = where[e, m, 0], where[e, m, 1], where[e, m, 2]
            h = radius * math.expm1(z / radius)
            turn = x / radius
            place = math.sqrt(min(max(h, 0.0), top) / top) * (often.shape[0] - 1)
            i = min(int(place), often.shape[0] - 2)
            v = place - i
            for a in range(azimuths.size):
                # In the eye's frame: the Sun, and the vertical and the ray there.
                along = math.cos(elevation) * math.cos(azimuths[a])
                sine = math.sin(elevation) * math.cos(turn) + along * math.sin(turn)
                cosine = math.sin(elevation) * math.sin(own - turn) + along * math.cos(own - turn)
                shine(sun, first, per_node, scale, top, radius, h, sine, light)
                u = math.asinh(math.asin(min(max(sine, -1.0), 1.0)) / often_grid[2])
                u = min(max((u - often_grid[0]) * often_grid[1], 0.0), often.shape[1] - 1.0)
                j = min(int(u), often.shape[1] - 2)
                w = u - j
                once, twice = rayleigh(cosine, gamma), henyey(cosine, g)
                for k in range(wide):
                    low = often[i, j, k] + w * (often[i, j + 1, k] - often[i, j, k])
                    high = often[i + 1, j, k] + w * (often[i + 1, j + 1, k] - often[i + 1, j, k])
                    more = math.exp(low + v * (high - low))
                    found[e, a, k] += by_molecules[k] * (once * light[k] + more)
                    found[e, a, k] += by_aerosol[k] * (twice * light[k] + more)
    return found


@compiled()
def isotropic(  # type: ignore[no-untyped-def]
    heights, elevations, mu, mu_weight, phi, steps, column, ground, albedo, g, gamma, sun, sun_grid
):
    """Mean radiance (heights, elevations, K) [1/sr] of light that was scattered, in the manner of Hillaire.

    Parameters
    ----------
    heights : (H,) float64, m
    elevations : (S,) float64, rad
        Of the Sun.
    mu, mu_weight : (D,) float64
        Sines of the elevation of directions, and their weights, of sum 2.
    phi : (P,) float64, rad
        Their azimuths from the Sun, evenly spread over 0 to π.
    steps : int
        Along each of them.
    column : (N, 3, K) float64, 1/m
        Coefficients of molecules, aerosol and the rest at heights that go with a square root, as in `shine`.
    ground : float
        Its albedo.
    albedo, g, gamma, sun, sun_grid
        As for `gather`.
    """
    wide = sun.shape[2]
    first, per_node, scale, top, radius = sun_grid
    found = np.zeros((heights.size, elevations.size, wide))
    left, depth, light = np.empty(wide), np.empty(wide), np.empty(wide)
    by_molecules, by_aerosol, again = np.empty(wide), np.empty(wide), np.empty(wide)
    for i in range(heights.size):
        r = radius + heights[i]
        for k in range(wide):
            again[k] = 0.0
        for d in range(mu.size):
            # --- how far ---
            # Straight to the top, or to the ground: heights along the ray without losing digits.
            inner = r * r * mu[d] * mu[d] - heights[i] * (2.0 * radius + heights[i])
            lands = mu[d] < 0.0 and inner >= 0.0
            if lands:
                reach = heights[i] * (2.0 * radius + heights[i]) / (-r * mu[d] + math.sqrt(inner))
            else:
                gap = (top - heights[i]) * (2.0 * radius + top + heights[i])
                root = math.sqrt(r * r * mu[d] * mu[d] + gap)
                reach = gap / (r * mu[d] + root) if mu[d] > 0.0 else root - r * mu[d]
            flat = math.sqrt(1.0 - mu[d] * mu[d])
            for k in range(wide):
                left[k] = 1.0
            weight = mu_weight[d] / (2.0 * phi.size)
            for m in range(steps + 1):
                ends = m == steps
                if ends and not lands:
                    break
                begin, end = reach * (m / steps) ** 2, reach * ((m + 1) / steps) ** 2
                t = reach if ends else 0.5 * (begin + end)
                there = math.sqrt(r * r + 2.0 * r * mu[d] * t + t * t)
                h = heights[i] + (2.0 * r * mu[d] * t + t * t) / (there + r)
                # --- what the air scatters on the way ---
                if not ends:
                    place = math.sqrt(min(max(h, 0.0), top) / top) * (column.shape[0] - 1)
                    c = min(int(place), column.shape[0] - 2)
                    w = place - c
                    for k in range(wide):
                        one = (1.0 - w) * column[c, 0, k] + w * column[c + 1, 0, k]
                        two = (1.0 - w) * column[c, 1, k] + w * column[c + 1, 1, k]
                        three = (1.0 - w) * column[c, 2, k] + w * column[c + 1, 2, k]
                        depth[k] = (one + two + three) * (end - begin)
                        mean = -math.expm1(-depth[k]) / depth[k] if depth[k] > 1e-12 else 1.0
                        by_molecules[k] = left[k] * mean * one * (end - begin)
                        by_aerosol[k] = left[k] * mean * two * albedo * (end - begin)
                        again[k] += 0.5 * mu_weight[d] * (by_molecules[k] + by_aerosol[k])
                # --- what lights it ---
                for f in range(phi.size):
                    for s in range(elevations.size):
                        along = math.cos(elevations[s]) * math.cos(phi[f])
                        cosine = math.sin(elevations[s]) * mu[d] + along * flat
                        sine = (math.sin(elevations[s]) * (r + t * mu[d]) + along * t * flat) / there
                        if ends:
                            if sine > 0.0:
                                shine(sun, first, per_node, scale, top, radius, 0.0, sine, light)
                                for k in range(wide):
                                    found[i, s, k] += weight * left[k] * light[k] * sine * ground / math.pi
                            continue
                        shine(sun, first, per_node, scale, top, radius, h, sine, light)
                        once, twice = rayleigh(cosine, gamma), henyey(cosine, g)
                        for k in range(wide):
                            by = by_molecules[k] * once + by_aerosol[k] * twice
                            found[i, s, k] += weight * by * light[k]
                for k in range(wide):
                    left[k] *= math.exp(-depth[k])
        # --- again and again ---
        for s in range(elevations.size):
            for k in range(wide):
                found[i, s, k] /= 1.0 - again[k]
    return found
