"""What a person is told about the errors of a picture."""

from __future__ import annotations

import warnings
from typing import Any

import pytest

from nigemizu.errors import NigemizuWarning
from nigemizu.render.report import ErrorReport
from nigemizu.scene import Scene
from nigemizu.scene.rendering import warn_of_errors, warn_of_lost_rays


def report(worst: float, strays: float = 0.0) -> ErrorReport:
    return ErrorReport(
        worst=worst, mean=worst / 10, strays=strays, steps=40.0, queries=3.0, paths=500, shared=0.9
    )


def told(worst: float, overrides: dict[str, Any], strays: float = 0.0) -> list[str]:
    scene = Scene.load("pyramid", {f"tracer.{key}": value for key, value in overrides.items()})
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warn_of_errors(report(worst, strays), scene)
    assert all(entry.category is NigemizuWarning for entry in said)
    return [str(entry.message) for entry in said]


# A fixed step may err by a pixel; where an accuracy is asked for, it counts: 0.1 pixel if nothing is said.
@pytest.mark.parametrize(
    ("worst", "overrides", "warned"),
    [
        (0.099, {}, False),
        (0.12, {}, False),
        (0.14, {}, True),
        (0.11, {"accuracy": 0.2}, False),
        (0.02, {"accuracy": 0.01}, True),
        (0.9, {"step": 4.0}, False),
        (1.1, {"step": 4.0}, True),
        (0.9, {"step": 4.0, "accuracy": 0.01}, False),
    ],
)
def test_errors_larger_than_what_was_asked_for(worst: float, overrides: dict[str, Any], warned: bool) -> None:
    messages = told(worst, overrides)
    assert len(messages) == warned
    for message in messages:
        assert f"up to {worst:.2g} pixels (mean {worst / 10:.2g})" in message


def test_a_film_is_judged_by_what_is_usual_in_its_frames() -> None:
    """The worst of 64 thousand rays lies farther out than that of a thousand, however they are followed."""
    scene = Scene.load("pyramid")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_errors(ErrorReport.joined([report(0.2), *[report(0.1)] * 9]), scene)
    with pytest.warns(NigemizuWarning, match=r"up to 0\.3 pixels"):
        warn_of_errors(ErrorReport.joined([report(0.3), *[report(0.12)] * 9]), scene)


def test_rays_that_meet_something_else() -> None:
    """One in a thousand is not worth a word: it may be an edge finer than what is looked at around it."""
    assert told(0.01, {}, strays=0.001) == []
    assert told(0.01, {}, strays=0.02)[0].startswith("2.00% of the rays meet something else")


def test_an_accuracy_in_radians_is_counted_in_pixels() -> None:
    pixel = Scene.load("pyramid").camera.pixel_angle
    radians = {"accuracy": 0.1 * pixel, "accuracy_unit": "radian"}
    assert told(0.099, radians) == []
    assert "where 0.1 were asked for" in told(0.14, radians)[0]


@pytest.mark.parametrize(
    ("overrides", "remedy"),
    [
        ({}, "tracer.precision = 'double'"),
        ({"sharing": False}, "set tracer.precision = 'double'"),
        ({"precision": "double"}, "set tracer.sharing = false"),
        ({"precision": "double", "sharing": False}, "ask for less with tracer.accuracy"),
        ({"step": 30.0}, "shorten tracer.step"),
    ],
)
def test_the_warning_names_a_remedy_that_is_left(overrides: dict[str, Any], remedy: str) -> None:
    (message,) = told(5.0, overrides)
    assert remedy in message
    named = [key for key in ("precision = 'double'", "sharing = false") if key in message]
    # What is set already is no remedy.
    assert not (overrides.get("precision") == "double" and "precision = 'double'" in named)
    assert not (overrides.get("sharing") is False and "sharing = false" in named)


@pytest.mark.parametrize(("lost", "warned"), [(4, False), (6, True)])
def test_lost_rays_are_told_once_they_can_be_seen(lost: int, warned: bool) -> None:
    """Half a per cent."""
    scene = Scene.load("pyramid")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warn_of_lost_rays({"hit": 500, "escaped": 500 - lost, "out-of-steps": lost}, scene)
    assert [entry.category for entry in said] == [NigemizuWarning] * warned
    assert all("raise tracer.max_steps" in str(entry.message) for entry in said)
