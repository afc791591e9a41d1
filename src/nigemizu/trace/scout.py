"""Where along the bent rays of a picture objects can be near at all: found once for blocks of pixels."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from nigemizu.field import Field
from nigemizu.trace.stations import Stations, fly
from nigemizu.trace.view import View

__all__ = ["BLOCK", "Segments", "scout"]

FloatArray = NDArray[np.float64]

BLOCK: Final = (16, 8)  # pixels across and down; air is layered, and so is its picture
MOST_SEGMENTS: Final = 6  # per block; what is more is joined
_STATIONS: Final = 128  # along a ray, their distances growing by a constant factor
_FIRST_STATION: Final = 5.0  # m
_BETWEEN: Final = 0.5  # of the spread of a block's corners, by which rays between them may leave it
_DOWN: Final = 8  # rows of scouts in a block: where images fold, some between pass lower than its corners
_AHEAD: Final = 0.3  # of the spread of the corners' own contacts, by which a segment begins before them
_LEAST_MARGIN: Final = 1e-4  # m
_APART: Final = 1.5  # largest ratio of the corners' contacts of which that is enough
_FLAT: Final = 1e-3  # m
_MANY: Final = 1 << 30  # in place of the number of a box, where there are several


@final
@dataclass(frozen=True)
class Segments:
    """Pieces of the rays that must be tested against objects; B blocks, up to M segments each.

    Attributes
    ----------
    columns, rows : int
        Number of blocks across and down; B = rows × columns, numbered along the rows.
    start : (B, M, 4) float64, m
        Path length at which each begins for the rays at the upper left, upper right, lower left and lower
        right corner of the block, linear in between; `last` where there is no segment.
    end : (B, M) float64, m
        Path length at which each ends.
    count : (B,) int64
        Number of segments.
    last : (B,) float64, m
        From where on the rays are straight and meet what they meet.
    lost : (B,) bool
        Whether a corner's ray ran out of steps.
    looks : (B,) bool
        Whether the straight rays can meet anything behind `last`.
    buried : (B,) bool
        Whether all rays have met the ground before `last`, so that they show nothing beyond it.
    flown : int
        Rays that were flown to find them.
    """

    columns: int
    rows: int
    start: FloatArray
    end: FloatArray
    count: NDArray[np.int64]
    last: FloatArray
    lost: NDArray[np.bool_]
    looks: NDArray[np.bool_]
    buried: NDArray[np.bool_]
    flown: int


def scout(
    field: Field,
    view: View,
    boxes: FloatArray,
    *,
    accuracy: float,
    max_steps: int,
    farthest: float,
    floor: float = -np.inf,
) -> Segments:
    """Fly rays at the corners and down the sides of blocks of pixels, and compare their ways with objects.

    Parameters
    ----------
    field : Field
    view : View
    boxes : (N, 2, 3) float64, m
        Lower and upper corners of boxes that together contain every surface.
    accuracy : float, rad
    max_steps : int
    farthest : float, m
        Path length beyond which nothing is bent.
    floor : float, m
        Height of a ground below which no light gets.

    Returns
    -------
    Segments

    Notes
    -----
    Between two stations the scouts of a block, its corners and some down its sides, sweep a box whose
    faces move linearly, widened by how far the bent paths stray from their chords, by half of its own
    width (for the rays between the scouts) and by the accuracy. The interval in which it overlaps an
    object's box is found in closed form.
    Where there is one flat box only, a ground, that all four corners' rays meet, the segment begins
    at each corner where its own ray comes near, a little earlier for what lies between them.

    Limits: a ray between the scouts that leaves the widened sweep, as in a fold of the image thinner than a
    pixel, is not looked after, and may miss what it ought to meet.
    """
    columns, rows = (max(1, int(np.ceil(n / size))) for n, size in zip(view.size, BLOCK, strict=True))
    s = np.concatenate([[0.0], np.geomspace(min(_FIRST_STATION, farthest / 2), farthest, _STATIONS)])
    down = np.arange(_DOWN * rows + 1.0) * (BLOCK[1] / _DOWN)
    y, x = np.meshgrid(down, np.arange(columns + 1.0) * BLOCK[0], indexing="ij")
    records, offsets = _fly_corners(field, view, x.ravel(), y.ravel(), s[1:], accuracy, max_steps)
    lattice = (_STATIONS, _DOWN * rows + 1, columns + 1)
    outside = np.asarray(records.outside, dtype=bool).reshape(lattice)
    lit = np.asarray(records.lowest).reshape(lattice) >= floor
    # A ray between scouts that have all met the ground may pass above it: those next to a ray of light may.
    gone = ~_any_in_blocks(~outside & _with_neighbours(lit), rows)
    lost = _any_in_blocks(np.asarray(records.lost, dtype=bool).reshape(lattice)[-1:], rows)[0]
    # One behind the first station from which all scouts fly straight, or are lost to light: rays between
    # them may be bent a little longer.
    exits = np.where(gone.any(axis=0), gone.argmax(axis=0) + 1, _STATIONS - 1)
    exits = np.minimum(exits, _STATIONS - 1)
    last = s[1:][exits]
    buried = ~_any_in_blocks(_with_neighbours(lit[-1:]), rows)[0]
    contacts = _contacts(field, view, boxes, records, offsets, columns, rows, s, accuracy)
    start, end, count = _join(contacts, last, np.ptp(boxes, axis=1)[:, 2] < _FLAT)
    looks = np.any((contacts.end > last) & (contacts.end >= contacts.begin), axis=0) & ~buried
    return Segments(columns, rows, start, end, count, last, lost, looks, buried, x.size)


@final
@dataclass(frozen=True)
class _Contacts:
    """Per interval and block, (K, B): where objects can be near.

    Attributes
    ----------
    begin, end : (K, B) float64, m
        Path lengths between which any is; begin > end where none is.
    box : (K, B) int64
        Number of the box, `_MANY` where there are several.
    corners : (K, B, 4) float64, m
        Path length at which each corner's own ray comes near a box; infinite where it does not.
    """

    begin: FloatArray
    end: FloatArray
    box: NDArray[np.int64]
    corners: FloatArray


def _fly_corners(
    field: Field,
    view: View,
    x: FloatArray,
    y: FloatArray,
    lengths: FloatArray,
    accuracy: float,
    max_steps: int,
) -> tuple[Any, list[Any]]:
    """Records at every station of the corners' rays, and their offsets from the eye in the view's frame.

    The state of ray i at station k stands at k · (number of rays) + i.
    """
    types = field.types
    UInt32 = types.UInt32
    count = len(x)
    eye, direction = view.rays(types, x, y)
    records = fly(
        field,
        eye,
        direction,
        accuracy=dr.opaque(types.Float, accuracy),
        max_steps=dr.opaque(UInt32, max_steps),
        stations=Stations(
            lengths=types.Float(lengths),
            first=UInt32(0),
            step=UInt32(1),
            count=dr.opaque(UInt32, len(lengths)),
            target=dr.arange(UInt32, count),
            stride=dr.opaque(UInt32, count),
        ),
        size=count * len(lengths),
        ways_only=True,
    )
    dr.eval(records.position)
    way = dr.tile(direction, len(lengths))
    offset = view.to_frame(way, types.Array3f(*records.position) - eye)
    dr.eval(offset)
    return records, [offset.x, offset.y, offset.z]


def _any_in_blocks(scouts: NDArray[np.bool_], rows: int) -> NDArray[np.bool_]:
    """Whether it holds for any scout of each block: of (K, rows of scouts, columns + 1), (K, blocks)."""
    strips = [scouts[:, number::_DOWN][:, :rows] for number in range(_DOWN + 1)]
    sides = np.logical_or.reduce(strips)
    return np.asarray(sides[..., :-1] | sides[..., 1:]).reshape(len(scouts), -1)


def _with_neighbours(scouts: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether it holds for a scout (K, rows of scouts, columns + 1) or one next to it."""
    rows = np.pad(scouts, ((0, 0), (1, 1), (0, 0)))
    rows = rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]
    columns = np.pad(rows, ((0, 0), (0, 0), (1, 1)))
    return np.asarray(columns[..., :-2] | columns[..., 1:-1] | columns[..., 2:])


