"""Shared paths: a picture's rays take the bend of the air from a table, and are marched near objects only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, final

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from nigemizu.field import Field, Types
from nigemizu.trace.ends import ESCAPED, HIT, NOT_TRACED, STOPPED, RayEnd
from nigemizu.trace.march import march
from nigemizu.trace.scout import BLOCK, Segments
from nigemizu.trace.surfaces import Surface
from nigemizu.trace.table import PathTable
from nigemizu.trace.view import View

__all__ = ["INTEGRATION", "SharedPaths", "SharingReport"]

INTEGRATION: Final = 0.05  # of the accuracy, for the integration: cells, not the accuracy, decide the steps
_NEAR: Final = 0.2  # the same within a segment
_MOST_LEVERAGE: Final = 50.0
_SHORT: Final = 0.3  # of the way to its end, that a segment may take up and count as short
_FEW: Final = 0.05  # of all segments, that may be longer
_SEAM: Final = 0.01  # of the way, by which the last piece is looked along before it begins


@final
@dataclass(frozen=True)
class SharingReport:
    """What the table of shared paths holds.

    Attributes
    ----------
    paths : int
        Rays that were flown for it.
    steps : float
        Mean steps of each.
    shared : float
        Fraction of the picture whose rays share their paths; the others are marched one by one.
    error : float, rad
        Largest estimated displacement that the sharing adds.
    segments : float
        Mean number of pieces per block on which rays are tested against objects.
    """

    paths: int
    steps: float
    shared: float
    error: float
    segments: float


@final
class SharedPaths:
    """A table of paths on the device, and how rays follow them. Made by `share_paths`.

    Notes
    -----
    A ray finds its block of pixels and, for each segment of it, the state at the segment's beginning,
    interpolated between the four nearest nodes; from there it is marched through the field and tested
    against the surface up to the segment's end. Between segments nothing can be met. Rays in blocks that
    are not smooth are marched from the eye.

    Attributes
    ----------
    report : SharingReport
    everywhere : bool
        Whether all blocks are shared.
    short : bool
        Whether the segments are short against the way to them, so that steps need not heed every cell.
    """

    def __init__(self, types: Types, view: View, segments: Segments, table: PathTable) -> None:
        Float, UInt32 = types.Float, types.UInt32
        self.types = types
        self.view = view
        self._columns = dr.opaque(UInt32, segments.columns)
        self._rows = dr.opaque(UInt32, segments.rows)
        self._most = dr.opaque(UInt32, segments.start.shape[1])
        shared = table.cells[:, 0] > 0
        torn = table.torn_share
        self.everywhere = bool(shared.all()) and torn == 0
        length = (segments.end - segments.start.min(axis=2)) / np.maximum(segments.end, 1.0)
        long = (length > _SHORT) & (np.arange(length.shape[1]) < segments.count[:, None])
        self.short = bool(long.mean() <= _FEW)
        self._start = types.table(segments.start)
        self._end = Float(segments.end.ravel())
        self._last = Float(segments.last)
        self._count = UInt32(segments.count)
        self._looks = types.Bool(segments.looks)
        self._buried = types.Bool(segments.buried)
        self._base = UInt32(table.base)
        self._cells = [UInt32(np.ascontiguousarray(count)) for count in table.cells.T]
        self._records = types.table(table.records)
        self._eye = [dr.opaque(Float, float(place)) for place in view.eye]
        self.report = SharingReport(
            paths=table.flown + segments.flown,
            steps=table.steps,
            shared=float(shared.mean()) - torn,
            error=float(table.error.max(initial=0.0)),
            segments=float(segments.count.mean()),
        )

    def follow(
        self,
        field: Field,
        direction: Any,
        *,
        accuracy: Any,
        max_steps: Any,
        surface: Surface | None = None,
        far_surface: Surface | None = None,
        chord_tolerance: Any = None,
        active: Any = True,
    ) -> RayEnd:
        """Follow rays from the eye.

        Parameters
        ----------
        field : Field
            The one that the table was made from (in the precision of these rays).
        direction : Array3f, 1 — unit length
        accuracy, max_steps, surface, chord_tolerance, active
            As in `march`.
        far_surface : callable, optional
            The surface for the last, endless straight pieces, where one can be told that is quicker for
            them; default: `surface`.

        Returns
        -------
        RayEnd
            `steps` and `queries` are those of the ray itself, not of the table. A ray that meets nothing
            ends where the last straight piece begins.
        """
        types = self.types
        Array3f, Bool, UInt32 = types.Array3f, types.Bool, types.UInt32
        d, active = Array3f(direction), Bool(active)
        eye = Array3f(*self._eye)
        place = self._find(d)
        options = {
            "accuracy": accuracy,
            "max_steps": max_steps,
            "surface": surface,
            "chord_tolerance": chord_tolerance,
        }
        shared = self._is_shared(place, active)
        end = self._last_piece(eye, d, place, shared, getattr(surface, "blank", None))
        if surface is not None:
            count = dr.gather(UInt32, self._count, place.block, shared)
            end = _follow_segments(self, field, eye, d, place, end, count, shared, options)
            looks = shared & dr.gather(Bool, self._looks, place.block, shared)
            end = _test_beyond(end, far_surface or surface, looks & (end.status == ESCAPED))
        if not self.everywhere:
            # In blocks all of whose scouts meet the ground a ray that does not is marched, too.
            stray = dr.gather(Bool, self._buried, place.block, shared) & (end.status == ESCAPED)
            single = active & (~shared | stray)
            end = _march_singles(self, field, eye, d, place, end, single, options)
        return replace(end, status=dr.select(active, end.status, UInt32(NOT_TRACED)))

    def march_single(
        self, field: Field, eye: Any, direction: Any, place: _Place, active: Any, options: dict[str, Any]
    ) -> RayEnd:
        """March rays that share nothing: at first without a look at objects, up to where the first can be."""
        options = options | {"accuracy": options["accuracy"] * INTEGRATION}
        starts = dr.gather(self.types.Array4f, self._start, place.block * self._most, active)
        first = dr.min(starts)
        blind = options | {"surface": None, "chord_tolerance": None}
        before = march(field, eye, direction, max_distance=first, active=active, **blind)
        arrived = active & (before.status == STOPPED)
        end = march(field, before.position, before.direction, travelled=first, active=arrived, **options)
        lost = active & ~arrived
        return replace(
            end,
            status=dr.select(lost, before.status, end.status),
            steps=end.steps + before.steps,
            error=end.error + before.error,
        )

    def last_states(self, direction: Any) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Offset [m] and deflection where the last straight pieces begin, in the view's frame, (6, N); and
        which rays share their paths, (N,)."""
        place = self._find(direction)
        offset, deflection = self._interpolated(place, self._most, True)
        shared = self._is_shared(place, self.types.Bool(True))
        dr.eval(offset, deflection, shared)
        states = np.stack([np.asarray(part, dtype=np.float64) for part in (*offset, *deflection)])
        return states, np.broadcast_to(np.asarray(shared, dtype=bool), states.shape[1:])

    def _is_shared(self, place: _Place, active: Any) -> Any:
        """Whether rays share their paths: neither in a block that does not nor in a torn cell of one."""
        shared = active & (dr.gather(self.types.UInt32, self._cells[0], place.block, active) > 0)
        if self.everywhere:
            return shared
        record, *_ = self._node(place, 0, shared)
        torn = dr.gather(self.types.Array4f, self._records, record * 2, shared)[3] > 0
        return shared & ~torn

    def _node(self, place: _Place, segment: Any, active: Any) -> tuple[Any, Any, Any, Any]:
        """Records of the nodes to the upper and lower left of rays, and where in the cell they lie."""
        UInt32, Float = self.types.UInt32, self.types.Float
        across, down = (dr.maximum(dr.gather(UInt32, cells, place.block, active), 1) for cells in self._cells)
        x, y = place.x * Float(across), place.y * Float(down)
        i = UInt32(dr.clip(x, 0, Float(across - 1)))
        j = UInt32(dr.clip(y, 0, Float(down - 1)))
        base = dr.gather(UInt32, self._base, place.block, active)
        upper = base + (segment * (down + 1) + j) * (across + 1) + i
        return upper, upper + across + 1, x - Float(i), y - Float(j)

    def _find(self, direction: Any) -> _Place:
        UInt32, Float = self.types.UInt32, self.types.Float
        x, y = self.view.locate(direction)
        x, y = x * (1 / BLOCK[0]), y * (1 / BLOCK[1])
        column = UInt32(dr.clip(x, 0, Float(self._columns - 1)))
        row = UInt32(dr.clip(y, 0, Float(self._rows - 1)))
        return _Place(row * self._columns + column, x - Float(column), y - Float(row))

    def state(
        self, place: _Place, segment: Any, length: Any, eye: Any, direction: Any, active: Any
    ) -> tuple[Any, Any]:
        """Position [m] and unit direction at the beginning of a segment, at path length `length`."""
        offset, deflection = self._interpolated(place, segment, active)
        offset = self.view.from_frame(direction, offset)
        deflection = self.view.from_frame(direction, deflection)
        return dr.fma(direction, length, eye) + offset, dr.normalize(direction + deflection)

    def _interpolated(self, place: _Place, segment: Any, active: Any) -> tuple[Any, Any]:
        """Offset and deflection at the beginning of a segment, between the four nearest nodes."""
        upper, lower, u, v = self._node(place, segment, active)
        near, far = self._pair(upper, u, active), self._pair(lower, u, active)
        offset, deflection = (dr.lerp(a, b, v) for a, b in zip(near, far, strict=True))
        return offset, deflection

    def _pair(self, record: Any, u: Any, active: Any) -> tuple[Any, Any]:
        """Offset and deflection between a node and its neighbour to the right."""
        Array3f = self.types.Array3f
        halves = []
        for half in (0, 1):
            left, right = (
                dr.gather(self.types.Array4f, self._records, (record + k) * 2 + half, active) for k in (0, 1)
            )
            mixed = dr.lerp(left, right, u)
            halves.append(Array3f(mixed[0], mixed[1], mixed[2]))
        return halves[0], halves[1]

    def segment(self, place: _Place, number: Any, active: Any) -> tuple[Any, Any]:
        """Path lengths [m] at which a segment begins for a ray, and ends."""
        Float = self.types.Float
        index = place.block * self._most + number
        s00, s01, s10, s11 = dr.gather(self.types.Array4f, self._start, index, active)
        start = dr.lerp(dr.lerp(s00, s01, place.x), dr.lerp(s10, s11, place.x), place.y)
        return start, dr.gather(Float, self._end, index, active)

    def _last_piece(self, eye: Any, direction: Any, place: _Place, active: Any, blank: Any) -> RayEnd:
        """The straight piece without an end, as that of a ray that meets nothing."""
        types = self.types
        Float, UInt32 = types.Float, types.UInt32
        length = dr.gather(Float, self._last, place.block, active)
        # Behind the segments of all blocks, also of those that have fewer.
        position, ahead = self.state(place, self._most, length, eye, direction, active)
        # The segments' rays have been marched, this one is interpolated: what one meets a little behind its
        # end the other may meet before its beginning. Rays have left the air one station earlier.
        back = length * _SEAM
        return RayEnd(
            status=UInt32(ESCAPED),
            position=position,
            direction=ahead,
            chord_origin=dr.fma(ahead, -back, position),
            chord_direction=ahead,
            chord_length=Float(dr.inf),
            chord_start=length - back,
            steps=UInt32(0),
            path_length=length,
            error=Float(0),
            queries=UInt32(0),
            mark=blank,
            trial=Float(0),
        )


