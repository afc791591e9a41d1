"""Pressure of air at rest against closed forms, with its order of convergence."""

import numpy as np
import pytest
from scipy.integrate import quad

from nigemizu.air import Atmosphere, hydrostatic_pressure

G_OVER_R = 9.80665 / 287.053  # K/m
HEIGHT = np.linspace(2.5, 97.5, 20)


def test_isothermal_air():
    """p = p0 exp(-g z/(R T)) (Wallace and Hobbs 2006, eq. 3.27 with a constant scale height)."""
    pressure = hydrostatic_pressure(HEIGHT, np.full(20, 300.0))
    assert pressure == pytest.approx(101325.0 * np.exp(-G_OVER_R * HEIGHT / 300.0), rel=1e-13)


def test_constant_lapse_rate():
    """p = p0 (1 - L z/T0)^(g/(R L)), the troposphere of the US Standard Atmosphere 1976, eq. 33a."""
    height = np.linspace(0.0, 11000.0, 12)
    pressure = hydrostatic_pressure(height, 288.15 - 6.5e-3 * height)
    assert pressure == pytest.approx(
        101325.0 * (1 - 6.5e-3 * height / 288.15) ** (G_OVER_R / 6.5e-3), rel=1e-12
    )
    # 22 632 Pa at 11 km (geopotential) in that standard's table
    assert pressure[-1] == pytest.approx(22632.0, abs=1.0)


def test_second_order_where_the_profile_bends():
    """A hot layer T = 300 + 30 exp(-z/2): halving the spacing quarters the error."""

    def temperature(z):
        return 300.0 + 30.0 * np.exp(-np.asarray(z) / 2.0)

    exact = 101325.0 * np.exp(-G_OVER_R * quad(lambda z: 1.0 / temperature(z), 0.0, 8.0)[0])
    errors = []
    for cells in (16, 32, 64):
        height = np.linspace(0.0, 8.0, cells + 1)
        errors.append(abs(hydrostatic_pressure(height, temperature(height))[-1] - exact))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert slopes == pytest.approx(2.0, abs=0.2)


def test_every_column_for_itself():
    """Height runs along the first axis; the hot column is the lighter one."""
    temperature = np.stack([np.full(20, 300.0), np.full(20, 330.0)], axis=1)
    cool, hot = hydrostatic_pressure(HEIGHT, temperature).T
    assert np.all(hot > cool)
    assert cool == pytest.approx(hydrostatic_pressure(HEIGHT, temperature[:, 0]), rel=1e-15)


def test_vapour_lightens_the_column():
    """Mixed vapour raises the virtual temperature: T/(1 - x(1 - 18.015/28.9635)): isothermal."""
    air = Atmosphere(relative_humidity=1.0, humidity_temperature=303.15)
    fraction = air.vapour_fraction()
    assert fraction == pytest.approx(
        0.0421, abs=2e-4
    )  # 4247 Pa (IAPWS saturation at 30 °C), enhanced by 0.4 %
    virtual = 300.0 / (1.0 - fraction * (1.0 - 18.015 / 28.9635))
    moist = air.hydrostatic_pressure(HEIGHT, np.full(20, 300.0))
    assert moist == pytest.approx(101325.0 * np.exp(-G_OVER_R * HEIGHT / virtual), rel=1e-13)
    local = hydrostatic_pressure(HEIGHT, np.full(20, 303.15), relative_humidity=1.0)
    dry = hydrostatic_pressure(HEIGHT, np.full(20, 303.15))
    # the vapour's share hardly changes over 100 m, so the pressure drop shrinks by 0.378 x
    assert (101325.0 - local[-1]) / (101325.0 - dry[-1]) == pytest.approx(1 - 0.378 * fraction, abs=1e-4)
