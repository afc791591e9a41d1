"""Turbulence as a person describes it: strength, scales, and what is refused."""

import warnings

import numpy as np
import pytest
from pydantic import ValidationError

from nigemizu.errors import InputError, NigemizuWarning
from nigemizu.heat import GridSpec
from nigemizu.heat.turbulence import StructureTable, Turbulence, TurbulentField, cn2_from_ct2


def grid(cells=(16, 16, 4), x=(0, 4), y=(-2, 2), height=2.0):
    return GridSpec(x=x, y=y, height=height, cells=cells).build()


def test_strength_follows_the_height():
    convective = Turbulence(ct2=0.2, reference_height=2.0, constant_below=0.5, outer_scale=1.0)
    expected = 0.2 * (np.array([0.5, 0.5, 2.0, 4.0]) / 2.0) ** (-4 / 3)
    np.testing.assert_allclose(convective.structure_parameter([0.0, 0.5, 2.0, 4.0]), expected, rtol=1e-12)
    table = Turbulence(ct2=StructureTable(heights=(1, 10), values=(1.0, 0.01)), outer_scale=1.0)
    np.testing.assert_allclose(
        table.structure_parameter([0.1, 1, 10**0.5, 10, 99]), [1, 1, 0.1, 0.01, 0.01], rtol=1e-12
    )


def test_index_structure_is_converted_for_the_air_it_was_meant_for():
    for given in (1e-13, StructureTable(heights=(1, 2), values=(1e-13, 1e-13))):
        air = Turbulence(
            cn2=given, exponent=0, outer_scale=1, air_temperature="20 degC", air_pressure="950 hPa"
        )
        assert cn2_from_ct2(air.structure_parameter(1.0), 293.15, 95000.0) == pytest.approx(1e-13, rel=1e-12)


def test_outer_scale_grows_with_the_height_up_to_a_limit():
    air = Turbulence(ct2=1, outer_scale="5 m", outer_scale_per_height=0.4)
    np.testing.assert_allclose(air.outer_scale_at([1.0, 10.0, 100.0]), [0.4, 4.0, 5.0])


def test_units_are_understood():
    air = Turbulence(ct2="0.1 K2 m-2/3", outer_scale="200 cm", inner_scale="5 mm", eddy_lifetime="1 min")
    assert (air.ct2, air.outer_scale, air.inner_scale, air.eddy_lifetime) == (0.1, 2.0, 0.005, 60.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"ct2": 1, "outer_scale": 0.004}, "outer_scale: 0.004 m is not above the inner scale of 0.005 m"),
        ({"ct2": 1, "outer_scale": 1, "largest": 0.001}, "largest: 0.001 m is not above the inner scale"),
        ({"ct2": -0.1, "outer_scale": 1}, "greater than 0"),
        ({"ct2": 1, "cn2": 1e-13, "outer_scale": 1}, "exactly one of ct2 and cn2; both"),
        ({"outer_scale": 1}, "exactly one of ct2 and cn2; none"),
        ({"ct2": 1}, "give outer_scale"),
        (
            {"ct2": {"heights": [2, 1], "values": [1, 1]}, "outer_scale": 1},
            "heights: must be above zero and increase",
        ),
        (
            {"ct2": {"heights": [1, 2], "values": [1, -1]}, "outer_scale": 1},
            "a structure parameter is above zero",
        ),
        ({"ct2": {"heights": [1, 2], "values": [1, 1, 1]}, "outer_scale": 1}, "2 heights but 3 values"),
        ({"ct2": 1, "outer_scale": "1 s"}, "wrong unit"),
        ({"ct2": 1, "outer_scales": 1}, "unknown key"),
    ],
)
def test_what_cannot_be_is_refused(given, message):
    with pytest.raises(ValidationError, match=message):
        Turbulence(**given)


def test_cells_larger_than_the_eddies_are_refused():
    with pytest.raises(InputError, match=r"turbulence.outer_scale: cells of 0.25 m along x .* 0.2 m"):
        TurbulentField(grid(), Turbulence(ct2=1, outer_scale=0.2))
    with pytest.raises(InputError, match=r"turbulence.largest: cells of 0.25 m along x"):
        TurbulentField(grid(), Turbulence(ct2=1, outer_scale=2, largest=0.2))
    with pytest.raises(InputError, match=r"cells of 1 m along z"):
        TurbulentField(grid(cells=(16, 16, 2)), Turbulence(ct2=1, outer_scale=0.8))
    with pytest.raises(InputError, match="no room"):
        TurbulentField(grid(cells=(1, 2, 4)), Turbulence(ct2=1, outer_scale=2))
    with pytest.raises(InputError, match=r"time: .*finite"):
        TurbulentField(grid(), Turbulence(ct2=1, outer_scale=2)).at(float("nan"))


def test_a_box_smaller_than_the_eddies_warns_which_are_missing():
    with pytest.warns(
        NigemizuWarning, match=r"box is 2 m long along y, less than the outer scale of 3 m; eddies above 2 m"
    ):
        TurbulentField(grid(y=(-1, 1)), Turbulence(ct2=1, outer_scale=3))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        TurbulentField(grid(y=(-1, 1)), Turbulence(ct2=1, outer_scale=3, largest=1.0))
        # a section has no extent of its own
        TurbulentField(grid(y=(-1, 1), cells=(16, 1, 4)), Turbulence(ct2=1, outer_scale=3))


def test_eddies_too_small_for_the_cells_next_to_the_ground_warn():
    with pytest.warns(
        NigemizuWarning, match=r"below 0.5 m above the ground all eddies are smaller than the cells"
    ):
        TurbulentField(grid(), Turbulence(ct2=1, outer_scale_per_height=0.9))