@final
@dataclass
class _Place:
    """Block of a ray, and where in it the ray lies, in its widths and heights."""

    block: Any  # UInt32
    x: Any  #     Float
    y: Any  #     Float


@dr.syntax
def _follow_segments(
    paths: SharedPaths, field: Field, eye: Any, d: Any, place: _Place, end: RayEnd, count: Any, active: Any,
    options: dict[str, Any],
) -> RayEnd:  # fmt: skip
    """Segment after segment, until something is met."""
    number = type(count)(0)
    searching = active & (number < count)
    while dr.hint(searching, label="follow shared paths", exclude=[paths, field, options]):
        piece = _segment(paths, field, eye, d, place, number, searching, options)
        met = searching & (piece.status == HIT)
        end = _add(end, piece, searching, met)
        number += 1
        searching = searching & ~met & (number < count)
    return end


@dr.syntax
def _march_singles(
    paths: SharedPaths, field: Field, eye: Any, d: Any, place: _Place, end: RayEnd, single: Any,
    options: dict[str, Any],
) -> RayEnd:  # fmt: skip
    """The ends of rays that share nothing put in. A loop of one round: where there are none it is skipped."""
    waiting = single
    while dr.hint(waiting, label="march single rays", exclude=[paths, field, options]):
        end = end.replaced(paths.march_single(field, eye, d, place, waiting, options), waiting)
        waiting = waiting & False
    return end