def _strips(types: Any, offsets: list[Any], stray: Any, columns: int, rows: int) -> tuple[list[Any], Any]:
    """Extremes of the scouts down each side of a row of blocks, at every station.

    Returns the least and greatest offset along each axis (3 × 2 × Float), and the greatest stray. The strip
    on the left of the blocks in column c of row r at station k stands at ((k · rows) + r)(columns + 1) + c.
    """
    UInt32, Float = types.UInt32, types.Float
    lane = dr.arange(UInt32, _STATIONS * rows * (columns + 1))
    side, row = lane % (columns + 1), lane // (columns + 1)
    station, row = row // rows, row % rows
    first = (station * (_DOWN * rows + 1) + row * _DOWN) * (columns + 1) + side
    index = [first + number * (columns + 1) for number in range(_DOWN + 1)]
    extremes = []
    for offset in offsets:
        places = [dr.gather(Float, offset, i) for i in index]
        extremes.append((functools.reduce(dr.minimum, places), functools.reduce(dr.maximum, places)))
    strays = functools.reduce(dr.maximum, [dr.gather(Float, stray, i) for i in index])
    dr.eval(extremes, strays)
    return extremes, strays


def _contacts(
    field: Field,
    view: View,
    boxes: FloatArray,
    records: Any,
    offsets: list[Any],
    columns: int,
    rows: int,
    s: FloatArray,
    accuracy: float,
) -> _Contacts:
    """Compare the boxes that blocks and their corners sweep with those of the objects.

    Symbols: l, u lower and upper faces of a swept box, at the near (0) and far (1) end of the interval.
    """
    types = field.types
    Float, UInt32 = types.Float, types.UInt32
    blocks, intervals = columns * rows, len(s) - 1
    rays = (_DOWN * rows + 1) * (columns + 1)
    lane = dr.arange(UInt32, blocks * intervals)
    interval, block = lane // blocks, lane % blocks
    row, column = block // columns, block % columns
    lengths = Float(s)
    s0, s1 = dr.gather(Float, lengths, interval), dr.gather(Float, lengths, interval + 1)
    began = interval > 0  # at the eye all rays are in one point
    extremes, strays = _strips(types, offsets, records.stray, columns, rows)
    left = (interval * rows + row) * (columns + 1) + column
    stray = dr.maximum(dr.gather(Float, strays, left), dr.gather(Float, strays, left + 1))
    whole: list[Any] = []
    for least, greatest in extremes:
        ends = []
        for strip, length, there in ((left - rows * (columns + 1), s0, began), (left, s1, True)):
            low, high = (
                fold(dr.gather(Float, side, strip, there), dr.gather(Float, side, strip + 1, there))
                for fold, side in ((dr.minimum, least), (dr.maximum, greatest))
            )
            margin = dr.fma(high - low, _BETWEEN, dr.fma(length, accuracy, stray)) + _LEAST_MARGIN
            ends += [low - margin, high + margin]
        whole.append((ends[0], ends[2], ends[1], ends[3]))
    own: list[list[Any]] = []
    upper = interval * rays + row * (_DOWN * (columns + 1)) + column
    lower = upper + _DOWN * (columns + 1)
    for corner in (upper, upper + 1, lower, lower + 1):
        margin = dr.fma(s1, accuracy, dr.gather(Float, records.stray, corner)) + _LEAST_MARGIN
        faces = []
        for offset in offsets:
            begin = dr.gather(Float, offset, corner - rays, began)
            end = dr.gather(Float, offset, corner)
            faces.append((begin - margin, end - margin, begin + margin, end + margin))
        own.append(faces)
    if not len(boxes):
        empty = np.full((intervals, blocks), np.inf)
        return _Contacts(
            empty, -empty, np.zeros(empty.shape, dtype=np.int64), np.full((*empty.shape, 4), np.inf)
        )
    first, final, box, touches = _sweep(types, whole, own, view.boxes(boxes))
    begin, end = dr.fma(s1 - s0, first, s0), dr.fma(s1 - s0, final, s0)
    contacts = [dr.select(t <= 1, dr.fma(s1 - s0, t, s0), dr.inf) for t in touches]
    dr.eval(first, begin, end, box, contacts)
    shape = (intervals, blocks)
    none = np.asarray(first).reshape(shape) > 1
    return _Contacts(
        np.where(none, np.inf, np.asarray(begin, dtype=np.float64).reshape(shape)),
        np.where(none, -np.inf, np.asarray(end, dtype=np.float64).reshape(shape)),
        np.asarray(box, dtype=np.int64).reshape(shape),
        np.stack([np.asarray(c, dtype=np.float64).reshape(shape) for c in contacts], axis=2),
    )


