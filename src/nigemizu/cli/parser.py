"""What may be typed. Nothing heavy is imported here, so that ``--help`` and mistakes answer at once."""

from __future__ import annotations

import argparse
import difflib
import importlib
import re
import shlex
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from nigemizu.cli import tables
from nigemizu.errors import InputError

__all__ = ["angles", "parse", "picture_size"]

_DESCRIPTION = "Mirages and heat shimmer from physics: heated air, bent light, pictures and films."
_EPILOG = """\
SCENE is the name of a built-in scene (see: nigemizu scenes) or a TOML file. Start with

  nigemizu render pyramid -o mirage.png
  nigemizu show pyramid > mine.toml      then edit mine.toml, and
  nigemizu render mine.toml -o mine.png
"""
_NEGATIVE = re.compile(r"-\.?\d")


class _Parser(argparse.ArgumentParser):
    """An `argparse.ArgumentParser` whose mistakes are one `InputError` line."""

    def error(self, message: str) -> NoReturn:
        raise InputError(message, remedy=f"see: {self.prog} --help")


def parse(typed: Sequence[str]) -> argparse.Namespace:
    """Understand a command line; the result's ``run`` is the verb to call with it.

    Raises
    ------
    InputError
        If it cannot be understood; the nearest verb or flag is named.
    """
    parser, verbs = _parsers()
    joined = _join_negative_values(typed)
    verb = next((word for word in joined if not word.startswith("-")), None)
    if verb is not None and joined[0] == verb and verb not in verbs:
        raise InputError("unknown verb", value=verb, remedy=_hint(verb, tuple(verbs)))
    options, unknown = parser.parse_known_args(joined)
    options.command = shlex.join(["nigemizu", *typed])
    if unknown:
        flag = unknown[0].partition("=")[0]
        if not flag.startswith("-"):
            raise InputError("one word too many", value=flag, remedy=f"see: nigemizu {options.verb} --help")
        raise InputError("unknown flag", value=flag, remedy=_hint(flag, tuple(_flags(verbs[options.verb]))))
    return options


def angles(text: str) -> tuple[float, ...]:
    """Read ``"-0.5,0,0.5"`` or ``"first:last:step"`` (both ends included), in degrees.

    Examples
    --------
    >>> angles("-0.5:0.5:0.25")
    (-0.5, -0.25, 0.0, 0.25, 0.5)
    """
    values: list[float] = []
    for part in text.split(","):
        try:
            numbers = [float(number) for number in part.split(":")]
        except ValueError:
            raise argparse.ArgumentTypeError(f"{part!r} is no angle; write -0.5,0 or -0.5:0.5:0.05") from None
        if len(numbers) == 1:
            values.extend(numbers)
            continue
        first, last, step = numbers if len(numbers) == 3 else (0.0, 0.0, 0.0)
        if step == 0.0 or (last - first) / step < 0:
            raise argparse.ArgumentTypeError(f"{part!r} is no range; write first:last:step")
        count = int((last - first) / step + 1e-9) + 1
        if count > 100_000:
            raise argparse.ArgumentTypeError(
                f"{part!r} makes {count} angles; at most 100000 are traced at once"
            )
        # Steps are counted, not added up, so that the range ends where it says.
        values.extend(round(first + index * step, 12) for index in range(count))
    return tuple(values)


def picture_size(text: str) -> tuple[int, int]:
    """Read ``"960x540"``."""
    match = re.fullmatch(r"(\d+)[xX×](\d+)", text.strip())
    if match is None or 0 in (int(match[1]), int(match[2])):
        raise argparse.ArgumentTypeError(f"{text!r} is no picture size; write WIDTHxHEIGHT such as 960x540")
    return int(match[1]), int(match[2])


def _positive(text: str) -> int:
    if not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no positive whole number")
    return int(text)


def _whole(text: str) -> int:
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number ≥ 0")
    return int(text)


def _time(text: str) -> float:
    from nigemizu.units import UnitError, to_unit

    try:
        return to_unit(text, "s")
    except UnitError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no time; write {error}") from None


