"""Pictures: linear radiance to PNG and EXR."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.output.files import write_bytes
from nigemizu.output.provenance import Provenance

__all__ = ["Highlights", "encoded", "read_picture", "write_exr", "write_picture", "write_png"]

Highlights: TypeAlias = Literal["clip", "soft", "film"]
_KNEE: Final = 0.8  # linear value above which soft highlights bend


def encoded(
    radiance: ArrayLike, *, exposure: float = 0.0, highlights: Highlights = "clip"
) -> NDArray[np.uint8]:
    """Linear radiance to 8-bit sRGB.

    Parameters
    ----------
    radiance : (height, width, 3) array_like
        Linear red, green, blue with Rec. 709 primaries; 1 is white.
    exposure : float, stops
        The radiance is multiplied by 2^exposure.
    highlights : {"clip", "soft", "film"}
        ``"clip"`` cuts at white; ``"soft"`` bends values above 0.8 towards it, with a continuous slope;
        ``"film"`` bends all, so that what is far too bright goes through yellow to white.

    Returns
    -------
    (height, width, 3) ndarray of uint8

    Raises
    ------
    InputError
        The shape is another, or a value is not finite.

    Notes
    -----
    s = 12.92 c for c ≤ 0.0031308, else 1.055 c^(1/2.4) − 0.055 (IEC 61966-2-1:1999), in 255 steps.
    Between two steps a pixel takes the upper one with the probability that keeps the mean: rounding to the
    nearest would draw contour lines into a smooth sky. The dither is a hash of row, column and channel, the
    same in every picture, so that films stay calm; what lies exactly on a step, as black and white do, stays
    there. Soft: c → k + (1 − k)(1 − exp(−(c − k)/(1 − k))) above k = 0.8, per channel. Film:
    c → 1 − exp(−c), per channel. Limits: an exposure and a transfer curve, no gamut mapping.

    Examples
    --------
    >>> encoded([[[0.0, 0.18, 1.0]]]).tolist()
    [[[0, 118, 255]]]
    """
    linear = _checked(radiance).astype(np.float64)
    if exposure:
        linear *= 2.0**exposure
    np.maximum(linear, 0.0, out=linear)
    if highlights == "soft":
        over = (linear - _KNEE) / (1.0 - _KNEE)
        linear = np.where(over > 0.0, _KNEE + (1.0 - _KNEE) * -np.expm1(-np.maximum(over, 0.0)), linear)
    elif highlights == "film":
        linear = -np.expm1(-linear)
    np.minimum(linear, 1.0, out=linear)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    curve[linear == 1.0] = 1.0  # which the formula misses by a rounding error
    return np.asarray(curve * 255.0 + _dither(*curve.shape)).astype(np.uint8)


def _dither(rows: int, columns: int, channels: int) -> NDArray[np.float64]:
    """Numbers from 0 to 1 (excluded), each a hash of its place: (rows, columns, channels)."""
    row, column, channel = np.ogrid[:rows, :columns, :channels]
    mixed = (row * 0x9E3779B1 + column * 0x85EBCA77 + channel * 0xC2B2AE3D).astype(np.uint32)
    # The finalizer of MurmurHash3: every bit of the place changes half of the bits of the hash.
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        mixed ^= mixed >> np.uint32(shift)
        mixed *= np.uint32(factor)
    mixed ^= mixed >> np.uint32(16)
    return np.asarray(mixed * 2.0**-32)


def write_png(
    path: str | Path,
    radiance: ArrayLike,
    *,
    exposure: float = 0.0,
    highlights: Highlights = "clip",
    provenance: Provenance | None = None,
) -> Path:
    """Write an 8-bit sRGB PNG.

    Parameters
    ----------
    path : path
    radiance : (height, width, 3) array_like
        Linear; or uint8, then already encoded.
    exposure, highlights
        As in `encoded`.
    provenance : Provenance, optional
        Kept in text chunks.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        As `encoded`; or the file cannot be written.
    MachineError
        The disk is full.
    """
    from PIL import Image, PngImagePlugin

    pixels = np.asarray(radiance)
    if pixels.dtype != np.uint8:
        pixels = encoded(pixels, exposure=exposure, highlights=highlights)
    _check_shape(pixels)
    info = PngImagePlugin.PngInfo()
    info.add(b"sRGB", b"\x00")
    for name, text in (provenance or Provenance()).fields().items():
        info.add_itxt(name, text)
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, format="png", pnginfo=info, compress_level=6)
    return write_bytes(Path(path), buffer.getvalue())


def write_exr(
    path: str | Path,
    radiance: ArrayLike,
    *,
    half: bool = False,
    provenance: Provenance | None = None,
) -> Path:
    """Write linear radiance, unchanged, to OpenEXR.

    Parameters
    ----------
    path : path
    radiance : (height, width, 3) array_like
    half : bool
        16 bits per value instead of 32.
    provenance : Provenance, optional
        Kept in the header.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        As `encoded`; or the file cannot be written.
    MachineError
        The disk is full.
    """
    import OpenEXR

    pixels = _checked(radiance)
    if half:
        # the largest finite half, so that the sun stays finite
        pixels = np.clip(pixels, -65504.0, 65504.0).astype(np.float16)
    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= {name.lower(): text for name, text in (provenance or Provenance()).fields().items()}
    buffer = io.BytesIO()
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels)}).write(buffer)
    return write_bytes(Path(path), buffer.getvalue())


def write_picture(
    path: str | Path,
    radiance: ArrayLike,
    *,
    exposure: float = 0.0,
    highlights: Highlights = "clip",
    provenance: Provenance | None = None,
) -> Path:
    """Write a picture as its extension says: `write_png` for ``.png``, `write_exr` for ``.exr``.

    Raises
    ------
    InputError
        Another extension; or as those two.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".png":
        return write_png(path, radiance, exposure=exposure, highlights=highlights, provenance=provenance)
    if suffix == ".exr":
        return write_exr(path, np.asarray(radiance, np.float32) * 2.0**exposure, provenance=provenance)
    raise InputError("unknown kind of picture", file=str(path), value=suffix, expected=".png or .exr")


def read_picture(path: str | Path) -> NDArray[Any]:
    """Read a PNG as (height, width, 3) uint8, or an EXR as (height, width, 3) float32 or float16.

    Raises
    ------
    InputError
        The file is missing or is not such a picture.
    """
    source = Path(path)
    if not source.is_file():
        raise InputError("no such picture", file=str(source))
    if source.suffix.lower() == ".exr":
        import OpenEXR

        try:
            with OpenEXR.File(str(source)) as file:
                return np.array(file.channels()["RGB"].pixels)
        except (RuntimeError, KeyError) as error:
            raise InputError(
                "not a picture that can be read", file=str(source), expected="an RGB EXR"
            ) from error
    from PIL import Image

    try:
        with Image.open(source) as image:
            return np.asarray(image.convert("RGB"))
    except OSError as error:
        raise InputError("not a picture that can be read", file=str(source)) from error


def _checked(radiance: ArrayLike) -> NDArray[np.float32]:
    pixels = np.asarray(radiance, dtype=np.float32)
    _check_shape(pixels)
    finite = np.isfinite(pixels)
    if not finite.all():
        row, column, _ = (int(index) for index in np.argwhere(~finite)[0])
        raise InputError(
            f"{int((~finite).sum())} values are not finite, the first at row {row}, column {column}",
            key="radiance",
        )
    return pixels


def _check_shape(pixels: NDArray[Any]) -> None:
    if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape:
        raise InputError(
            "not a picture", key="radiance", value=pixels.shape, expected="the shape (height, width, 3)"
        )