def _segment(
    paths: SharedPaths, field: Field, eye: Any, d: Any, place: _Place, number: Any, active: Any,
    options: dict[str, Any],
) -> RayEnd:  # fmt: skip
    """March one segment of each ray."""
    start, final = paths.segment(place, number, active)
    position, ahead = paths.state(place, number, start, eye, d, active)
    # A direction that is wrong from here on displaces what is seen by the segment's share of the way only.
    leverage = dr.clip(final * dr.rcp(dr.maximum(final - start, 1e-3)), 1, _MOST_LEVERAGE)
    eased = options | {"accuracy": options["accuracy"] * (_NEAR * leverage)}
    return march(
        field,
        position,
        ahead,
        travelled=start,
        max_distance=final,
        cellwise=not paths.short,
        active=active,
        **eased,
    )


def _add(end: RayEnd, piece: RayEnd, active: Any, ends: Any) -> RayEnd:
    """The end with the piece's effort, and the piece itself where the ray ends on it."""
    return replace(
        end.replaced(piece, ends),
        steps=end.steps + dr.select(active, piece.steps, 0),
        queries=end.queries + dr.select(active, piece.queries, 0),
        error=end.error + dr.select(active, piece.error, 0),
    )


def _test_beyond(end: RayEnd, surface: Surface, active: Any) -> RayEnd:
    """The same rays after a look along their last piece."""
    hit, distance, *marks = surface(end.chord_origin, end.chord_direction, end.chord_length, active)
    hit = hit & active
    return replace(
        end,
        status=dr.select(hit, type(end.status)(HIT), end.status),
        position=dr.select(hit, dr.fma(end.chord_direction, distance, end.chord_origin), end.position),
        path_length=dr.select(hit, end.chord_start + distance, end.path_length),
        queries=end.queries + dr.select(active, type(end.queries)(1), 0),
        mark=dr.select(hit, marks[0], end.mark) if marks else None,
    )