def _seconds(text: str) -> float:
    value = _time(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no positive time")
    return value


def _quantity(unit: str) -> Callable[[str], float]:
    """Reads a number, with or without a unit."""

    def read(text: str) -> float:
        from nigemizu.units import UnitError, to_unit

        try:
            return to_unit(text, unit)
        except UnitError as error:
            raise argparse.ArgumentTypeError(f"{text!r} cannot be used; write {error}") from None

    return read


def _verb(name: str) -> Callable[[argparse.Namespace], int]:
    """The function for a verb, imported when it is called."""

    def run(options: argparse.Namespace) -> int:
        code: int = getattr(importlib.import_module("nigemizu.cli.verbs"), name)(options)
        return code

    return run


def _parsers() -> tuple[_Parser, dict[str, argparse.ArgumentParser]]:
    parser = _Parser(
        prog="nigemizu",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and leave")
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=_Parser)
    makers: dict[str, tuple[str, Callable[[argparse.ArgumentParser], None]]] = {
        "render": ("one picture", _render),
        "animate": ("the film", _animate),
        "simulate": ("the heated air alone, as a dataset", _simulate),
        "trace": ("bent rays as data or as the ray diagram", _trace),
        "measure": ("turbulence from the shimmer in a film", _measure),
        "scenes": ("list the built-in scenes", _nothing),
        "show": ("print a scene as TOML that can be edited", _show),
        "check": ("validate scene files", _check),
        "schema": ("print the JSON schema of scene files, for editors", _nothing),
        "doctor": ("say what this machine can run, and the remedy when it cannot", _json),
        "bench": ("the benchmark table", _json),
    }
    made: dict[str, argparse.ArgumentParser] = {}
    for name, (summary, fill) in makers.items():
        made[name] = verbs.add_parser(
            name, help=summary, description=f"{summary[0].upper()}{summary[1:]}.", allow_abbrev=False
        )
        fill(made[name])
        made[name].add_argument("--debug", action="store_true", help="show tracebacks and library warnings")
        made[name].set_defaults(run=_verb(name))
    return parser, made


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"nigemizu {version('nigemizu')}")
        parser.exit()


def _nothing(parser: argparse.ArgumentParser) -> None:
    """A verb without flags of its own."""


def _json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON on stdout")


def _check(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", nargs="+", help="built-in scene or TOML file")
    _set_flag(parser)


def _show(parser: argparse.ArgumentParser) -> None:
    _scene(parser)
    parser.add_argument("--plain", action="store_true", help="leave the comments out")


def _scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="built-in scene or TOML file")
    _set_flag(parser)


def _set_flag(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        dest="overrides",
        metavar="section.key=value",
        action="append",
        default=[],
        help="replace one value of the scene; may be repeated",
    )


