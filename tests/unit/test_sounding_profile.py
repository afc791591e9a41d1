"""From a file of a radiosonde to the index of refraction over a round Earth."""

from pathlib import Path

import numpy as np
import pytest

from nigemizu.air import Earth, ProfileSpec, refractivity
from nigemizu.heat import read_sounding

FILES = Path(__file__).resolve().parents[1] / "data" / "soundings"


@pytest.mark.parametrize(
    ("name", "time"),
    [
        ("wyoming_two.html", "2010-04-15 12:00"),
        ("wyoming.csv", None),
        ("USM00072357-data.txt", "2026-07-01 12:00"),
    ],
)
def test_a_sounding_becomes_layers_of_air_that_bend_light(name, time):
    sounding = read_sounding(FILES / name, time=time)
    spec = ProfileSpec(kind="file", file=FILES / name)
    profile = spec.build(Earth(latitude=sounding.place[0]), sounding)
    temperature, pressure, fraction = profile.at(sounding.height)
    assert temperature == pytest.approx(sounding.temperature, abs=1e-9)
    assert fraction == pytest.approx(sounding.vapour_fraction, abs=1e-12)
    # The profile weighs its own air; the sonde measured it: rounded to 0.1 hPa and 1 m.
    low = sounding.height < 10_000.0
    assert pressure[low] == pytest.approx(sounding.pressure[low], rel=2e-3, abs=0)
    index = refractivity(temperature, pressure, vapour_fraction=fraction, wavelength=550e-9)
    # At the ground by hand: 2.778e-4 at 15 °C and 1013.25 hPa (Ciddor 1996), and vapour takes 3.9e-8 per hPa.
    dry = 2.778e-4 * (pressure[0] / 101325.0) * (288.15 / temperature[0])
    vapour = 3.9e-8 * fraction[0] * pressure[0] / 100.0
    assert index[0] == pytest.approx(dry - vapour, rel=1e-3, abs=0)
    assert abs(vapour / index[0]) > 1.5e-3  # humidity is seen in the index
    # Over 200 m: temperatures rounded to 0.1 K every 5 m make the index rise and fall, as no air does.
    steps = refractivity(*profile.at(np.arange(0.0, 15000.0, 200.0))[:2], wavelength=550e-9)
    assert (np.diff(steps) < 0).all()
