"""What kind of file this is, told by its content."""

from __future__ import annotations

import gzip
import html
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final

from nigemizu.errors import InputError
from nigemizu.heat.reading.soundings.measures import column_of

__all__ = ["READABLE", "decoded", "kind_of", "names_columns", "opened"]

READABLE: Final = (
    "a sounding of the University of Wyoming (TEXT:LIST or CSV), an IGRA v2 data file (.txt, .zip or .gz), "
    "columns of a model in netCDF or Zarr, or a table in CSV or TOML"
)
_HEAD: Final = 65536
_LINES: Final = 50  # in which headings are looked for
_ZARR: Final = ("zarr.json", ".zgroup", ".zmetadata")
_MAGIC: Final = (
    (b"\xff\xd8\xff", "a JPEG picture", None),
    (b"\x89PNG", "a PNG picture", None),
    (b"GIF8", "a GIF picture", None),
    (b"%PDF", "a PDF document", "copy its table into a text file"),
    (b"GRIB", "GRIB", "convert it to netCDF (cdo -f nc copy, or choose netCDF when downloading)"),
    (b"BUFR", "BUFR", "take the same sounding from Wyoming or IGRA as text"),
    (b"PAR1", "a Parquet table", "write it as CSV"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook", "save it as CSV"),
    (b"\x0e\x03\x13\x01", "HDF4", "convert it to netCDF"),
)
_IGRA: Final = re.compile(r"^#[A-Z0-9]{11} \d{4} ", re.MULTILINE)
_IGRA_1: Final = re.compile(r"^#\d{5}\d{10}", re.MULTILINE)
_WYOMING: Final = re.compile(r"^[ \t]*PRES[ \t]+HGHT[ \t]+TEMP\b", re.MULTILINE)
_WYOMING_CSV: Final = re.compile(
    r"^[ \t]*time,longitude,latitude,pressure_hPa,", re.MULTILINE | re.IGNORECASE
)
_TOML: Final = re.compile(r"""^\s*["']?[\w \[\]()%°/-]+["']?\s*=\s*[\["'\d{tfni+-]""", re.MULTILINE)


def kind_of(path: Path) -> str:
    """``"wyoming"``, ``"wyoming-csv"``, ``"igra"``, ``"columns"``, ``"toml"`` or ``"csv"``.

    Raises
    ------
    InputError
        Nothing is there, or what is there cannot be read; the line says what it looks like.
    """
    file = str(path)
    if not path.exists():
        raise InputError("no such file", file=file, expected=READABLE)
    if path.is_dir():
        if any((path / name).exists() for name in _ZARR):
            return "columns"
        raise InputError("this is a folder", file=file, expected=READABLE)
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    if head[:4] == b"PK\x03\x04" or head[:2] == b"\x1f\x8b":
        with opened(path) as inner:
            head = inner.read(_HEAD)
    if head[:8] == b"\x89HDF\r\n\x1a\n" or head[:3] == b"CDF":
        return "columns"
    return _kind_of_text(_head_as_text(head, file), file)


def _head_as_text(head: bytes, file: str) -> str:
    if not head.strip():
        raise InputError("the file is empty", file=file, expected=READABLE)
    for magic, name, remedy in _MAGIC:
        if head.startswith(magic):
            raise InputError(f"this is {name}", file=file, expected=READABLE, remedy=remedy)
    text = decoded(head, file)
    odd = sum(character < " " and character not in "\t\n\r\f\x1a" for character in text)
    if odd > 0.01 * len(text):
        raise InputError(
            "this is binary, of no kind that is known here", file=file, value=head[:8], expected=READABLE
        )
    return text


def _kind_of_text(text: str, file: str) -> str:
    if _IGRA.search(text):
        return "igra"
    if _IGRA_1.search(text):
        raise InputError(
            "this is IGRA version 1",
            file=file,
            expected=READABLE,
            remedy="take the version 2 file of the station",
        )
    if _WYOMING.search(text):
        return "wyoming"
    if _WYOMING_CSV.search(text):
        return "wyoming-csv"
    if re.match(r"\s*<(!doctype|html|head|body)\b", text, re.IGNORECASE):
        raise InputError(
            "this is an HTML page"
            + (
                ", and its <PRE> holds no sounding"
                if re.search("<pre", text, re.IGNORECASE)
                else " without <PRE>"
            ),
            file=file,
            value=_first_words(re.sub(r"<(script|style).*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL | re.I)),
            expected=READABLE,
            remedy="save the page that shows the table of levels, or copy the table into a text file",
        )
    lines = [line for line in text.splitlines() if line.strip()]
    stated = [line for line in lines if not line.lstrip().startswith("#")]
    if stated and (_TOML.match(stated[0]) or re.fullmatch(r"\s*\[[\w.]+\]\s*", stated[0])):
        return "toml"
    if any(names_columns(line) for line in lines[:_LINES]) or _looks_like_table(stated[:4]):
        return "csv"
    raise InputError(
        "this is text, but no table of levels", file=file, value=_first_words(text), expected=READABLE
    )


def names_columns(line: str) -> bool:
    """Whether the line names two columns or more that are known."""
    for mark in (r"[,;\t]", r"\s{2,}", r"\s+(?![\[(])"):
        cells = re.split(mark, line.strip("# \t"))
        if sum(column_of(cell) is not None for cell in cells) > 1:
            return True
    return False


def _looks_like_table(lines: list[str]) -> bool:
    """Whether numbers follow a line that is parted by something, so that it is worth saying what is amiss."""
    parted = bool(lines) and re.search(r"[,;\t]|\S\s+\S+\s+\S", lines[0])
    return bool(parted) and any(re.match(r"[\s\"]*[-+]?[\d.]", line) for line in lines[1:])


def _first_words(text: str) -> str:
    return " ".join(html.unescape(text).split())[:60]


def decoded(data: bytes, file: str) -> str:
    """Text of any of the usual encodings.

    Raises
    ------
    InputError
        It is no text.
    """
    if b"\0" in data and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(
            "this is binary, of no kind that is known here", file=file, value=data[:8], expected=READABLE
        )
    for encoding in ("utf-16",) if data.startswith((b"\xff\xfe", b"\xfe\xff")) else ("utf-8-sig", "cp1252"):
        try:
            # A head may end within a character.
            return data.decode(encoding, errors="strict" if len(data) < _HEAD else "ignore")
        except UnicodeDecodeError:
            continue
    raise InputError(
        "this is binary, of no kind that is known here", file=file, value=data[:8], expected=READABLE
    )


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """The bytes of a file, unpacked if it is a .zip with one file or a .gz.

    Raises
    ------
    InputError
        A broken archive, or one that does not hold exactly one file.
    """
    with path.open("rb") as stream:
        magic = stream.read(4)
        stream.seek(0)
        try:
            if magic == b"PK\x03\x04":
                with zipfile.ZipFile(stream) as archive, archive.open(_only_member(archive, path)) as member:
                    yield member  # type: ignore[misc]
            elif magic[:2] == b"\x1f\x8b":
                with gzip.open(stream) as unpacked:
                    yield unpacked  # type: ignore[misc]
            else:
                yield stream
        except (zipfile.BadZipFile, gzip.BadGzipFile, EOFError) as error:
            raise InputError(
                "the archive is broken", file=str(path), remedy=f"download it again; the reader says: {error}"
            ) from error


def _only_member(archive: zipfile.ZipFile, path: Path) -> str:
    names = [info.filename for info in archive.infolist() if not info.is_dir()]
    if len(names) != 1:
        looks = "an Excel workbook" if "xl/workbook.xml" in names else f"an archive of {len(names)} files"
        raise InputError(
            f"this is {looks}",
            file=str(path),
            expected=READABLE,
            remedy="save it as CSV" if "xl/workbook.xml" in names else "unpack it and name one of them",
        )
    return names[0]
