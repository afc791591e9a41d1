"""Pictures whose rays share paths, and the errors that pictures report."""

from __future__ import annotations

import dataclasses
import functools
import warnings

import numpy as np
import pytest
from render_scenes import types
from scipy import stats

from nigemizu import field, render
from nigemizu.errors import NigemizuWarning
from nigemizu.render import bending, bounds
from nigemizu.render.report import ErrorReport
from nigemizu.render.variant import current_backend
from nigemizu.scene import Scene
from nigemizu.scene.rendering import warn_of_errors
from nigemizu.trace import Tracer

SIGNIFICANCE = 0.01
RENDERINGS = 10
SAMPLES = 24


def layer(excess=25.0, unevenness=0.1):
    """Axes and n − 1 = 0.0797/T over ground that is warmer by `excess` (K), here more and there less."""
    x, y = np.linspace(-10, 900, 24), np.linspace(-60, 60, 13)
    z = np.concatenate([[0.0], np.geomspace(0.01, 3.0, 30)])
    warmth = 1 + unevenness * np.sin(x / 60)[None, :] * np.cos(y / 15)[:, None]
    temperature = 303.0 + excess * warmth[None] * np.exp(-z / 0.2)[:, None, None]
    return x, y, z, 0.0797 / temperature


def scene(tracer, **options):
    axes = layer(**options)
    double = field.types(current_backend(), "double", differentiable=True)
    medium = field.StratifiedVolume(*axes, types())
    camera = render.Camera(eye=(0, 0, 1.5), field_of_view=1.6, width=64, height=40, pitch=-0.1)
    objects = [
        render.Ground(),
        render.Pyramid(position=(700, 0, 0), base=14, height=6),
        render.Pole(position=(400, -4, 0), height=5, diameter=0.5),
    ]
    integrator = render.integrator(settings=render.Settings(tracer=tracer))
    integrator.set_medium(medium, lambda: field.StratifiedVolume(*axes, double))
    return render.build(camera, render.Light(), objects, integrator=integrator)


@functools.cache
def seen(sharing, excess=25.0):
    """Block means (8 × 8 pixels) of independent renderings, their statuses and the report of the last."""
    # So exact that what the displacement of edges adds to a block's mean is below the noise.
    made = scene(Tracer(sharing=sharing, accuracy=0.005), excess=excess)
    found, statuses = [], []
    for frame in range(RENDERINGS):
        seed = 5 if sharing else 6
        taken = render.picture(made, samples=SAMPLES, seed=seed, frame=frame)
        found.append(taken.radiance.reshape(5, 8, 8, 8, 3).mean(axis=(1, 3)).ravel())
        statuses.append(list(taken.statuses.values()))
    return np.array(found, dtype=np.float64), np.array(statuses), taken.report


def least_p(first, second):
    """Least p-value over all blocks and channels (Welch), and Šidák's threshold for it."""
    p = stats.ttest_ind(first, second, equal_var=False).pvalue
    return float(np.nanmin(p)), 1 - (1 - SIGNIFICANCE) ** (1 / p.size)


def test_pictures_are_the_same_with_and_without_sharing():
    """Block means agree by Welch's test with Šidák's correction; so do the numbers of hits."""
    (shared, statuses, report), (single, others, other) = seen(True), seen(False)
    p, threshold = least_p(shared, single)
    assert p > threshold
    assert report.shared > 0.3
    assert report.paths > 50
    assert (other.shared, other.paths) == (0.0, 0)
    assert report.steps < other.steps
    rays = 64 * 40 * SAMPLES
    assert np.all(statuses.sum(axis=1) == rays)
    difference = np.abs(statuses.mean(axis=0) - others.mean(axis=0)) / rays
    assert np.all(difference < 1e-3)
    assert np.all(statuses[:, 2] == 0)


def test_sees_air_that_is_hotter():
    """Negative control: a tenth more excess of the ground's temperature."""
    p, threshold = least_p(seen(True)[0], seen(False, excess=27.5)[0])
    assert p < threshold


