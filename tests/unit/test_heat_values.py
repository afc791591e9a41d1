"""Grids, quantities, boundaries, winds: what they mean and what they refuse."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image as Pictures
from pydantic import TypeAdapter, ValidationError

from nigemizu.errors import InputError
from nigemizu.heat import (
    Daily,
    Diffusivity,
    Disc,
    ExchangeGround,
    FluxGround,
    Grid,
    GridSpec,
    GroundBoundary,
    HeldGround,
    Image,
    Patches,
    Quantity,
    Rectangle,
    Schedule,
    Stripes,
    Top,
    Wind,
    require_memory,
)

BOX = {"x": (0, 8), "y": (-2, 2), "height": 2.0}


def grid(nx=8, ny=4, nz=2):
    return GridSpec(**BOX, cells=(nx, ny, nz)).build()


# --- grid ---------------------------------------------------------------------------------------------


@given(levels=st.integers(2, 200), thinness=st.floats(0.02, 1.0))
def test_stretched_cells_grow_by_one_ratio_from_first_to_top(levels, thinness):
    first = 2.0 / levels * thinness
    if first * (1.5**levels - 1) / 0.5 < 2.0:  # the tallest pile that may be made of such cells
        with pytest.raises(ValidationError, match=r"without growing by more than 1\.5"):
            GridSpec(**BOX, cells=(1, 1, levels), first_cell=first)
        return
    built = GridSpec(**BOX, cells=(1, 1, levels), first_cell=first).build()
    ratios = built.z_widths[1:] / built.z_widths[:-1]
    assert built.z_widths[0] == pytest.approx(first, rel=1e-9)
    assert built.z_edges[-1] == 2.0
    assert np.ptp(ratios) < 1e-9
    assert 1 - 1e-9 <= ratios[0] <= 1.5


def test_centres_widths_and_volumes():
    built = Grid(np.array([0.0, 1, 3]), np.array([0.0, 2]), np.array([0.0, 0.5, 2, 3]))
    assert built.shape == (3, 1, 2)
    np.testing.assert_array_equal(built.x, [0.5, 2])
    np.testing.assert_array_equal(built.z, [0.25, 1.25, 2.5])
    assert built.volumes.sum() == 18
    assert not built.x_edges.flags.writeable


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"cells": (0, 1, 1)}, "greater than or equal to 1"),
        ({"cells": (4, 4, -3)}, "greater than or equal to 1"),
        ({"height": -1.0}, "greater than 0"),
        ({"x": (3, 3)}, "second end must lie above the first"),
        ({"y": (1, 0)}, "second end must lie above the first"),
        ({"first_cell": 0.6}, "thicker than the mean cell of 0.5 m"),
        ({"first_cell": 1e-6}, "at least"),
        ({"height": math.nan}, "finite"),
        ({"cell": (1, 1, 1)}, "unknown key"),
    ],
)
def test_grids_that_are_refused(change, words):
    with pytest.raises(ValidationError, match=words):
        GridSpec.model_validate({**BOX, "cells": (4, 4, 4), **change})


@pytest.mark.parametrize("edges", [[0.0], [0, 1, 1], [0, 2, 1], [0, math.nan, 2]])
def test_edges_that_are_refused(edges):
    with pytest.raises(InputError, match="z_edges"):
        Grid(np.array([0.0, 1]), np.array([0.0, 1]), np.array(edges))


def test_unequal_horizontal_cells_are_refused_by_the_solver():
    built = Grid(np.array([0.0, 1, 3]), np.array([0.0, 2]), np.array([0.0, 1]))
    with pytest.raises(InputError, match=r"grid\.x_edges.*equal width"):
        built.horizontal_step("x")
    assert built.horizontal_step("y") == 2.0


def test_a_volume_beyond_the_memory_is_refused_with_both_sizes():
    with pytest.raises(InputError, match=r"grid\.cells.*needs 0\.04 GiB.*0\.01 GiB are available"):
        require_memory(10**6, available=lambda: 10**7)
    require_memory(10**6, available=lambda: 10**8)
    require_memory(10**15, available=lambda: None)  # a system that does not tell


def test_memory_estimate():
    assert GridSpec(**BOX, cells=(256, 128, 96)).memory() == 256 * 128 * 96 * 8 * 6


# --- quantities ---------------------------------------------------------------------------------------


def test_a_number_is_a_constant_quantity():
    ground = HeldGround.model_validate({"temperature": 320})
    assert ground.temperature.at_time(1e9) == 320.0
    assert HeldGround.model_validate(ground.model_dump()) == ground
    assert HeldGround.model_validate({"temperature": "47 degC"}).temperature.at_time(0) == pytest.approx(
        320.15
    )


def test_schedule_is_linear_and_constant_beyond():
    table = Quantity(schedule=Schedule(times=(10, 20, 40), values=(300, 310, 290)))
    assert [table.at_time(t) for t in (0, 10, 15, 30, 99)] == [300, 300, 305, 300, 290]
    assert table.bounds() == (290, 310)
    assert table.finest() == 10


def test_daily_course():
    day = Quantity(daily=Daily(mean=300, amplitude=20, time_of_maximum=50_400))
    assert day.at_time(50_400) == 320
    assert day.at_time(50_400 - 43_200) == pytest.approx(280)
    assert day.at_time(50_400 + 86_400) == pytest.approx(320)
    assert day.bounds() == (280, 320)


def test_patches_replace_and_add_in_order():
    patches = Patches(
        patches=(
            Rectangle(x=(0, 4), y=(-2, 2), value=330),
            Disc(center=(4, 0), radius=1.0, offset=5),
        )
    )
    values = Quantity(value=300, patterns=(patches,)).at(grid(), 0.0)
    assert values.shape == (4, 8)
    expected = np.full((4, 8), 300.0)
    expected[:, :4] = 330  # cell centres at x = 0.5, 1.5, …
    expected[1:3, 3:5] += 5  # centres at (±0.5, ±0.5) from the disc's
    np.testing.assert_array_equal(values, expected)


@pytest.mark.parametrize(("direction", "axis"), [(0.0, 1), (90.0, 0)])
def test_stripes(direction, axis):
    stripes = Stripes(direction=direction, width=1.0, values=(300, 310))
    values = Quantity(value=1.0, patterns=(stripes,)).at(grid(), 0.0)
    line = values[0] if axis == 1 else values[:, 0]
    np.testing.assert_array_equal(line, [300, 310] * (line.size // 2))
    assert np.ptp(values, axis=1 - axis).max() == 0


def test_pattern_on_a_schedule_keeps_the_course_where_it_adds():
    quantity = Quantity(
        schedule=Schedule(times=(0, 10), values=(300, 320)),
        patterns=(Stripes(width=4.0, offsets=(0, 7)),),
    )
    np.testing.assert_array_equal(quantity.at(grid(), 5.0)[0], [310] * 4 + [317] * 4)
    assert quantity.bounds() == (300, 327)


def test_bounds_hold_where_patches_overlap():
    offsets = (Rectangle(x=(0, 4), y=(-2, 2), offset=-6), Disc(center=(4, 0), radius=2.0, offset=-6))
    quantity = Quantity(value=10, patterns=(Patches(patches=offsets),))
    assert quantity.at(grid(), 0.0).min() == -2
    assert quantity.bounds() == (-2, 10)
    with pytest.raises(ValidationError, match=r"coefficient: .* may reach -2"):
        ExchangeGround(coefficient=quantity, temperature=300)


def test_coefficient_of_exchange_takes_numbers_texts_and_courses():
    for number in (12, "12 W/m2/K", {"value": 12}, {"schedule": {"times": (0, 1), "values": (12, 12)}}):
        ground = ExchangeGround.model_validate({"coefficient": number, "temperature": 300})
        assert ground.coefficient.at_time(0.5) == 12
        assert ExchangeGround.model_validate(ground.model_dump()) == ground


def test_image_is_seen_from_above(tmp_path):
    # upper row: black, white; lower row: white, white
    Pictures.fromarray(np.array([[0, 255], [255, 255]], dtype=np.uint8)).save(tmp_path / "map.png")
    image = Image(file=tmp_path / "map.png", values=(300, 340))
    values = Quantity(value=0.0, patterns=(image,)).at(grid(2, 2), 0.0)
    np.testing.assert_allclose(values, [[340, 340], [300, 340]])  # first row of the grid is the lowest y
    part = image.model_copy(update={"x": (0.0, 4.0), "y": (-2.0, 2.0)})
    values = Quantity(value=310.0, patterns=(part,)).at(grid(4, 2), 0.0)
    np.testing.assert_allclose(values[1], [300, 340, 310, 310])


def test_sixteen_bit_images_keep_their_range(tmp_path):
    Pictures.fromarray(np.array([[0, 65535]], dtype=np.uint16)).save(tmp_path / "map.png")
    image = Image(file=tmp_path / "map.png", offsets=(0, 10))
    values = Quantity(value=300.0, patterns=(image,)).at(grid(2, 1), 0.0)
    np.testing.assert_allclose(values, [[300, 310]])


def test_images_beyond_their_range_are_refused(tmp_path):
    Pictures.fromarray(np.array([[0.0, 0.5, 1.5]], dtype=np.float32)).save(tmp_path / "map.tiff")
    image = Image(file=tmp_path / "map.tiff", values=(300, 310))
    with pytest.raises(InputError, match=r"grey values.*0 to 1\.5.*between 0 \(black\) and 1 \(white\)"):
        Quantity(value=300.0, patterns=(image,)).at(grid(), 0.0)


def test_missing_and_broken_images_are_refused(tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    for name, words in (("absent.png", "no such picture"), ("text.png", "cannot read the picture")):
        image = Image(file=tmp_path / name, values=(300, 310))
        with pytest.raises(InputError, match=words):
            Quantity(value=300.0, patterns=(image,)).at(grid(), 0.0)


@pytest.mark.parametrize(
    ("model", "data", "words"),
    [
        (HeldGround, {"temperature": -5}, "kelvin"),
        (HeldGround, {"temperature": {"daily": {"mean": 10, "amplitude": 20}}}, "reaches -10"),
        (ExchangeGround, {"coefficient": 10, "temperature": 0}, "kelvin"),
        (ExchangeGround, {"coefficient": -1, "temperature": 300}, "coefficient: must not be negative"),
        (
            ExchangeGround,
            {"coefficient": {"daily": {"mean": 5, "amplitude": 6}}, "temperature": 300},
            "coefficient: .* may reach -1",
        ),
        (FluxGround, {"heat_flux": math.nan}, "finite"),
        (FluxGround, {"heat_flux": 10, "density": 0}, "greater than 0"),
        (Quantity, {}, "exactly one"),
        (Quantity, {"value": 1, "daily": {"mean": 1, "amplitude": 1}}, "exactly one"),
        (Schedule, {"times": (0, 0), "values": (1, 2)}, "increase"),
        (Schedule, {"times": (0, 1, 2), "values": (1, 2)}, "3 times but 2 values"),
        (Rectangle, {"x": (0, 1), "y": (0, 1)}, "value .* or offset"),
        (Stripes, {"width": 1.0}, "values .* or offsets"),
        (Image, {"file": "a.png"}, "values .* or offsets"),
        (Top, {"kind": "insulated", "temperature": 300}, "insulated top has none"),
        (Top, {"temperature": -300}, "greater than 0"),
        (Wind, {"speed": -1}, "greater than or equal to 0"),
        (Wind, {"shear": "table"}, "as many heights as speeds"),
        (Wind, {"shear": "table", "heights": (0, 0), "speeds": (1, 2)}, "increase"),
        (Wind, {"heights": (0, 1), "speeds": (1, 2)}, "only for shear 'table'"),
        (Wind, {"shear": "log", "reference_height": 0.001, "roughness": 0.01}, "above the roughness"),
        (Diffusivity, {"molecular": 0}, "greater than 0"),
        (Diffusivity, {"kind": "eddy"}, "needs one above zero"),
        (Diffusivity, {"friction_velocity": 0.1}, "only for kind 'eddy'"),
        (Diffusivity, {"kind": "table", "heights": (0, 1), "values": (1, 0)}, "above zero"),
        (Diffusivity, {"horizontal": -1.0}, "not negative"),
    ],
)
def test_values_that_are_refused(model, data, words):
    with pytest.raises(ValidationError, match=words):
        model.model_validate(data)


def test_ground_is_told_apart_by_kind():
    ground = TypeAdapter(GroundBoundary)
    assert isinstance(ground.validate_python({"kind": "flux", "heat_flux": 100}), FluxGround)
    with pytest.raises(ValidationError, match="'held', 'flux', 'exchange'"):
        ground.validate_python({"kind": "warm", "temperature": 300})
    definitions = ground.json_schema()["$defs"]
    assert definitions["HeldGround"]["properties"]["temperature"]["$ref"] == "#/$defs/Quantity"
    assert {"type": "number"} in definitions["Quantity"]["anyOf"]


# --- wind and diffusivity -----------------------------------------------------------------------------


def test_winds_are_what_was_measured_at_the_reference_height():
    for shear in ("uniform", "log", "power"):
        u, v = Wind(speed=4.0, direction=30.0, shear=shear, reference_height=2.0).velocity(2.0)
        assert math.hypot(u, v) == pytest.approx(4.0)
        assert math.degrees(math.atan2(v, u)) == pytest.approx(30.0)
    assert Wind(speed=4.0, shear="log", roughness=0.01).velocity(0.005)[0] == 0
    assert Wind(speed=4.0, shear="power", exponent=0.5).velocity(0.5)[0] == pytest.approx(2.0)
    table = Wind(shear="table", heights=(0, 1), speeds=(0, 3))
    np.testing.assert_allclose(table.velocity(np.array([0.5, 2.0]))[0], [1.5, 3.0])
    assert Wind().is_calm
    assert not table.is_calm


def test_diffusivities():
    eddy = Diffusivity(kind="eddy", friction_velocity=0.5, sublayer=0.01, cap_height=1.0)
    np.testing.assert_allclose(eddy.vertical([0.005, 0.51, 3.0]), np.array([0, 0.1, 0.198]) + 2.2e-5)
    along_x, along_y = Diffusivity(horizontal_factor=(2.0, 0.5)).sideways(1.0)
    assert (float(along_x), float(along_y)) == pytest.approx((4.4e-5, 1.1e-5))
    along_x, along_y = Diffusivity(horizontal=0.25).sideways(np.zeros(3))
    assert along_x.tolist() == along_y.tolist() == [0.25] * 3


def test_resistance_is_the_integral_across_kinks():
    eddy = Diffusivity(kind="eddy", friction_velocity=0.5, sublayer=0.01, cap_height=1.0)
    exact = 0.01 / 2.2e-5 + math.log1p(0.2 * 0.99 / 2.2e-5) / 0.2 + 1.0 / (2.2e-5 + 0.2 * 0.99)
    edges = np.concatenate([[0.0], np.geomspace(0.001, 2.0, 40)])
    assert eddy.resistance(edges[:-1], edges[1:]).sum() == pytest.approx(exact, rel=1e-9)