@dr.syntax
def _sweep(types: Any, whole: Any, own: Any, boxes: FloatArray) -> tuple[Any, Any, Any, Any]:
    """Fractions of the interval between which the block's sweep overlaps any box (2 and −1 if none), the
    number of the box, and the fraction at which each corner's own sweep first does."""
    Float, UInt32 = types.Float, types.UInt32
    flat = Float(boxes.ravel())
    b, count = UInt32(0), dr.opaque(UInt32, len(boxes))
    first, final = whole[0][0] * 0 + 2, whole[0][0] * 0 - 1
    box = UInt32(first) * 0
    touch0, touch1, touch2, touch3 = Float(first), Float(first), Float(first), Float(first)
    while dr.hint(b < count, label="compare with boxes"):
        lower = [dr.gather(Float, flat, b * 6 + axis) for axis in range(3)]
        upper = [dr.gather(Float, flat, b * 6 + 3 + axis) for axis in range(3)]
        t0, t1 = _overlap(whole, lower, upper)
        meets = t0 <= t1
        box = dr.select(meets, dr.select(first > 1, b, UInt32(_MANY)), box)
        first = dr.select(meets, dr.minimum(first, t0), first)
        final = dr.select(meets, dr.maximum(final, t1), final)
        touch0 = dr.minimum(touch0, _touch(own[0], lower, upper))
        touch1 = dr.minimum(touch1, _touch(own[1], lower, upper))
        touch2 = dr.minimum(touch2, _touch(own[2], lower, upper))
        touch3 = dr.minimum(touch3, _touch(own[3], lower, upper))
        b += 1
    return first, final, box, [touch0, touch1, touch2, touch3]


