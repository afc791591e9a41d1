"""A person's table: headings, units, order; and what is refused, with its row."""

import numpy as np
import pytest

from nigemizu.errors import InputError
from nigemizu.heat import read_sounding
from nigemizu.heat.reading.soundings.measures import column_of

HEAD = "height [m], temperature [C], pressure [hPa], humidity [%]"
ROWS = ("2, 31.0, 1005.0, 40", "50, 28.5, 999.6, 45", "200, 27.0, 982.7, 47", "1000, 20.1, 896.8, 50")
TOML = """
time = 2026-07-01T12:00:00Z
place = [35.0, 139.0]
station_height = 12
height = [0.0, 0.5, 2.0, 10.0]
temperature = [40.2, 33.5, 31.0, 30.1]
pressure = [1005.0, 1004.94, 1004.77, 1003.87]
humidity = [25, 38, 41, nan]

[units]
temperature = "C"
pressure = "hPa"
humidity = "%"
"""


def read(tmp_path, text, name="air.csv", **asked):
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    return read_sounding(file, **asked)


def table(*rows, head=HEAD):
    return "\n".join((head, *(rows or ROWS)))


def test_a_table(tmp_path):
    sounding = read(tmp_path, table())
    assert sounding.height == pytest.approx([2.0, 50.0, 200.0, 1000.0], abs=1e-9)
    assert sounding.temperature == pytest.approx([304.15, 301.65, 300.15, 293.25])
    assert sounding.pressure == pytest.approx([100500.0, 99960.0, 98270.0, 89680.0])
    assert sounding.wind_speed is None
    assert sounding.station_height is None
    assert sounding.notes == ()


SAME = [
    "z_m\tT_degC\tp_hPa\tRH_%\n" + "\n".join(row.replace(", ", "\t") for row in ROWS),
    "Height (m);Temperature (°C);Pressure (hPa);Relative humidity (%)\n"
    + "\n".join(row.replace(", ", ";").replace(".", ",") for row in ROWS),
    "height/m temperature/°C p/hPa rh/%\n" + "\n".join(row.replace(",", " ") for row in ROWS),
    "height,temperature,pressure,humidity\nm,C,hPa,%\n" + "\n".join(ROWS),
    f"# {HEAD}\n" + "\n".join(row.replace(",", "") for row in ROWS).replace(" ", ","),
    f"# from the mast\n\n{HEAD}\n" + "\n".join(reversed(ROWS)) + "\n\n",
    "\ufeff" + table().replace("\n", "\r\n"),
    table(
        *(km + row[row.index(",") :] for km, row in zip((".002", ".05", ".2", "1"), ROWS, strict=True))
    ).replace("height [m]", "height [km]"),
    table(*(row + ",x" for row in ROWS), head=HEAD + ", remark"),
]


@pytest.mark.parametrize("text", SAME)
def test_tables_that_say_the_same(tmp_path, text):
    first, other = read(tmp_path, table(), "first.csv"), read(tmp_path, text, "other.data")
    for name in ("height", "temperature", "pressure", "vapour_fraction"):
        assert getattr(other, name) == pytest.approx(getattr(first, name), rel=1e-9, abs=0)


def test_columns_that_a_program_saved_with_commented_headings(tmp_path):
    text = "# height [m] temperature [K]\n# surface_pressure: 1000 hPa\n0 300\n1 299.9\n2 299.8\n"
    sounding = read(tmp_path, text)
    assert sounding.temperature == pytest.approx([300.0, 299.9, 299.8])
    assert sounding.pressure[0] == 1e5


def test_other_encodings(tmp_path):
    text = table(head=HEAD.replace("[C]", "[°C]"))
    for encoding in ("cp1252", "utf-16"):
        (tmp_path / encoding).write_bytes(text.encode(encoding))
        assert read_sounding(tmp_path / encoding).temperature[0] == pytest.approx(304.15)


@pytest.mark.parametrize(
    ("heading", "name", "units"),
    [
        ("Dew Point [degC]", "dew_point", "degC"),
        ("TEMP", "temperature", ""),
        ("air_temperature_K", "temperature", "K"),
        ("Wind speed in knots", "wind_speed", "knots"),
        ("relative humidity_%", "relative_humidity", "%"),
        ("altitude (ft)", "altitude", "ft"),
        ("gph", "geopotential_height", ""),
        ("mixing ratio_g/kg", "mixing_ratio", "g/kg"),
    ],
)
def test_headings(heading, name, units):
    assert column_of(heading) == (name, units)


@pytest.mark.parametrize(
    "heading", ["wet bulb [C]", "humidity wrt ice_%", "ice point temperature_C", "THTA", "u"]
)
def test_headings_of_other_things_are_not_taken_for_ours(heading):
    assert column_of(heading) is None


def test_altitudes_count_from_the_lowest(tmp_path):
    rows = ("1640.42, 20.0, 955.0, 40", "1804.46, 19.5, 949.4, 45", "2132.55, 18.7, 938.4, 47")
    sounding = read(tmp_path, table(*rows, head=HEAD.replace("height [m]", "altitude [ft]")))
    assert sounding.height == pytest.approx([0.0, 50.0, 150.0], abs=2e-3)
    assert sounding.station_height == pytest.approx(500.0, abs=2e-3)


