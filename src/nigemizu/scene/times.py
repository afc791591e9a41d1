"""The time of a scene: what is simulated, what a picture shows, what a film shows."""

from __future__ import annotations

from typing import Annotated, Final, final

from pydantic import Field

from nigemizu.errors import InputError
from nigemizu.values import Value

__all__ = ["FilmSpec", "TimeSpec"]

_MOST_INSTANTS: Final = 1_000_000


@final
class TimeSpec(Value):
    """The time that is simulated, from 0.

    Parameters
    ----------
    duration : float, s
        End of the simulated time.
    picture : float, s, optional
        Instant that a single picture shows; the end unless given.
    store_every : float, s, optional
        Time between the instants that a dataset stores; a tenth of the duration unless given.
    step : float, s, optional
        Time step of the heat stage; chosen for accuracy unless given.
    """

    duration: Annotated[float, Field(ge=0, json_schema_extra={"unit": "s"})] = 600.0
    picture: Annotated[float, Field(ge=0)] | None = Field(None, json_schema_extra={"unit": "s"})
    store_every: Annotated[float, Field(gt=0)] | None = Field(None, json_schema_extra={"unit": "s"})
    step: Annotated[float, Field(gt=0)] | None = Field(None, json_schema_extra={"unit": "s"})

    @property
    def shown(self) -> float:
        """Instant of a single picture [s]."""
        return self.duration if self.picture is None else self.picture

    @property
    def stored(self) -> tuple[float, ...]:
        """Instants of a dataset [s], from 0 to the end."""
        every = self.store_every or self.duration / 10.0
        if every <= 0.0:
            return (0.0,)
        if self.duration / every > _MOST_INSTANTS:
            raise InputError(
                f"more than {_MOST_INSTANTS} instants in {self.duration:g} s",
                key="time.store_every",
                value=every,
                remedy="store fewer instants",
            )
        inner = [index * every for index in range(int(self.duration / every * (1 + 1e-12)) + 1)]
        if self.duration - inner[-1] > 1e-9 * self.duration:
            inner.append(self.duration)
        return tuple(inner)


@final
class FilmSpec(Value):
    """The film: which instants it shows and how fast it plays.

    Parameters
    ----------
    start : float, s
        Instant of the first frame.
    duration : float, s
        Time that passes in the scene from the first frame to the end of the last.
    frames : int
        Number of frames.
    fps : int, s-1
        Frames per second when played.
    """

    start: Annotated[float, Field(ge=0, json_schema_extra={"unit": "s"})] = 0.0
    duration: Annotated[float, Field(gt=0, json_schema_extra={"unit": "s"})] = 5.0
    frames: Annotated[int, Field(ge=1, le=1_000_000)] = 125
    fps: Annotated[int, Field(ge=1, le=240)] = 25

    @property
    def times(self) -> tuple[float, ...]:
        """Instants of the frames [s]."""
        return tuple(self.start + self.duration * index / self.frames for index in range(self.frames))
