"""Pages of the University of Wyoming and files of IGRA, in their own layouts with made-up numbers."""

import gzip
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from nigemizu.errors import InputError
from nigemizu.heat import read_sounding
from nigemizu.heat.reading.soundings import humidity

FILES = Path(__file__).resolve().parents[1] / "data" / "soundings"
LIST, NEW, CSV = FILES / "wyoming_two.html", FILES / "wyoming_new.html", FILES / "wyoming.csv"
IGRA = FILES / "USM00072357-data.txt"
RECORD = "20   340  92834B-9999   217B  711    54   185    32 "
NIGHT, MORNING = "2010-04-15 00:00", "2010-04-15 12:00"


def changed(tmp_path, source, *changes, name="air.txt"):
    """A copy of a file in which texts are replaced; each must be there."""
    text = source.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    return file


def test_wyoming_list():
    sounding = read_sounding(LIST, time=NIGHT)
    assert sounding.height.size == 25
    assert sounding.height[0] == 0.0
    # 402 − 357 geopotential m at 35° N, where gravity is 9.797 m/s²
    assert sounding.height[1] == pytest.approx(45.0 * 9.80665 / 9.797, abs=5e-3)
    assert sounding.pressure[[0, -1]] == pytest.approx([97140.0, 5420.0])
    assert sounding.temperature[[0, -1]] == pytest.approx([297.75, 222.15])
    dew = humidity.from_dew_point(np.array([21.6 + 273.15]), np.array([97140.0]))
    assert sounding.vapour_fraction[0] == pytest.approx(float(dew[0]), rel=1e-12, abs=0)
    # MIXR says 16.91 g/kg, by the formulas of the page
    assert sounding.vapour_fraction[0] == pytest.approx(16.91 / (16.91 + 622.0), rel=0.01, abs=0)
    assert sounding.wind_speed[0] == pytest.approx(6 * 1852 / 3600)
    assert sounding.wind_direction[0] == 170.0
    assert sounding.station_height == 357.0
    assert sounding.place == (35.18, -97.44)
    assert sounding.station == "72357 OUN Norman"
    assert sounding.time == datetime(2010, 4, 15, tzinfo=UTC)
    assert "University of Wyoming" in sounding.source


def test_what_was_left_out_stands_in_the_notes():
    notes = " | ".join(read_sounding(LIST, time=NIGHT).notes)
    assert "want of a temperature: 1 level (line 11)" in notes
    assert "up to 0.0 K apart: 1 level (line 13)" in notes  # the surface was reported twice
    assert "4 levels without any, 4 of them above" in notes


@pytest.mark.parametrize("time", [MORNING, datetime(2010, 4, 15, 12, tzinfo=UTC), np.datetime64(MORNING)])
def test_the_time_chooses(time):
    assert read_sounding(LIST, time=time).temperature[0] == pytest.approx(286.35)
    assert read_sounding(LIST, time=time, station=72357, place=(35.0, -97.0)).pressure[0] == 97400.0


def test_wyoming_as_plain_text(tmp_path):
    lines = LIST.read_text().splitlines()
    start = next(n for n, line in enumerate(lines) if "12Z" in line)
    page = "\n".join(lines[start:]).replace("<H2>", "").replace("</H2>", "").replace("</PRE>", "")
    file = tmp_path / "copied.txt"
    file.write_text(page.replace("<PRE>", "").replace("<H3>", "\n").replace("</H3>", "\n"))
    assert read_sounding(file).height == pytest.approx(read_sounding(LIST, time=MORNING).height)
    assert read_sounding(file).station_height == 357.0


def test_wyoming_of_the_new_service_has_wind_in_metres():
    sounding = read_sounding(NEW)
    assert sounding.wind_speed[0] == 3.0
    assert sounding.time == datetime(2026, 7, 25, 12, tzinfo=UTC)
    assert (sounding.station, sounding.place) == ("72357", (35.18, -97.44))
    assert sounding.station_height == pytest.approx(357.35, abs=0.01)  # of the lowest level: 357 gpm
    assert sounding.temperature == pytest.approx(read_sounding(LIST, time=NIGHT).temperature)