def test_toml(tmp_path):
    sounding = read(tmp_path, TOML)
    assert sounding.height == pytest.approx([0.0, 0.5, 2.0, 10.0], abs=1e-9)
    assert sounding.temperature[0] == pytest.approx(313.35)
    assert sounding.place == (35.0, 139.0)
    assert sounding.station_height == 12.0
    assert f"{sounding.time:%Y-%m-%d %H:%M}" == "2026-07-01 12:00"
    assert sounding.vapour_fraction[3] == pytest.approx(sounding.vapour_fraction[2], rel=0.06)
    assert any("1 level without any, 1 of them above" in note for note in sounding.notes)
    keyed = (
        TOML.split("[units]")[0]
        .replace("temperature =", "temperature_C =")
        .replace("humidity =", '"humidity [%]" =')
    )
    other = read(tmp_path, keyed.replace("pressure =", "pressure_hPa ="), "keyed.toml")
    assert np.array_equal(other.vapour_fraction, sounding.vapour_fraction)


def test_what_a_person_knows_besides_the_file(tmp_path):
    sounding = read(tmp_path, table(), time="2026-07-01 12:00", place=(35.0, 139.0), station="mast")
    assert (sounding.place, sounding.station) == ((35.0, 139.0), "mast")
    assert sounding.time.hour == 12
    told = f"# time: 2026-07-01 12:00\n# latitude: 35\n# longitude: 139\n# station: mast\n{table()}"
    assert read(tmp_path, told, "told.csv").place == (35.0, 139.0)
    for asked in ({"time": "2026-07-02"}, {"place": (0.0, 0.0)}, {"station": "ship"}):
        with pytest.raises(InputError, match=r"no such sounding.*one of 2026-07-01 12:00 of mast"):
            read(tmp_path, told, "told.csv", **asked)


def test_pressure_alone_or_height_alone(tmp_path):
    alone = "\n".join(",".join(row.split(",")[1:]) for row in (HEAD, *ROWS))
    sounding = read(tmp_path, alone)
    assert sounding.height == pytest.approx([0.0, 47.5, 198.0, 998.0], abs=5.0)
    assert any("4 heights" in note for note in sounding.notes)
    bare = "\n".join(",".join(row.split(",")[:2] + row.split(",")[3:]) for row in (HEAD, *ROWS))
    with pytest.raises(InputError, match=r"no pressure anywhere.*give surface_pressure"):
        read(tmp_path, bare)
    sounding = read(tmp_path, "# surface pressure: 1005.2 hPa\n" + bare)
    assert sounding.pressure == pytest.approx([100497.0, 99960.0, 98270.0, 89680.0], rel=3e-4)
    # 2 m above the ground at 304.15 K: 1005.2 hPa · g 2 m/(R T)
    assert sounding.pressure[0] == pytest.approx(100520.0 * (1 - 2 * 9.80665 / 287.053 / 304.15), abs=0.3)


def test_doubled_heights_are_merged(tmp_path):
    sounding = read(tmp_path, table(ROWS[0], ROWS[1], "50, 29.5, 999.6, 45", *ROWS[2:]))
    assert sounding.temperature[1] == pytest.approx(302.15)
    assert "up to 1.0 K apart: 1 level (line 4)" in sounding.notes[0]


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            (ROWS[0], ROWS[2], ROWS[1], ROWS[3]),
            r"line 4, height: the height falls \(got '50'\); expected at least 200",
        ),
        (
            (*ROWS[:2], "200, 27.0, 1002.7, 47", ROWS[3]),
            r"line 4, pressure: the pressure rises.*'1002.7'.*999.6, as at line 3",
        ),
        (
            (*ROWS[:2], "200, 300.15, 982.7, 47", ROWS[3]),
            r"line 4, temperature: a value that no air has \(got '300.15'\)",
        ),
        (
            (*ROWS[:2], "200, 27.0, 98270, 47", ROWS[3]),
            r"line 4, pressure: a value that no air has \(got '98270'\)",
        ),
        (
            (*ROWS[:2], "200, 27.0, 9.827, 47", ROWS[3]),
            r"line 4, pressure: the pressure changes 102-fold from line 3 .*'9.827'\).*hPa among Pa",
        ),
        ((*ROWS[:3], "1000, 20.1, 8.968, 50"), "line 5, pressure: the pressure changes 110-fold"),
        (
            (*ROWS[:3], "3281, 20.1, 896.8, 50"),
            "line 5: height and pressure contradict each other: 3279 m from line 2 to here, 992 m by",
        ),
        (
            (*ROWS[:2], "200, 27.0, 982.7, 470", ROWS[3]),
            r"line 4, relative_humidity: a value that no air has \(got '470'\)",
        ),
        ((*ROWS[:2], "200, 27.0, 982.7", ROWS[3]), "line 4: 3 values where the headings are 4"),
        ((*ROWS[:2], "200, 27.0, 982.7, wet", ROWS[3]), r"line 4, humidity \[%\]: no number \(got 'wet'\)"),
        (ROWS[:2], "only 2 levels can be used; expected at least 3"),
        (
            (*ROWS[:2], "200, -, 982.7, 47", "1000, nan, 896.8, 50"),
            r"only 2 levels can be used.*want of a temperature: 2 levels \(line 4, line 5\)",
        ),
    ],
)
def test_bad_rows_are_refused_with_their_line(tmp_path, rows, words):
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path, table(*rows))
    assert "air.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_hectopascals_without_a_unit(tmp_path):
    text = "z,T,p\n0,300.0,1000\n100,299.0,988.7\n200,298.2,977.5\n"
    with pytest.raises(InputError, match=r"line 2, pressure: too little for the lowest level .*'1000'.*hPa"):
        read(tmp_path, text)


