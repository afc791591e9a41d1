"""Films from frames: H.264 for players, animated GIF and WebP for pages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError, MachineError
from nigemizu.output.files import whole_file
from nigemizu.output.pictures import encoded, read_picture
from nigemizu.output.provenance import Provenance
from nigemizu.progress import SILENT, ProgressMeter

__all__ = ["write_film"]

Pixels: TypeAlias = NDArray[np.uint8]
_Frames: TypeAlias = Iterable[Pixels]


def write_film(
    path: str | Path,
    frames: Iterable[str | Path | NDArray[Any]],
    *,
    fps: float,
    quality: int = 18,
    width: int | None = None,
    exposure: float = 0.0,
    provenance: Provenance | None = None,
    progress: ProgressMeter = SILENT,
) -> Path:
    """Write a film; the frames are read one by one.

    Parameters
    ----------
    path : path
        ``.mp4`` (H.264, 4:2:0, fast start: what ordinary players and browsers open), ``.gif`` or ``.webp``.
    frames : iterable of path or (height, width, 3) array
        PNG or EXR files, or arrays: uint8 is taken as sRGB, floats as linear radiance.
    fps : float, Hz
        Frames per second, up to 240; a GIF counts in hundredths of a second.
    quality : int
        x264's constant rate factor, 0 to 51; smaller is better.
    width : int, pixels, optional
        Scales the film down to this width.
    exposure : float, stops
        For linear frames.
    provenance : Provenance, optional
        Kept in the MP4's comment.
    progress : ProgressMeter
        Advances by the frames written.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Unknown extension, no frames, frames of different size, or a file that cannot be read or written.
    MachineError
        The disk is full, or there is no H.264 encoder.

    Notes
    -----
    H.264 with 4:2:0 needs even sides: an odd one is completed by repeating its last row or column. Colours
    are tagged and converted as Rec. 709, limited range.
    """
    target = Path(path)
    writer = _WRITERS.get(target.suffix.lower())
    if writer is None:
        raise InputError(
            "unknown kind of film", file=str(target), value=target.suffix, expected=", ".join(_WRITERS)
        )
    if not 0.01 <= fps <= 240.0:
        raise InputError(
            "impossible frame rate", key="fps", value=fps, expected="0.01 to 240 frames per second"
        )
    sources = list(frames) if isinstance(frames, list | tuple) else frames
    if isinstance(sources, list) and not sources:
        raise InputError("a film needs at least one frame", key="frames", file=str(target))
    progress.start("writing the film", len(sources) if isinstance(sources, list) else 0)
    try:
        with whole_file(target) as temporary:
            writer(
                temporary,
                _pixels(sources, width, exposure, progress),
                fps,
                quality,
                provenance or Provenance(),
            )
    finally:
        progress.finish()
    return target


def _pixels(
    frames: Iterable[str | Path | NDArray[Any]], width: int | None, exposure: float, progress: ProgressMeter
) -> _Frames:
    from PIL import Image

    size: tuple[int, ...] | None = None
    for number, frame in enumerate(frames):
        values = read_picture(frame) if isinstance(frame, str | Path) else frame
        pixels = values if values.dtype == np.uint8 else encoded(values, exposure=exposure)
        if size not in (None, pixels.shape):
            raise InputError(
                f"frame {number} has another size", key="frames", value=pixels.shape, expected=f"{size}"
            )
        size = pixels.shape
        if width is not None and width < pixels.shape[1]:
            height = max(1, round(pixels.shape[0] * width / pixels.shape[1]))
            image = Image.fromarray(pixels).resize((width, height), Image.Resampling.LANCZOS)
            pixels = np.asarray(image)
        yield pixels
        progress.advance()
    if size is None:
        raise InputError("a film needs at least one frame", key="frames")


def _write_mp4(path: Path, frames: _Frames, fps: float, quality: int, provenance: Provenance) -> None:
    import av
    from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc

    if "libx264" not in av.codecs_available:
        raise MachineError(
            "this PyAV has no H.264 encoder; install PyAV's own wheel: pip install --force-reinstall av"
        )
    rate = Fraction(fps).limit_denominator(1001)
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        container.metadata["comment"] = "\n".join(provenance.fields().values())
        stream: Any = None
        for pixels in frames:
            rows, columns = pixels.shape[0] % 2, pixels.shape[1] % 2
            even = np.pad(pixels, ((0, rows), (0, columns), (0, 0)), mode="edge")
            if stream is None:
                options = {"crf": str(quality), "preset": "slow"}
                stream = container.add_stream("libx264", rate=rate, options=options)
                stream.height, stream.width = even.shape[:2]
                stream.pix_fmt = "yuv420p"
                context = stream.codec_context
                context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
                context.color_primaries, context.color_trc = ColorPrimaries.BT709, ColorTrc.BT709
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")
            frame = frame.reformat(
                format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
            )
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _write_gif(path: Path, frames: _Frames, fps: float, _quality: int, _provenance: Provenance) -> None:
    from PIL import Image

    images = [Image.fromarray(pixels) for pixels in frames]
    # One palette for all, from a few frames side by side: colours that change with every frame would flicker.
    chosen = images[:: max(1, len(images) // 6)]
    strip = Image.new("RGB", (images[0].width, images[0].height * len(chosen)))
    for number, image in enumerate(chosen):
        strip.paste(image, (0, number * image.height))
    palette = strip.quantize(256, method=Image.Quantize.MEDIANCUT)
    reduced = [image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for image in images]
    centiseconds = max(2, round(100 / fps))
    reduced[0].save(
        path,
        format="gif",
        save_all=True,
        append_images=reduced[1:],
        duration=10 * centiseconds,
        loop=0,
        optimize=False,
    )


def _write_webp(path: Path, frames: _Frames, fps: float, _quality: int, _provenance: Provenance) -> None:
    from PIL import Image

    images = [Image.fromarray(pixels) for pixels in frames]
    images[0].save(
        path,
        format="webp",
        save_all=True,
        append_images=images[1:],
        duration=round(1000 / fps),
        loop=0,
        quality=80,
        method=4,
    )


_WRITERS: Final[Mapping[str, Callable[[Path, _Frames, float, int, Provenance], None]]] = MappingProxyType(
    {".mp4": _write_mp4, ".gif": _write_gif, ".webp": _write_webp}
)
