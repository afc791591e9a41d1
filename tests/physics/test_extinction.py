"""What air takes from light, against published figures."""

from __future__ import annotations

import numpy as np
import pytest

from nigemizu import InputError
from nigemizu.air.extinction import (
    Extinction,
    depolarisation,
    ozone_cross_section,
    rayleigh_cross_section,
    rayleigh_optical_depth,
)

NM = 1e-9


def test_rayleigh_optical_depth_of_a_column() -> None:
    """Bodhaine et al. (1999), table 3: sea level, 45° N, 1013.25 mb, 360 ppm of CO₂."""
    wavelength = np.array([350, 400, 450, 500, 550, 600, 650, 700, 750, 800, 850]) * NM
    published = [0.63031, 0.36022, 0.22111, 0.14336, 0.09707, 0.06809, 0.04919, 0.03642, 0.02755, 0.02123]
    published.append(0.01662)
    depth = rayleigh_optical_depth(wavelength)
    np.testing.assert_allclose(depth, published, rtol=0, atol=1e-5)
    # the power law λ⁻⁴, without the dispersion of n and of King's factor, is off by up to 0.04
    assert np.abs(depth[4] * (wavelength / wavelength[4]) ** -4.0 - published).max() > 0.01
    # the bound tells the latitude, and gravity at the sea from that at the centre of mass
    for other in ({"latitude": 0.0}, {"altitude": 1000.0}, {"co2_fraction": 0.002}):
        assert np.abs(rayleigh_optical_depth(wavelength, **other) - published).max() > 5e-5


def test_cross_section_and_coefficient_of_molecules() -> None:
    """Eqs. 22 and 23 of the same, 360 ppm; at 288.15 K and 1013.25 hPa the coefficient is σ N."""
    wavelength = np.array([400, 440, 450, 500, 550, 600, 650, 680, 700]) * NM
    square_cm = [
        1.673828431563305e-26, 1.127327319942864e-26, 1.027425608513666e-26, 6.661362002875201e-27,
        4.5105436536153366e-27, 3.1640374277666102e-27, 2.285628963654288e-27, 1.903451755577959e-27,
        1.6925518863199067e-27,
    ]  # fmt: skip
    per_metre = [
        4.26307195852015e-05, 2.8711888238351604e-05, 2.6167492548978473e-05, 1.6965816223760846e-05,
        1.1487899120849248e-05, 8.058483760741352e-06, 5.8212661219021425e-06, 4.847899372829749e-06,
        4.310758706716284e-06,
    ]  # fmt: skip
    np.testing.assert_allclose(rayleigh_cross_section(wavelength) * 1e4, square_cm, rtol=1e-6)
    beta = Extinction().coefficients([0.0], [288.15], [101325.0], wavelength, co2_fraction=360e-6)
    np.testing.assert_allclose(beta.rayleigh[:, 0], per_metre, rtol=2e-5)


def test_ozone_in_the_chappuis_band() -> None:
    """Column of 300 Dobson units with the Bremen cross sections at 233 K (means over 10 nm)."""
    wavelength = np.array([450, 500, 550, 600, 650]) * NM
    published = [0.0018669276, 0.01193028, 0.0282135, 0.040458159, 0.018040518]
    np.testing.assert_allclose(Extinction().ozone_optical_depth(wavelength), published, rtol=1e-6)
    # peak of the band: 5.1e-21 cm² near 602 nm (Serdyuchenko et al. 2014, doi:10.5194/amt-7-625-2014)
    fine = np.arange(400, 800, 1.0) * NM
    assert ozone_cross_section(fine).max() == pytest.approx(5.1e-25, rel=0.03, abs=0)
    assert abs(fine[np.argmax(ozone_cross_section(fine))] - 602 * NM) < 6 * NM


def test_the_layers_add_up_to_their_columns() -> None:
    air = Extinction(aerosol_depth=0.2, ozone=350.0)
    h = np.linspace(0.0, 60e3, 60001)
    wavelength = np.array([440, 550, 870 - 50]) * NM
    beta = air.coefficients(h, np.full_like(h, 250.0), np.full_like(h, 1e4), wavelength)
    np.testing.assert_allclose(np.trapezoid(beta.aerosol, h), 0.2 * (wavelength / 550e-9) ** -1.3, rtol=1e-6)
    np.testing.assert_allclose(np.trapezoid(beta.ozone, h), air.ozone_optical_depth(wavelength), rtol=1e-6)
    np.testing.assert_array_equal(beta.ozone[:, h < 10e3], 0.0)
    assert h[np.argmax(beta.ozone[0])] == 25e3
    assert beta.rayleigh.shape == (3, 60001)


def test_depolarisation() -> None:
    """ρ = 0.0279 for visible light (A. T. Young, Appl. Opt. 19 (1980) 3427, doi:10.1364/AO.19.003427)."""
    ratio = depolarisation(np.array([400, 550, 700]) * NM)
    assert ratio[1] == pytest.approx(0.0279, abs=7e-4)
    assert 1.02 < ratio[0] / ratio[1] < 1.15
    assert 0.95 < ratio[2] / ratio[1] < 1.0


@pytest.mark.parametrize(
    "call",
    [
        lambda: rayleigh_cross_section(100e-9),
        lambda: ozone_cross_section(1e-6),
        lambda: Extinction().coefficients([0.0], [-1.0], [1e5], 550e-9),
        lambda: Extinction().coefficients([np.nan], [280.0], [1e5], 550e-9),
        lambda: Extinction().coefficients([0.0], [280.0], [1e5], 2e-6),
        lambda: rayleigh_optical_depth(550e-9, latitude=45.0),
    ],
)
def test_what_is_refused(call) -> None:
    with pytest.raises(InputError):
        call()