@pytest.mark.parametrize("temperatures", ["[nan, nan, nan, nan]", "[nan, 280.0, nan, nan]"])
def test_a_table_without_temperatures(tmp_path, temperatures):
    text = f'surface_pressure = "1000 hPa"\nheight = [0, 1, 2, 3]\ntemperature = {temperatures}'
    with pytest.raises(InputError, match=r"level.? can be used; expected at least 3"):
        read(tmp_path, text)


def test_celsius_among_kelvins(tmp_path):
    text = "z,T,p\n0,300.0,100000\n100,299.0,98870\n200,26.2,97750\n300,297.5,96640"
    with pytest.raises(
        InputError, match=r"line 4, temperature: a value that no air has \(got '26.2'\).*unit"
    ):
        read(tmp_path, text)


def test_hectopascals_among_pascals(tmp_path):
    text = "z,T,p\n0,300.0,100000\n100,299.0,988.7\n200,298.2,97750\n300,297.5,96640"
    with pytest.raises(
        InputError, match=r"line 3, pressure: the pressure changes 101-fold from line 2 .*'988.7'"
    ):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (
            "hight [m], temperature [C], air [hPa], humidity [%]",
            "neither height nor pressure; expected .* found hight",
        ),
        (
            "height [m], temprature [C], pressure [hPa], humidity [%]",
            "no temperature;.*is 'temprature .C.' the temperature",
        ),
        (
            "height [hPa], temperature [C], pressure [hPa], humidity [%]",
            r"height \[hPa\]: units of the wrong kind",
        ),
        (
            "height [m], temperature [C], temp [K], humidity [%]",
            "'temperature .C.' and 'temp .K.' mean the same",
        ),
        ("2, 31, 1005, 40", "no line of headings"),
    ],
)
def test_headings_that_do_not_serve(tmp_path, head, words):
    with pytest.raises(InputError, match=words):
        read(tmp_path, table(head=head))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("humidity = [25,", "ozone = [25,", "ozone: a key that means nothing here; expected lists height"),
        ("[25, 38, 41, nan]", "[25, 38, 41]", "humidity: 3 values where height has 4"),
        ("[25, 38, 41, nan]", "25", "humidity: no list"),
        ("[25, 38, 41, nan]", '["wet", 38, 41, nan]', r"entry 1, humidity: no number \(got 'wet'\)"),
        ("31.0", "310.0", r"entry 3, temperature: a value that no air has \(got '310.0'\)"),
        ("[35.0, 139.0]", "[35.0]", r"place: no place \(got \[35.0\]\)"),
        ("[35.0, 139.0]", "[139.0, 35.0]", "air.csv: place: no place"),
        ("station_height = 12", 'station_height = "tall"', "air.csv: station_height: not what it should be"),
        ("station_height = 12", 'surface_pressure = "1 furlong"', "air.csv: surface_pressure: units of the"),
        ("2026-07-01T12:00:00Z", '"noon"', r"air.csv: time: no time \(got 'noon'\)"),
        ("[units]", "[units", "not TOML"),
        ('"C"', '"furlong"', "temperature: units of the wrong kind"),
    ],
)
def test_toml_that_does_not_serve(tmp_path, old, new, words):
    assert old in TOML
    with pytest.raises(InputError, match=words):
        read(tmp_path, TOML.replace(old, new, 1))


def test_a_dew_point_of_the_wrong_column(tmp_path):
    text = "z [m],T [C],p [hPa],Td [C]\n0,20,1000,15\n100,19,988.4,24\n200,18,976.9,10"
    with pytest.raises(
        InputError, match=r"line 3, dew point: the dew point is above the temperature \(got '24'\)"
    ):
        read(tmp_path, text)


def test_vapour_that_no_air_holds(tmp_path):
    text = "z [m],T [C],p [hPa],mixing ratio\n0,20,1000,0.009\n100,19,988.4,0.09\n200,18,976.9,0.008"
    with pytest.raises(
        InputError, match=r"line 3, mixing ratio: 5.* times the vapour that saturates.*'0.09'"
    ):
        read(tmp_path, text)