def test_wyoming_csv():
    sounding = read_sounding(CSV, time="2026-07-25 00:00")  # released 37 minutes before
    assert sounding.time == datetime(2026, 7, 24, 23, 22, 31, tzinfo=UTC)
    assert sounding.place == (35.18, -97.44)
    assert sounding.wind_speed[0] == 2.0
    notes = " | ".join(sounding.notes)
    assert "sank for a moment: 1 level (line 15)" in notes
    assert "4 levels (line 8, line 14, line 30, line 31)" in notes
    assert "ice point temperature_C, humidity wrt ice_%" in notes
    assert (np.diff(sounding.height) > 0).all()
    assert (np.diff(sounding.pressure) < 0).all()
    with pytest.raises(InputError, match=r"no such sounding \(got '2026-07-25 12:00'\).*2026-07-24 23:22"):
        read_sounding(CSV, time="2026-07-25 12:00")


def test_wyoming_csv_of_an_unknown_place(tmp_path):
    file = tmp_path / "air.csv"
    file.write_text(CSV.read_text().replace(" 35.1", "-99.9").replace("-97.44", "-99.99"))
    sounding = read_sounding(file)
    assert sounding.place is None
    assert sounding.height == pytest.approx(read_sounding(CSV).height, rel=2e-3, abs=0)  # gravity of 45°


def test_unknown_place_of_a_station(tmp_path):
    file = changed(
        tmp_path,
        NEW,
        ("Latitude: 35.18 Longitude: -97.44", "Latitude: ******  Longitude: -9999.0"),
    )
    assert read_sounding(file).place is None


def test_a_date_that_is_none(tmp_path):
    with pytest.raises(InputError, match=r"no time of a sounding \(got '25 Jux 2026 12'\)"):
        read_sounding(changed(tmp_path, NEW, ("25 Jul 2026", "25 Jux 2026")))


def test_a_page_whose_leading_blanks_were_lost(tmp_path):
    text = "\n".join(line.strip() for line in NEW.read_text().splitlines())
    file = tmp_path / "stripped.txt"
    file.write_text(text)
    assert read_sounding(file).vapour_fraction == pytest.approx(read_sounding(NEW).vapour_fraction)


def test_missing_elevation(tmp_path):
    text = LIST.read_text().replace("Station elevation: 357.0", "Station elevation: -9999.0")
    file = tmp_path / "list.txt"
    file.write_text(text)
    assert read_sounding(file, time=NIGHT).station_height == pytest.approx(357.35, abs=0.01)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (
            "  943.8    310   23.0   18.8     77  14.62",
            r"line 16, height: the height falls \(got '310'\); .*477",
        ),
        (
            "  973.8    610   23.0   18.8     77  14.62",
            "line 16, pressure: the pressure rises.*'973.8'.*958.2",
        ),
        ("  943.8    610  296.2   18.8     77  14.62", r"line 16, temperature: a value that no .*'296.2'\)"),
        ("  943.8    610   23.0   28.8     77  14.62", "line 16, dew point: .* above.*'28.8'.*at most 23.0"),
        ("  943.8    610   x3.0   18.8     77  14.62", r"line 16, temperature: no number \(got 'x3.0'\)"),
    ],
)
def test_bad_rows_of_wyoming_are_refused_with_their_line(tmp_path, row, words):
    file = changed(tmp_path, LIST, ("  943.8    610   23.0   18.8     77  14.62", row))
    with pytest.raises(InputError, match=words) as caught:
        read_sounding(file, time=NIGHT)
    assert "\n" not in str(caught.value)
    assert "air.txt" in str(caught.value)


