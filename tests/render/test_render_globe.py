"""From the flat map back to the round world: closed forms of spherical geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nigemizu import field, trace
from nigemizu.air import Earth

EARTH = Earth()
R = EARTH.radius


def _globe(eye: float, top: float = 86e3) -> object:
    from nigemizu.render.globe import Globe

    top = float(EARTH.conformal_height(top))
    return Globe(R, (0.0, 0.0, float(EARTH.conformal_height(eye))), top)


@pytest.mark.parametrize(
    ("x", "y", "height", "eye"), [(20e3, 0.0, 10.0, 0.0), (60e3, 30e3, 1e3, 50.0), (-5e3, 1e3, 0.0, 200.0)]
)
def test_places_are_seen_where_straight_light_comes_from(
    x: float, y: float, height: float, eye: float
) -> None:
    types = field.types("llvm", "double")
    seen = _globe(eye).towards(types.Array3f(x, y, float(EARTH.conformal_height(height))))  # type: ignore[attr-defined]
    distance = math.hypot(x, y)
    angle = distance / R
    ahead, up = (R + height) * math.sin(angle), (R + height) * math.cos(angle) - (R + eye)
    expected = np.array([ahead * x / distance, ahead * y / distance, up])
    np.testing.assert_allclose(np.asarray(seen)[:, 0], expected / np.linalg.norm(expected), atol=1e-12)


def test_without_air_light_is_straight_in_the_world_and_bent_in_the_map() -> None:
    """n′ of vacuum is e^(z/R): a ray that leaves it goes, in the eye's axes, the way that it set out."""
    types = field.types("llvm", "double")
    z = EARTH.conformal_height(np.linspace(0, 86e3, 1200))
    vacuum = field.StratifiedVolume([0.0], [0.0], z, np.expm1(z / R)[:, None, None], types, "extend")
    elevation = np.radians([0.01, 0.5, 10.0, 60.0])
    ahead = types.Array3f(*(types.Float(c) for c in (np.cos(elevation) * 0.6, np.cos(elevation) * 0.8,
                                                     np.sin(elevation))))  # fmt: skip
    end = trace.march(vacuum, types.Array3f(0, 0, 1.0), ahead, accuracy=1e-10, max_steps=10_000)
    outward = np.asarray(_globe(1.0).outward(end.position, end.direction))  # type: ignore[attr-defined]
    np.testing.assert_allclose(outward, np.asarray(ahead), atol=2e-9)
    # In the map itself it has turned by as much as the Earth has curved: a control.
    assert np.abs(np.asarray(end.direction)[2] - np.asarray(ahead)[2])[0] > 0.1


def test_refraction_of_an_exponential_sphere() -> None:
    """Bending of n = 1 + 2.9e-4 exp(−h/8 km) over 6371 km: quadratures that agree to 15 digits."""
    types = field.types("llvm", "double")
    parts = [
        np.arange(0, 400, 1.0),
        np.arange(400, 4e3, 5),
        np.arange(4e3, 3e4, 40),
        np.arange(3e4, 2.0001e5, 400),
    ]
    heights = np.unique(np.concatenate(parts))
    z, stretch = EARTH.conformal_height(heights), EARTH.stretch(EARTH.conformal_height(heights))
    mapped = 2.9e-4 * np.exp(-heights / 8000) * stretch + (stretch - 1)
    air = field.StratifiedVolume([0.0], [0.0], z, mapped[:, None, None], types, "extend")
    elevation = np.radians(90 - np.array([30, 60, 80, 89, 90]))
    ahead = types.Array3f(types.Float(np.cos(elevation)), 0, types.Float(np.sin(elevation)))
    end = trace.march(air, types.Array3f(0, 0, 1e-9), ahead, accuracy=1e-10, max_steps=20_000)
    outward = np.asarray(_globe(0.0, 2e5).outward(end.position, end.direction))  # type: ignore[attr-defined]
    bending = (elevation - np.arctan2(outward[2], outward[0])) * 206264.80624709636
    expected = [
        34.47928647314355,
        103.13641009317509,
        327.9245715598372,
        1579.4824037936658,
        2354.1229961355975,
    ]
    np.testing.assert_allclose(bending, expected, rtol=0, atol=1e-3)
