"""The round Earth: its map, and its gravity."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nigemizu import InputError
from nigemizu.air import Earth

HEIGHTS = np.array([0.0, 1e-3, 2.0, 1500.0, 86e3])


def test_heights_go_there_and_back() -> None:
    earth = Earth()
    np.testing.assert_allclose(earth.height(earth.conformal_height(HEIGHTS)), HEIGHTS, rtol=1e-14)
    flat = Earth(flat=True)
    np.testing.assert_array_equal(flat.conformal_height(HEIGHTS), HEIGHTS)
    np.testing.assert_array_equal(flat.stretch(HEIGHTS), 1.0)


def test_the_map_is_conformal() -> None:
    """dh/dz, and r dφ/dx, are both the stretch: small shapes keep their angles."""
    earth, z, step = Earth(), np.array([10.0, 5e3, 80e3]), 1.0
    slope = (earth.height(z + step) - earth.height(z - step)) / (2 * step)
    np.testing.assert_allclose(slope, earth.stretch(z), rtol=1e-9)
    np.testing.assert_allclose((earth.radius + earth.height(z)) / earth.radius, earth.stretch(z), rtol=1e-14)


@pytest.mark.parametrize(("latitude", "gravity"), [(0.0, 9.7803253359), (45.0, 9.806199), (90.0, 9.8321849)])
def test_gravity_of_the_ellipsoid(latitude: float, gravity: float) -> None:
    """WGS 84 (NIMA TR8350.2, table 3.4): at the equator and the poles; at 45° by Somigliana's formula."""
    assert Earth(latitude=latitude).gravity(0.0) == pytest.approx(gravity, abs=2e-6)


def test_gravity_falls_with_height() -> None:
    """Free-air gradient at sea level, −3.086e-6 s⁻² (W. A. Heiskanen, H. Moritz, Physical Geodesy, 1967)."""
    earth = Earth()
    gradient = (earth.gravity(100.0) - earth.gravity(0.0)) / 100.0
    assert gradient == pytest.approx(-3.086e-6, rel=5e-3)
    assert earth.gravity(86e3) < 0.975 * earth.gravity(0.0)


def test_what_is_no_earth() -> None:
    for wrong in ({"radius": -1.0}, {"latitude": 100.0}, {"radius": math.nan}):
        with pytest.raises((InputError, ValueError)):
            Earth(**wrong)  # type: ignore[arg-type]