@pytest.mark.parametrize(
    "row", ["  943.8    610   23.0   18.8     7", "  943.8    610   23.0      14.62    191"]
)
def test_rows_that_are_cut_or_have_slipped_are_not_guessed_at(tmp_path, row):
    whole = next(line for line in LIST.read_text().splitlines() if line.startswith("  943.8"))
    with pytest.raises(InputError, match="line 16: the columns of this row cannot be told apart"):
        read_sounding(changed(tmp_path, LIST, (whole, row)), time=NIGHT)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (
            {},
            r"time: 2 soundings could be meant; expected one of 2010-04-15 00:00 of 72357 OUN Norman; 2010-",
        ),
        ({"time": "2010-04-15"}, "time: 2 soundings could be meant"),
        ({"time": "2011-01-01"}, r"time: no such sounding \(got '2011-01-01 00:00'\); expected one of 2010"),
        (
            {"time": MORNING, "station": "FWD"},
            r"time, station: no such sounding \(got '2010-04-15 12:00, FWD'",
        ),
        ({"time": MORNING, "place": (48.0, 11.0)}, r"no such sounding \(got '2010-04-15 12:00, \(48.0, 11.0"),
        ({"time": "noon"}, r"time: no time \(got 'noon'\)"),
        ({"place": (120.0, 0.0)}, r"place: no place \(got \(120.0, 0.0\)\)"),
    ],
)
def test_what_is_not_there_is_refused_with_what_there_is(asked, words):
    with pytest.raises(InputError, match=words):
        read_sounding(LIST, **asked)


def test_igra():
    sounding = read_sounding(IGRA, time="2026-07-01 00:00")
    assert sounding.pressure[0] == 97788.0
    assert sounding.temperature[0] == pytest.approx(297.85)
    assert sounding.height[0] == 0.0
    dew = humidity.from_dew_point(np.array([297.85 - 3.0]), np.array([97788.0]))
    assert sounding.vapour_fraction[0] == pytest.approx(float(dew[0]), rel=1e-12, abs=0)
    assert sounding.wind_speed[0] == pytest.approx(2.0)
    assert np.isnan(sounding.wind_speed[1])
    assert (sounding.station, sounding.place) == ("USM00072357", (35.1808, -97.4378))
    assert sounding.station_height == pytest.approx(345.3, abs=0.1)
    notes = " | ".join(sounding.notes)
    assert "quality control: 2 values" in notes
    assert "below the surface: 1 level (line 2)" in notes
    assert "want of a temperature: 2 levels (line 7, line 13)" in notes  # wind only, and removed
    assert "weight of the air: 39 heights" in notes


def test_igra_heights_between_known_ones_follow_from_the_pressures():
    sounding = read_sounding(IGRA, time="2026-07-01 00:00")
    # The file was written with levels every 190 gpm from 420; every sixth height is in it.
    ratio = 9.80665 / 9.797  # gravity at 35° N, near the ground
    expected = (np.array([420.0, 610.0, 800.0, 990.0, 1180.0, 1370.0]) - 345.0) * ratio
    assert sounding.height[1:7] == pytest.approx(expected, abs=1.5)
    assert np.abs(np.diff(sounding.height[1:7]) - 190.0 * ratio).max() < 1.0