def _work(parser: argparse.ArgumentParser) -> None:
    _scene(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress bars")
    parser.add_argument("--threads", type=_positive, metavar="N", help="processor threads to use")


def _light(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--air", metavar="AIR", help="take the air from this dataset (.zarr, .nc)")
    parser.add_argument("--method", choices=("bent", "straight", "layered"), help="how light travels")
    _device(parser, "compute device (default: auto)")


def _device(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--variant", choices=("auto", "llvm", "cuda"), default="auto", help=text)


def _picture(parser: argparse.ArgumentParser) -> None:
    _light(parser)
    parser.add_argument("--samples", "--spp", type=_positive, metavar="N", help="samples per pixel")
    parser.add_argument("--size", type=picture_size, metavar="WxH", help="picture size in pixels")
    parser.add_argument("--seed", type=_whole, metavar="N", help="seed of the pixel samples")
    parser.add_argument(
        "--stats",
        action="store_true",
        help="tell on stderr how the rays ended, how far they err, and the time",
    )
    parser.add_argument(
        "--truth",
        action="store_true",
        help="also write what each pixel sees: displacement, distance, turning height, the straight view",
    )


def _render(parser: argparse.ArgumentParser) -> None:
    _work(parser)
    _picture(parser)
    parser.add_argument("-o", "--output", metavar="OUT", help="picture to write, .png or .exr (SCENE.png)")
    parser.add_argument("--time", type=_time, metavar="SECONDS", help="instant to show")
    parser.add_argument(
        "--compare",
        action="store_true",
        help="straight, layered and bent in one labelled picture, and each alone",
    )


def _animate(parser: argparse.ArgumentParser) -> None:
    _work(parser)
    _picture(parser)
    parser.add_argument("-o", "--output", metavar="OUT", help="film to write, .mp4 (SCENE.mp4)")
    parser.add_argument("--start", type=_time, metavar="SECONDS", help="instant of the first frame")
    parser.add_argument("--duration", type=_seconds, metavar="SECONDS", help="time that passes in the scene")
    parser.add_argument("--frames", type=_positive, metavar="N", help="number of frames")
    parser.add_argument("--fps", type=_positive, metavar="N", help="frames per second when played")
    parser.add_argument("--workers", type=_positive, default=1, metavar="N", help="processes that render")


def _simulate(parser: argparse.ArgumentParser) -> None:
    _work(parser)
    _device(parser, "where air moves by itself: llvm is the processor, cuda a graphics card (default: auto)")
    parser.add_argument("-o", "--output", metavar="OUT", help="dataset to write, .zarr or .nc (SCENE.zarr)")
    parser.add_argument("--duration", type=_seconds, metavar="SECONDS", help="end of the simulated time")
    parser.add_argument("--every", type=_seconds, metavar="SECONDS", help="time between stored instants")


def _trace(parser: argparse.ArgumentParser) -> None:
    _work(parser)
    _light(parser)
    parser.add_argument(
        "-e", "--elevation", type=angles, metavar="DEG", help="above the horizontal: list or first:last:step"
    )
    parser.add_argument(
        "-a",
        "--azimuth",
        type=angles,
        metavar="DEG",
        help="from the camera's heading, to the left: list or range",
    )
    parser.add_argument("--time", type=_time, metavar="SECONDS", help="instant of the air")
    tables.add_flags(parser)
    _json(parser)
    parser.add_argument("-o", "--output", metavar="OUT", help="write .csv, .nc, .png or .svg")


def _measure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("film", metavar="FILM", help=".mp4, .gif, .webp, .avi, .nc, or a folder of frames")
    flags: tuple[tuple[str, Callable[[str], Any], str, str], ...] = (
        ("distance", _quantity("m"), "METRES", "to what the film shows; 1km is understood"),
        ("aperture", _quantity("m"), "METRES", "diameter of the lens, such as 50mm; 0 for a pinhole"),
        ("pixel-angle", _quantity("rad"), "RAD", "angle that a pixel spans"),
        ("focal-length", _quantity("m"), "METRES", "with --pixel-pitch in the place of --pixel-angle"),
        ("pixel-pitch", _quantity("m"), "METRES", "distance of the pixels on the sensor, such as 5um"),
        ("wavelength", _quantity("m"), "METRES", "of the light (550nm)"),
        ("inner-scale", _quantity("m"), "METRES", "size of the smallest eddies (0; a pinhole needs it)"),
        ("outer-scale", _quantity("m"), "METRES", "size of the largest eddies (no limit)"),
        ("cn2", float, "M^(-2/3)", "strength of the turbulence, to set the film against"),
        ("fps", float, "N", "frames per second, where the film does not say it or says it wrong"),
        ("tile", _positive, "PIXELS", "side of the tiles that are followed (16 to 64)"),
        ("search", _positive, "PIXELS", "how far they may move (12, or half a tile)"),
    )
    for name, kind, metavar, words in flags:
        parser.add_argument(f"--{name}", type=kind, metavar=metavar, help=words)
    parser.add_argument(
        "--wave", choices=("spherical", "plane"), help="light of a point at DISTANCE, or of a star"
    )
    parser.add_argument("--remove-shake", action="store_true", help="take out what moves all of the picture")
    parser.add_argument(
        "--points", action="store_true", help="take tiles for points, as the closed forms of textbooks do"
    )
    _json(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        action="append",
        default=[],
        help="write each tile (.csv, .nc) or a figure (.png, .svg); may be repeated",
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress bars")


def _flags(parser: argparse.ArgumentParser) -> list[str]:
    return re.findall(r"(?<![\w-])--?[a-z][\w-]*", parser.format_help())


def _hint(word: str, valid: tuple[str, ...]) -> str:
    close = difflib.get_close_matches(word, valid, n=1, cutoff=0.5)
    return f"did you mean {close[0]}?" if close else f"valid are {', '.join(dict.fromkeys(valid))}"


def _join_negative_values(typed: Sequence[str]) -> list[str]:
    """Attach values such as ``-0.5:0.5:0.1`` to their flag; argparse would take them for flags."""
    joined: list[str] = []
    for word in typed:
        previous = joined[-1] if joined else ""
        if _NEGATIVE.match(word) and previous.startswith("--"):
            joined[-1] = f"{previous}={word}"
        elif _NEGATIVE.match(word) and re.fullmatch(r"-[a-z]", previous):
            joined[-1] = f"{previous}{word}"
        else:
            joined.append(word)
    return joined
