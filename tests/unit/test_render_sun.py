"""The Sun's and the Moon's light against published tables."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nigemizu.render import sun

NM = 1e-9

# H. Neckel, D. Labs, Sol. Phys. 153 (1994) 91, doi:10.1007/BF00712494, table 1: wavelength in nm,
# coefficients of μ⁰ … μ⁵ of I(μ)/I(1), and the mean of that over the disc.
MEASURED = np.array(
    [
        [401.970, 0.12323, 1.08648, -0.43974, 0.45912, -0.32759, 0.09850, 0.7303],
        [445.125, 0.15248, 1.38517, -1.49615, 1.99886, -1.48155, 0.44119, 0.7596],
        [457.345, 0.16604, 1.38544, -1.52275, 2.00232, -1.45969, 0.42864, 0.7651],
        [477.427, 0.19571, 1.30551, -1.25845, 1.50626, -1.05472, 0.30570, 0.7751],
        [519.930, 0.23695, 1.29927, -1.28034, 1.37760, -0.85054, 0.21706, 0.7925],
        [559.950, 0.26892, 1.34319, -1.58427, 1.91271, -1.31350, 0.37295, 0.8061],
        [610.975, 0.30854, 1.36620, -1.83572, 2.33221, -1.63082, 0.45959, 0.8221],
        [640.970, 0.33644, 1.30590, -1.79238, 2.45040, -1.89979, 0.59943, 0.8290],
        [700.875, 0.37885, 1.25553, -1.70908, 2.19647, -1.59554, 0.47378, 0.8434],
    ]
)


@pytest.mark.parametrize("row", MEASURED, ids=[f"{row[0]:.0f}" for row in MEASURED])
def test_limb_darkening_against_what_was_measured(row: np.ndarray) -> None:
    """The measurements scatter by 0.01 about the curves in the wavelength that were laid through them."""
    mu = np.linspace(0.1, 1, 91)
    measured = np.polynomial.polynomial.polyval(mu, row[1:7])
    shown = sun.limb_darkening(mu, row[0] * NM)[0]
    np.testing.assert_allclose(shown / shown[-1], measured, atol=0.01)
    assert 1 / shown[-1] == pytest.approx(row[7], abs=0.004)
    # the bound tells wavelengths 50 nm apart
    other = sun.limb_darkening(mu, (row[0] + 50) * NM)[0]
    assert np.abs(other / other[-1] - measured).max() > 0.012


def test_the_limb_is_redder_than_the_middle() -> None:
    """At μ = 0.3 blue light (445 nm) is fainter than red (641 nm), each over the middle, by 0.770.

    There the curves differ from single measurements by up to 0.9 % each: 2 % for the ratio of two.
    """
    measured = [np.polynomial.polynomial.polyval(0.3, MEASURED[row, 1:7]) for row in (1, 7)]
    shown = sun.limb_darkening([0.3, 1.0], MEASURED[[1, 7], 0] * NM)
    ratio = shown[:, 0] / shown[:, 1]
    assert ratio[0] / ratio[1] == pytest.approx(measured[0] / measured[1], rel=0.02)


def test_irradiance_between_400_and_700_nm() -> None:
    """530 W/m² to 540 W/m² outside the air, the figure of reference spectra, within 2 %."""
    light = np.arange(400, 700.05, 0.1)
    power = np.trapezoid(sun.solar_irradiance(light * NM), light)
    assert power == pytest.approx(535.0, rel=0.02)


def test_apparent_radii() -> None:
    """Sun 959.63″ (Auwers); Moon 932.6″ at 384 400 km with a radius of 1 737.4 km."""
    assert math.degrees(sun.SUN_RADIUS) * 3600 == pytest.approx(959.63, rel=1e-3)
    assert math.degrees(sun.MOON_RADIUS) * 3600 == pytest.approx(932.6, rel=2e-3)


def test_full_moon_of_a_usual_night() -> None:
    """0.10 at 450 nm to 0.14 at 650 nm, give or take 15 %, at 4° from opposition; redder than the Sun."""
    blue, red = sun.moon_radiance(np.array([450, 650]) * NM, math.radians(4.0))
    assert blue == pytest.approx(0.10, rel=0.15, abs=0)
    assert red == pytest.approx(0.14, rel=0.15, abs=0)
    assert 1.3 < red / blue < 1.6