def test_igra_packed(tmp_path):
    plain = read_sounding(IGRA, time="2026-07-01 12:00")
    with zipfile.ZipFile(tmp_path / "data.txt.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(IGRA, "USM00072357-data.txt")
    (tmp_path / "data.txt.gz").write_bytes(gzip.compress(IGRA.read_bytes()))
    for name in ("data.txt.zip", "data.txt.gz"):
        packed = read_sounding(tmp_path / name, time="2026-07-01 12:00", station="72357")
        assert np.array_equal(packed.height, plain.height)


def test_igra_without_the_hour_takes_the_release(tmp_path):
    file = changed(tmp_path, IGRA, ("2026 07 01 00 2302", "2026 07 01 99 2302"))
    assert read_sounding(file, time="2026-07-01 23:02").pressure[0] == 97788.0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (f"{RECORD}\n", "", "line 1: 49 levels stand here and the header counts 50"),
        (RECORD, RECORD[:28], "line 6: a record that is cut short"),
        (" 92834B", " 92x34B", r"line 6, pressure: no number \(got ' 92x34'\).*columns 10 to 15"),
        (" 92834B", " 98834B", r"line 6, pressure: the pressure rises with height \(got '98834'\)"),
        (
            " 1370B",
            " 1910B",
            r"line 10: height and pressure contradict .*: 1565 m from line 3 .* 10\d\d m by",
        ),
        ("  217B  711", " 2170B  711", r"line 6, temperature: a value that no air has \(got '2170'\)"),
        ("ncdc-gts  351808  -974378", "", "line 1: not a header of IGRA version 2"),
        ("2026 07 01 00", "2026 13 01 00", "line 1: not a header of IGRA version 2.*month"),
    ],
)
def test_bad_records_of_igra_are_refused_with_their_line(tmp_path, old, new, words):
    with pytest.raises(InputError, match=words) as caught:
        read_sounding(changed(tmp_path, IGRA, (old, new)), time="2026-07-01 00:00")
    assert "\n" not in str(caught.value)


def test_a_file_that_ends_too_soon(tmp_path):
    file = tmp_path / "half.txt"
    file.write_bytes(IGRA.read_bytes()[:-500])
    with pytest.raises(InputError, match=r"levels stand here and the header counts|cut short"):
        read_sounding(file, time="2026-07-01 12:00")
    assert read_sounding(file, time="2026-07-01 00:00").pressure[0] == 97788.0


def test_years_of_soundings_are_listed_by_their_ends_and_neighbours(tmp_path):
    block = IGRA.read_text().splitlines()[:51]
    records = []
    for day in range(1, 29):
        records += [block[0].replace("07 01 00", f"07 {day:02d} 00"), *block[1:]]
    file = tmp_path / "month.txt"
    file.write_text("\n".join(records))
    assert read_sounding(file, time="2026-07-20").time == datetime(2026, 7, 20, tzinfo=UTC)
    with pytest.raises(
        InputError, match=r"one of 28 from 2026-07-01 00:00 .* to 2026-07-28.*next to it 2026-07-09 00"
    ):
        read_sounding(file, time="2026-07-09 12:00")
    with pytest.raises(InputError, match="28 soundings could be meant"):
        read_sounding(file)


def test_pressures_rounded_to_a_tenth_near_the_burst_of_the_balloon(tmp_path):
    # At 35 km 0.05 hPa are 60 m; of two levels 500 m apart the thickness is then wrong by up to a quarter.
    head = "time,longitude,latitude,pressure_hPa,geopotential height_m,temperature_C"
    height = np.arange(0.0, 36001.0, 65.0)
    warmth = np.maximum(288.15 - 6.5e-3 * height, 216.65) + 1e-3 * np.maximum(height - 20000.0, 0.0)
    thickness = np.diff(height) / (0.5 * (warmth[1:] + warmth[:-1]))
    pressure = 1013.25 * np.exp(-np.concatenate([[0.0], np.cumsum(thickness)]) * 9.80665 / 287.053)
    rows = [
        f"2026-07-24 23:22:31, 0.0,45.0,{p:.1f},{h:.0f},{t - 273.15:.1f}"
        for p, h, t in zip(pressure, height, warmth, strict=True)
    ]
    file = tmp_path / "flight.csv"
    file.write_text("\n".join([head, *rows]))
    sounding = read_sounding(file)
    assert sounding.height[-1] > 35500.0
    assert sounding.height.size < height.size  # some levels share their rounded pressure


def test_two_temperatures_at_one_height_are_refused(tmp_path):
    row = "  971.4    357   24.6   21.6"
    text = LIST.read_text()
    at = text.index(row, text.index(row) + 1)
    file = tmp_path / "air.txt"
    file.write_text(text[:at] + "  971.4    357   34.6   21.6" + text[at + len(row) :])
    with pytest.raises(
        InputError, match=r"line 13, temperature: two temperatures.*'34.6'.*24.6, as at line 12"
    ):
        read_sounding(file, time=NIGHT)