def _touch(faces: Any, lower: list[Any], upper: list[Any]) -> Any:
    t0, t1 = _overlap(faces, lower, upper)
    return dr.select(t0 <= t1, t0, 2)


def _overlap(faces: Any, lower: list[Any], upper: list[Any]) -> tuple[Any, Any]:
    """Fractions between which a box whose faces move linearly overlaps a box at rest."""
    t0, t1 = 0.0, 1.0
    for (l0, l1, u0, u1), low, high in zip(faces, lower, upper, strict=True):
        a0, a1 = _negative(l0 - high, l1 - high)
        c0, c1 = _negative(low - u0, low - u1)
        t0, t1 = dr.maximum(t0, dr.maximum(a0, c0)), dr.minimum(t1, dr.minimum(a1, c1))
    return t0, t1


def _negative(a0: Any, a1: Any) -> tuple[Any, Any]:
    """Interval of [0, 1] in which the line from a0 to a1 is not positive; (2, −1) if nowhere."""
    slope = a0 - a1
    zero = a0 / dr.select(slope == 0, 1, slope)
    begin = dr.select(a0 <= 0, 0, dr.select(a1 <= 0, zero, 2))
    end = dr.select(a1 <= 0, 1, dr.select(a0 <= 0, zero, -1))
    return begin, end


def _join(
    contacts: _Contacts, last: FloatArray, flat: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Join what lies in neighbouring intervals, and cut it where the rays are straight to their end.

    `flat` tells the boxes that have no height. Returns starts (B, M, 4), ends (B, M) and their number (B,).
    """
    intervals, blocks = contacts.begin.shape
    start = np.repeat(last[:, None], MOST_SEGMENTS, axis=1)
    stop = start.copy()
    box = np.full(start.shape, _MANY)
    corner = np.full((*start.shape, 4), np.inf)
    count = np.zeros(blocks, dtype=np.int64)
    every = np.arange(blocks)
    for k in range(intervals):
        begin, end = contacts.begin[k], np.minimum(contacts.end[k], last)
        here = (begin <= end) & (begin < last)
        current = np.maximum(count - 1, 0)
        # Segments that touch, and those for which no place is left, go on.
        goes_on = here & (count > 0)
        goes_on &= (begin <= stop[every, current] * (1 + 1e-6)) | (count == MOST_SEGMENTS)
        on, off = np.flatnonzero(goes_on), np.flatnonzero(here & ~goes_on)
        stop[on, current[on]] = end[on]
        other = contacts.box[k, on] != box[on, current[on]]
        box[on[other], current[on[other]]] = _MANY
        corner[on, current[on]] = np.minimum(corner[on, current[on]], contacts.corners[k, on])
        start[off, count[off]] = begin[off]
        stop[off, count[off]] = end[off]
        box[off, count[off]] = contacts.box[k, off]
        corner[off, count[off]] = contacts.corners[k, off]
        count[off] += 1
    most = max(1, int(count.max(initial=0)))
    start, stop, corner, box = start[:, :most], stop[:, :most], corner[:, :most], box[:, :most]
    # The corners' own contacts where there is one box that all four of them meet. It must be flat: others are
    # entered by a side, too, and then later than rays between the corners enter by the front,
    earliest, latest = corner.min(axis=2), corner.max(axis=2)
    # and these not too far apart for the plane through them: towards grazing they grow like 1/θ.
    single = np.append(flat, False)[np.minimum(box, len(flat))]
    own = single & np.isfinite(latest) & (latest <= _APART * earliest)
    with np.errstate(invalid="ignore"):
        ahead = np.maximum(corner - _AHEAD * (latest - earliest)[..., None], start[..., None])
    return np.where(own[..., None], ahead, start[..., None]), stop, count
