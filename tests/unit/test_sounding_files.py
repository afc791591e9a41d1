"""The kind of a file is told by its content, and one line says what cannot be read."""

import shutil
import zipfile
from pathlib import Path

import pytest

from nigemizu.errors import InputError
from nigemizu.heat import read_sounding
from nigemizu.heat.reading.soundings.sniffing import kind_of

FILES = Path(__file__).resolve().parents[1] / "data" / "soundings"


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("wyoming_two.html", "wyoming"),
        ("wyoming_new.html", "wyoming"),
        ("wyoming.csv", "wyoming-csv"),
        ("USM00072357-data.txt", "igra"),
    ],
)
def test_the_name_does_not_matter(tmp_path, name, kind):
    shutil.copy(FILES / name, tmp_path / "picture.jpg")
    assert kind_of(tmp_path / "picture.jpg") == kind


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "the file is empty"),
        (b" \n\n", "the file is empty"),
        (b"\xff\xd8\xff\xe0\x00\x10JFIF", "this is a JPEG picture"),
        (b"\x89PNG\r\n\x1a\n\x00", "this is a PNG picture"),
        (b"%PDF-1.7 \xe2", "this is a PDF document.*copy its table"),
        (b"GRIB\x00\x00\x10\x02", "this is GRIB.*convert it to netCDF"),
        (b"BUFR\x00\x01\x10\x04", "this is BUFR"),
        (bytes(range(256)) * 20, "this is binary, of no kind that is known here"),
        (b"\x01\x02\x03\x04\x05\x06\x07 no text", "this is binary"),
        (
            b"<!DOCTYPE html><html><body><h1>404 Not Found</h1></body></html>",
            "an HTML page without <PRE> .*'404 Not Found'",
        ),
        (
            b"<html><pre>Can't get 72357 OUN</pre></html>",
            "HTML page, and its <PRE> holds no sounding .*Can't get",
        ),
        (
            b"Unable to retrieve the data for 03808 at 2026-07-21 03:00:00.",
            "this is text, but no table of levels .*Unable",
        ),
        (b"#72357197001010023001  36\n", "this is IGRA version 1"),
        (
            b"just a letter\nto nobody\n",
            r"this is text, but no table of levels \(got 'just a letter to nobody'\)",
        ),
    ],
)
def test_what_it_looks_like_is_said_in_one_line(tmp_path, data, words):
    file = tmp_path / "air.txt"
    file.write_bytes(data)
    with pytest.raises(InputError, match=words) as caught:
        read_sounding(file)
    line = str(caught.value)
    assert str(file) in line
    assert "\n" not in line
    assert "netCDF" in line


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"PK\x03\x04 broken", "the archive is broken; download it again"),
        (b"\x1f\x8b broken gz", "the archive is broken; download it again"),
        (b"CDF\x09 broken", "not a dataset that can be read"),
    ],
)
def test_broken_files(tmp_path, data, words):
    (tmp_path / "air").write_bytes(data)
    with pytest.raises(InputError, match=words):
        read_sounding(tmp_path / "air")


def test_nothing_there_a_folder_and_an_archive_of_many(tmp_path):
    with pytest.raises(InputError, match="no such file; expected a sounding of the University of Wyoming"):
        read_sounding(tmp_path / "none.txt")
    with pytest.raises(InputError, match="this is a folder"):
        read_sounding(tmp_path)
    for names, words in (
        (("a.txt", "b.txt"), "archive of 2 files"),
        (("xl/workbook.xml", "b"), "Excel.*CSV"),
    ):
        with zipfile.ZipFile(tmp_path / "many.zip", "w") as archive:
            for name in names:
                archive.writestr(name, "x")
        with pytest.raises(InputError, match=words):
            read_sounding(tmp_path / "many.zip")


def test_derived_parameters_of_igra(tmp_path):
    head = "#USM00072357 2026 07 01 00 2302   50" + "  -9999" * 18
    (tmp_path / "drvd.txt").write_text(head + "\n")
    with pytest.raises(InputError, match=r"line 1: this holds IGRA's derived parameters; .*-data.txt"):
        read_sounding(tmp_path / "drvd.txt")