@pytest.mark.parametrize("sharing", [True, False])
def test_errors_are_within_the_accuracy(sharing):
    """The tenth of a pixel that is asked for by default; what is measured is above rounding."""
    report = seen(sharing)[2]
    assert 0 <= report.mean <= report.worst <= 0.1
    assert report.worst > 1e-5
    assert report.mean > 1e-7
    assert report.queries >= 1


def test_long_fixed_steps_are_seen_in_the_report():
    """Negative control: steps of 100 m err by pixels, those of 0.5 m by less than a tenth."""
    long, short = (
        render.picture(scene(Tracer(step=step, stepper="leapfrog")), samples=1).report
        for step in (100.0, 0.5)
    )
    assert long.worst > 1.0
    assert long.worst > 5 * short.worst
    assert long.mean > 5 * short.mean
    assert short.worst < 0.2
    assert long.steps < short.steps / 20


def small(**overrides):
    given = {"camera.width": 32, "camera.height": 20, "camera.samples": 1}
    return Scene.load("pyramid", given | {f"tracer.{key}": value for key, value in overrides.items()})


def test_what_cannot_be_reached_is_told():
    """1e-5 pixels are less than single precision has: what is reached is named; double reaches farther."""
    with pytest.warns(NigemizuWarning, match="displaced by up to") as said:
        single = small(accuracy=1e-5).render().report
    told = [str(entry.message) for entry in said if "displaced" in str(entry.message)]
    assert len(told) == 1
    assert f"up to {single.worst:.2g} pixels (mean {single.mean:.2g})" in told[0]
    assert "where 1e-05 were asked for" in told[0]
    assert "tracer.precision = 'double'" in told[0]
    assert single.worst > 1e-5
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NigemizuWarning)
        double = small(accuracy=1e-5, precision="double").render().report
    assert double.worst < 0.7 * single.worst
    assert double.mean < 0.7 * single.mean


def test_what_is_reached_is_not_warned_of():
    report = small().render().report  # warnings are errors here
    assert report.worst <= 0.1


def test_objects_that_are_missed_are_reported(monkeypatch):
    """The report looks at the scene for itself. Negative control: the scene as it is."""
    assert small().render().report.strays == 0
    # without the ground, which comes first
    monkeypatch.setattr(bending, "object_boxes", lambda scene: bounds.object_boxes(scene)[1:])
    with pytest.warns(NigemizuWarning, match="meet something else"):
        report = small().render().report
    assert 0.01 < report.strays < 0.5
    assert report.worst <= 0.1


def test_no_report_where_nothing_is_bent():
    assert small(method="straight").render().report is None


def test_frames_of_a_film_join_their_reports():
    """The worst of all, the means of the rest; a film warns of them together."""
    first = ErrorReport(worst=0.3, mean=0.01, strays=0.0, steps=10.0, queries=2.0, paths=100, shared=0.5)
    second = ErrorReport(worst=0.1, mean=0.03, strays=0.02, steps=20.0, queries=4.0, paths=301, shared=1.0)
    joined = ErrorReport.joined([first, second])
    assert abs(joined.usual_worst - 0.2) < 1e-12
    assert first.usual_worst == 0.3
    assert joined == ErrorReport(
        worst=0.3, mean=0.02, strays=0.01, steps=15.0, queries=3.0, paths=200, shared=0.75,
        worst_of_each=(0.3, 0.1),
    )  # fmt: skip
    assert ErrorReport.joined(iter([first])) == first
    with pytest.warns(NigemizuWarning, match=r"up to 0\.3 pixels \(mean 0\.02\)"):
        warn_of_errors(dataclasses.replace(joined, strays=0.0), small())
    text = str(dataclasses.replace(joined, worst=0.25))
    assert "0.25 at worst" in text
    assert "75.0% of the picture" in text


def test_a_film_reports_the_worst_of_its_frames(tmp_path):
    film = small(accuracy=1e-5).model_dump(exclude_unset=True)
    film["film"] = film.get("film", {}) | {"frames": 2}
    with pytest.warns(NigemizuWarning, match="displaced by up to") as said:
        Scene.model_validate(film).animate(tmp_path / "film.mp4")
    assert sum("displaced" in str(entry.message) for entry in said) == 1
