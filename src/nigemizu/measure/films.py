"""Films of ours or anyone's, frame by frame as grey values."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError

__all__ = ["Film", "open_film"]

Grey: TypeAlias = NDArray[np.float32]

_VIDEOS: Final = (".mp4", ".avi", ".mkv", ".mov", ".webm", ".m4v", ".mpg", ".ts")
_ANIMATIONS: Final = (".gif", ".webp")
_PICTURES: Final = (".png", ".exr", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp")
_DATA: Final = (".nc", ".nc4", ".cdf")
_LUMA: Final = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
_KINDS: Final = "a film (.mp4, .gif, .webp, .avi …), a folder of numbered frames, or netCDF (time, y, x)"


@final
@dataclass(frozen=True)
class Film:
    """A film that can be read several times, one frame in memory at a time.

    Attributes
    ----------
    path : Path
    shape : (int, int)
        Height and width in pixels.
    interval : float or None, s
        Time in the scene between two frames, where it is known.
    scene : mapping or None
        The scene of one of our own films, as its TOML.
    reader : callable
        Starts reading again; see `frames`.
    """

    path: Path
    shape: tuple[int, int]
    interval: float | None
    scene: Mapping[str, Any] | None
    reader: Callable[[], Iterator[Grey]]

    @classmethod
    def from_frames(cls, frames: Sequence[NDArray[Any]], *, interval: float | None = None) -> Film:
        """A film of frames in memory: (height, width) or (height, width, 3).

        White is 1, or the largest value of unsigned integers.

        Parameters
        ----------
        frames : sequence of ndarray, or (N, height, width) ndarray
        interval : float, s, optional
        """
        if not len(frames):
            raise InputError("a film needs frames", key="frames")
        first = _grey(np.asarray(frames[0]))
        shape = (first.shape[0], first.shape[1])
        return cls(
            Path("frames"), shape, interval, None, lambda: (_grey(np.asarray(frame)) for frame in frames)
        )

    def frames(self) -> Iterator[Grey]:
        """The frames in order, (height, width) float32; white is 1 where there is a white.

        Raises
        ------
        InputError
            A frame cannot be read, has another size, or holds a value that is not finite.
        """
        for number, frame in enumerate(self.reader()):
            if frame.shape != self.shape:
                raise InputError(
                    f"frame {number} has another size",
                    file=str(self.path),
                    value=frame.shape,
                    expected=f"{self.shape}",
                )
            if not np.isfinite(frame).all():
                raise InputError(f"frame {number} holds values that are not finite", file=str(self.path))
            yield frame


def open_film(path: str | Path) -> Film:
    """Open a film.

    Parameters
    ----------
    path : path
        A video that FFmpeg decodes, an animated GIF or WebP, a folder of numbered pictures (PNG, EXR, TIFF,
        JPEG), or netCDF with a variable (time, y, x) or (time, y, x, colour).

    Raises
    ------
    InputError
        It is missing or no film, or frames of the folder are missing.

    Notes
    -----
    Colours become luma. Linear values (EXR, netCDF) are divided by the 99.9th percentile of the first frame,
    and those of EXR raised to 1/2.2: displacements do not depend on the curve.
    """
    source = Path(path).expanduser()
    if not source.exists():
        raise InputError("no such film", file=str(source))
    suffix = source.suffix.lower()
    if source.is_dir():
        reader, interval = _folder(source)
    elif suffix in _DATA:
        reader, interval = _dataset(source)
    elif suffix in _ANIMATIONS:
        reader, interval = _animation(source)
    elif suffix in _VIDEOS:
        reader, interval = _video(source)
    else:
        raise InputError("is no film", file=str(source), expected=_KINDS)
    first = next(reader(), None)
    if first is None:
        raise InputError("holds no frames", file=str(source), expected=_KINDS)
    scene = _scene(source)
    if scene is not None and isinstance(scene.get("film"), Mapping):
        film = scene["film"]
        duration, count = film.get("duration"), film.get("frames")
        # slow motion: what passes in the scene counts, not how fast the film plays
        if isinstance(duration, int | float) and isinstance(count, int) and count > 0 and duration > 0:
            interval = duration / count
    return Film(source, (first.shape[0], first.shape[1]), interval, scene, reader)


def _grey(pixels: NDArray[Any]) -> Grey:
    values = pixels.astype(np.float32)
    if pixels.dtype.kind == "u":
        values /= np.float32(np.iinfo(pixels.dtype).max)
    return np.asarray(values @ _LUMA if values.ndim == 3 else values)


def _video(path: Path) -> tuple[Callable[[], Iterator[Grey]], float | None]:
    import av

    def read() -> Iterator[Grey]:
        number = 0
        try:
            with av.open(str(path)) as container:
                for frame in container.decode(video=0):
                    yield _grey(frame.to_ndarray(format="gray16le"))
                    number += 1
        except (av.FFmpegError, OSError) as error:
            where = f"cannot be read beyond frame {number}" if number else "is no film that can be read"
            raise InputError(where, file=str(path), expected=_KINDS) from error

    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise InputError("holds no pictures", file=str(path), expected=_KINDS)
            rate: Fraction | None = container.streams.video[0].average_rate
    except (av.FFmpegError, OSError) as error:
        raise InputError("is no film that can be read", file=str(path), expected=_KINDS) from error
    return read, (1 / float(rate)) if rate else None


def _animation(path: Path) -> tuple[Callable[[], Iterator[Grey]], float | None]:
    from PIL import Image, UnidentifiedImageError

    def read() -> Iterator[Grey]:
        try:
            with Image.open(path) as image:
                for number in range(getattr(image, "n_frames", 1)):
                    image.seek(number)
                    yield _grey(np.asarray(image.convert("RGB")))
        except (UnidentifiedImageError, OSError, EOFError) as error:
            raise InputError("is no film that can be read", file=str(path), expected=_KINDS) from error

    try:
        with Image.open(path) as image:
            if getattr(image, "n_frames", 1) > 1:
                image.seek(1)
                image.load()
            milliseconds = image.info.get("duration")
    except (UnidentifiedImageError, OSError, EOFError) as error:
        raise InputError("is no film that can be read", file=str(path), expected=_KINDS) from error
    return read, milliseconds / 1000 if milliseconds else None


def _folder(path: Path) -> tuple[Callable[[], Iterator[Grey]], float | None]:
    numbered: dict[int, Path] = {}
    for file in sorted(path.iterdir()):
        digits = re.search(r"(\d+)\D*$", file.stem)
        if file.suffix.lower() in _PICTURES and digits and not file.name.startswith("."):
            numbered[int(digits[1])] = file
    if not numbered:
        raise InputError("holds no numbered frames", file=str(path), expected="files such as 0000.png")
    if len({file.suffix.lower() for file in numbered.values()}) > 1:
        raise InputError("holds frames of several kinds", file=str(path), expected="all .png, or all .exr")
    missing = next((n for n in range(min(numbered), max(numbered)) if n not in numbered), None)
    if missing is not None:
        raise InputError(
            f"frame {missing} is missing", file=str(path), remedy="the frames must be equally far apart"
        )
    files = [numbered[number] for number in sorted(numbered)]

    def read() -> Iterator[Grey]:
        white: float | None = None
        for file in files:
            frame = _picture(file)
            if file.suffix.lower() == ".exr":
                white = _white(frame) if white is None else white
                frame = np.asarray((np.maximum(frame, 0.0) / white) ** (1 / 2.2), dtype=np.float32)
            yield frame

    return read, None


def _picture(file: Path) -> Grey:
    from nigemizu.output.pictures import read_picture

    if file.suffix.lower() == ".exr":
        return _grey(read_picture(file))
    from PIL import Image

    try:
        with Image.open(file) as image:
            deep = image.mode.startswith(("I", "F"))
            pixels = np.asarray(image if deep else image.convert("RGB"))
    except OSError as error:
        raise InputError("not a picture that can be read", file=str(file)) from error
    return _grey(pixels.astype(np.uint16) if pixels.dtype == np.int32 else pixels)


def _white(frame: Grey) -> float:
    return max(float(np.quantile(frame, 0.999)), 1e-30)


def _dataset(path: Path) -> tuple[Callable[[], Iterator[Grey]], float | None]:
    import netCDF4

    try:
        with netCDF4.Dataset(path) as data:
            name = _film_variable(data, path)
            interval = _interval(data, data[name].dimensions[0])
    except OSError as error:
        raise InputError("is no netCDF file that can be read", file=str(path), expected=_KINDS) from error

    def read() -> Iterator[Grey]:
        white: float | None = None
        with netCDF4.Dataset(path) as data:
            variable = data[name]
            for number in range(variable.shape[0]):
                values = np.ma.filled(variable[number].astype(np.float32), np.nan)
                frame = _grey(values[..., :3]) if values.ndim == 3 else values
                white = _white(frame) if white is None else white
                yield np.asarray(frame / np.float32(white), dtype=np.float32)

    return read, interval


def _film_variable(data: Any, path: Path) -> str:
    fitting = [
        str(name)
        for name, one in data.variables.items()
        if getattr(one.dtype, "kind", "") in "fiu"
        and (one.ndim == 3 or (one.ndim == 4 and one.shape[-1] in (3, 4)))
    ]
    if len(fitting) == 1:
        return fitting[0]
    raise InputError(
        "which variable is the film?" if fitting else "holds no film",
        file=str(path),
        value=", ".join(fitting) or ", ".join(map(str, data.variables)) or None,
        expected="one variable on (time, y, x) or (time, y, x, colour)",
    )


def _interval(data: Any, dimension: str) -> float | None:
    if dimension not in data.variables or data[dimension].shape[0] < 2:
        return None
    words = str(getattr(data[dimension], "units", "s")).split()[:1]
    factor = {"s": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "milliseconds": 1e-3}.get("".join(words))
    first, second = (float(value) for value in data[dimension][:2])
    return (second - first) * factor if factor and second > first else None


def _scene(path: Path) -> Mapping[str, Any] | None:
    """The scene of one of our own films, from the film itself or from its folder of frames."""
    text = _comment(path) if path.suffix.lower() == ".mp4" else None
    manifest = (
        path / "frames.json" if path.is_dir() else path.with_name(f"{path.stem}_frames") / "frames.json"
    )
    if text is None and manifest.is_file():
        try:
            text = json.loads(manifest.read_text(encoding="utf-8"))["origin"]["scene"]
        except (ValueError, KeyError, TypeError, OSError):
            return None
    try:
        return None if text is None else tomllib.loads(str(text))
    except tomllib.TOMLDecodeError:
        return None


def _comment(path: Path) -> str | None:
    import av

    with av.open(str(path)) as container:
        lines = str(container.metadata.get("comment", "")).splitlines()
    if not lines or not lines[0].startswith("nigemizu "):
        return None
    if lines[-1].startswith("nigemizu "):  # the command
        lines = lines[:-1]
    return "\n".join(lines[1:]) or None
