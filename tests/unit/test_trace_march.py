"""How rays end: the rule of travel, statuses, chords and details of `march`."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest

from nigemizu import field, trace
from nigemizu.errors import InputError

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")


def hot_layer(types: field.Types, beyond: Any = "straight") -> field.TrilinearVolume:
    """600 m × 20 m × 4 m of air over a hot ground, cells from 5 mm."""
    z = np.concatenate([[0.0], np.cumsum(0.005 * 1.05 ** np.arange(76))])
    profile = 2.7e-4 - 2.5e-5 * np.exp(-z / 0.1)
    data = np.broadcast_to(profile[:, None, None], (len(z), 3, 3))
    return field.TrilinearVolume([0, 300, 600], [-10, 0, 10], z, data, types, beyond)


def flat(types: field.Types, *slopes: float) -> Any:
    angle = np.array(slopes, dtype=np.float64)
    return types.Array3f(np.array([np.cos(angle), 0 * angle, np.sin(angle)]))


def wall(x: float, top: float = 1e9) -> trace.Surface:
    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        t = (x - origin.x) / direction.x
        z = origin.z + t * direction.z
        return active & (t > 0) & (t <= length) & (z <= top), t

    return surface


def status(end: trace.RayEnd) -> list[int]:
    return list(np.array(end.status).astype(int))


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_grazing_ray_comes_back_up(types: field.Types) -> None:
    """The ray that turns a centimetre above the ground is not absorbed: it leaves, rising."""
    end = trace.march(
        hot_layer(types), types.Array3f(0, 0, 1.2), flat(types, -0.006, -0.0073, -0.01),
        step=0.5, max_steps=5000, surface=trace.ground_plane(0), details=True,
    )  # fmt: skip
    assert status(end) == [trace.ESCAPED, trace.HIT, trace.HIT]
    assert 0.0 < end.turning_height[0] < 0.1
    assert abs(float(end.direction.z[0]) - 0.006) < 1e-5
    assert np.isnan(np.array(end.turning_height)[1:]).all()


def test_turning_height_is_the_least_of_several() -> None:
    """In a duct a ray turns again and again; the lowest turn counts."""
    air = field.Placed(
        field.ParabolicGrin(DOUBLE, 1.0, 0.05), [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
    )
    end = trace.march(
        air, DOUBLE.Array3f(0, 0, 1.0), flat(DOUBLE, 0.0),
        step=0.1, max_steps=5000, max_distance=400.0, details=True,
    )  # fmt: skip
    assert abs(float(end.turning_height[0]) + 1.0) < 1e-3
    assert status(end) == [trace.STOPPED]


@pytest.mark.parametrize("tolerance", [None, 1e-4])
def test_surfaces_before_inside_and_beyond_the_volume(tolerance: float | None) -> None:
    """Straight to the volume, bent inside, straight on: a hit counts wherever it is."""
    air = hot_layer(DOUBLE)
    cases = {
        "before": (wall(-20.0), -20.0),
        "inside": (wall(311.7), 311.7),
        "beyond": (wall(5000.0), 5000.0),
    }
    for surface, x in cases.values():
        end = trace.march(
            air, DOUBLE.Array3f(-100, 0, 1.2), flat(DOUBLE, 0.001), step=1.0, max_steps=1000,
            surface=surface, chord_tolerance=tolerance, details=True,
        )  # fmt: skip
        assert status(end) == [trace.HIT]
        assert abs(float(end.position.x[0]) - x) < 1e-9
        distance = float(end.path_length[0] - end.chord_start[0])
        assert 0 < distance <= float(end.chord_length[0]) * (1 + 1e-6)
        on_chord = end.chord_origin + end.chord_direction * distance
        assert np.max(np.abs(np.array(on_chord - end.position))) < 1e-9
        # flat rays: path length is x to 1e-5, optical path 1.00027 times it
        assert abs(float(end.path_length[0]) - (x + 100)) < 1e-2
        assert abs(float((end.optical_path / end.path_length)[0]) - 1.00027) < 1e-6


def test_low_wall_beyond_the_volume_is_missed_by_rays_that_pass_above() -> None:
    end = trace.march(
        hot_layer(DOUBLE), DOUBLE.Array3f(0, 0, 1.2), flat(DOUBLE, 0.002, -0.0001), step=1.0, max_steps=1000,
        surface=wall(900.0, top=2.0),
    )  # fmt: skip
    assert status(end) == [trace.ESCAPED, trace.HIT]
    assert abs(float(end.position.x[0]) - 600) < 1e-9  # where it left the volume
    assert abs(float(end.position.x[1]) - 900) < 1e-9


def test_ray_that_never_meets_the_volume() -> None:
    air = hot_layer(DOUBLE)
    upward = DOUBLE.Array3f([0.0, -5.0], [0.0, 50.0], [9.0, 1.0])
    ahead = DOUBLE.Array3f([0.0, 1.0], [0.0, 0.0], [1.0, 0.0])
    end = trace.march(air, upward, ahead, step=1.0, max_steps=100, details=True)
    assert status(end) == [trace.ESCAPED, trace.ESCAPED]
    assert np.array_equal(np.array(end.position), np.array(upward))
    assert list(end.steps) == [0, 0]
    end = trace.march(air, upward, ahead, step=1.0, max_steps=100, surface=wall(70.0))
    assert status(end) == [trace.ESCAPED, trace.HIT]
    end = trace.march(air, upward, ahead, step=1.0, max_steps=100, surface=wall(70.0), max_distance=30.0)
    assert status(end) == [trace.STOPPED, trace.STOPPED]
    assert np.allclose(np.array(end.position)[2], [39, 1])


def test_extended_air_bends_beyond_the_sides() -> None:
    """The same grazing ray from 300 m before the volume: extended air turns it, absent air does not."""
    start, ahead = DOUBLE.Array3f(-300, 0, 1.2), flat(DOUBLE, -0.005)
    options: dict[str, Any] = {
        "step": 0.5,
        "max_steps": 5000,
        "surface": trace.ground_plane(0),
        "details": True,
    }
    extended = trace.march(hot_layer(DOUBLE, "extend"), start, ahead, max_distance=2000.0, **options)
    inside = trace.march(hot_layer(DOUBLE), DOUBLE.Array3f(0, 0, 1.2), ahead, **options)
    absent = trace.march(hot_layer(DOUBLE), start, ahead, **options)
    assert abs(float((extended.turning_height - inside.turning_height)[0])) < 1e-4
    assert status(absent) == [trace.HIT]
    assert float(absent.position.x[0]) < 0  # on the ground before the air began


def test_steps_run_out_and_masks_hold() -> None:
    end = trace.march(
        hot_layer(DOUBLE), DOUBLE.Array3f(0, 0, 1.2), flat(DOUBLE, 0.0, 0.0), step=1.0, max_steps=100,
        active=DOUBLE.Bool([True, False]),
    )  # fmt: skip
    assert status(end) == [trace.OUT_OF_STEPS, trace.NOT_TRACED]
    assert list(end.steps) == [100, 0]
    assert abs(float(end.path_length[0]) - 100) < 1e-6


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_max_distance_is_met_exactly(types: field.Types) -> None:
    end = trace.march(
        hot_layer(types), types.Array3f(0, 0, 0.3), flat(types, -0.002, 0.0), step=0.7, max_steps=1000,
        max_distance=types.Float([123.4, 5.0]),
    )  # fmt: skip
    assert status(end) == [trace.STOPPED, trace.STOPPED]
    relative = 1e-6 if types is SINGLE else 1e-12
    assert np.allclose(np.array(end.path_length), [123.4, 5.0], rtol=relative)


def test_march_nests_in_a_symbolic_loop() -> None:
    """A ball bouncing along the ground: every bounce is a march of its own inside one device loop."""
    types = field.types("llvm", "single", differentiable=True)
    air = hot_layer(types, "extend")
    x, hits = _bounces(air, types, types.Array3f(0, 0, 1.0), flat(types, -0.05, -0.1))
    assert list(hits) == [5, 5]
    assert np.allclose(np.array(x.x), [100.0, 50.0], rtol=0.02)
    assert np.all(np.array(x.z) < 1e-3)  # the fifth end is on the ground again


@dr.syntax
def _bounces(air: field.Field, types: field.Types, x: Any, d: Any) -> Any:
    """Five times to and fro between the ground and a ceiling at 1 m."""
    hits = types.UInt32(0)
    active = types.Bool(True)
    bounces = types.UInt32(0)
    surface = trace.combine(trace.ground_plane(0.0), trace.ground_plane(1.0))
    while active:
        end = trace.march(
            air, x, d, step=0.25, max_steps=4000, surface=surface, chord_tolerance=1e-4, active=active
        )
        x = types.Array3f(end.position.x, end.position.y, dr.select(end.direction.z < 0, 1e-6, 1 - 1e-6))
        d = types.Array3f(end.direction.x, end.direction.y, -end.direction.z)
        hits += dr.select(end.hit, types.UInt32(1), types.UInt32(0))
        bounces += 1
        active &= bounces < 5
    return x, hits


def test_recorded_paths_are_the_march() -> None:
    air = field.ExponentialSquare(DOUBLE, 1.00027**2, 5e-5, 0.1)
    angles = np.array([-0.02, -0.005, 0.001])
    directions = np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    options: dict[str, Any] = {
        "step": 0.5,
        "max_steps": 2000,
        "surface": trace.ground_plane(0),
        "max_distance": 600.0,
    }
    paths, end = trace.record_paths(air, [0, 0, 1.5], directions, every=10, **options)
    once = trace.march(air, DOUBLE.Array3f(0, 0, 1.5), flat(DOUBLE, *angles), details=True, **options)
    assert status(end) == status(once) == [trace.HIT, trace.STOPPED, trace.STOPPED]
    for name in ("position", "direction", "path_length", "optical_path", "turning_height"):
        both = np.array(getattr(end, name)), np.array(getattr(once, name))
        assert np.allclose(*both, rtol=0, atol=1e-4, equal_nan=True), name
    for ray, path in enumerate(paths):
        assert path.shape[1] == 3
        assert np.array_equal(path[0], [0, 0, 1.5])
        assert np.allclose(path[-1], np.array(end.position)[:, ray])
        assert np.all(np.diff(path[:, 0]) > 0)
    assert len(paths[0]) < len(paths[1])
    assert paths[1][:, 2].min() < 0.2 < paths[1][-1, 2]


def test_recorded_paths_refuse_nonsense() -> None:
    air = field.Uniform(DOUBLE)
    with pytest.raises(InputError, match="directions"):
        trace.record_paths(air, [0, 0, 0], [[0.0, 0.0, 0.0]], step=1.0, max_steps=10)
    with pytest.raises(InputError, match="every"):
        trace.record_paths(air, [0, 0, 0], [[1.0, 0.0, 0.0]], step=1.0, max_steps=10, every=0)


def test_accuracy_or_step_and_not_both() -> None:
    start, ahead = DOUBLE.Array3f(0, 0, 1.2), flat(DOUBLE, 0.0)
    for given in ({}, {"accuracy": 1e-6, "step": 1.0}):
        with pytest.raises(InputError, match="one of them"):
            trace.march(field.Uniform(DOUBLE), start, ahead, max_steps=10, **given)


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_one_ray_of_numbers_that_the_compiler_knows(types: field.Types) -> None:
    """A single ray with a component that is 0: loops must not take it for a constant."""
    air = field.ExponentialSquare(types, 1.00027**2, 5e-5, 0.1)
    options: dict[str, Any] = {"accuracy": 1e-6, "max_steps": 1000, "max_distance": 300.0}
    one = trace.march(air, types.Array3f(0, 0, 1.2), types.Array3f(1.0, 0, 0), **options)
    array = trace.march(air, types.Array3f(0, 0, 1.2), flat(types, 0.0, 0.0), **options)
    assert status(one) == [trace.STOPPED]
    assert float(one.position.z[0]) == float(array.position.z[1])


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_cold_ground_in_a_cell_without_a_floor(types: field.Types) -> None:
    """Light is pulled down where the lowest cell goes on for ever: its face is never met, no step fails."""
    z = np.linspace(0.0, 4.0, 21)
    data = np.broadcast_to((2.7e-4 + 1e-5 * np.exp(-z))[:, None, None], (21, 2, 2))
    air = field.Bottomless(field.StratifiedVolume([0, 600], [-10, 10], z, data, types))
    end = trace.march(
        air, types.Array3f(0, 0, 0.5), flat(types, -0.004, -0.05, 0.0), accuracy=1e-6, max_steps=1000
    )
    assert status(end) == [trace.ESCAPED] * 3
    assert np.all(np.array(end.steps) < 200)
    assert np.all(np.array(end.direction.z) < [-0.004, -0.05, 0.0])


def test_a_first_step_that_is_rejected_leaves_the_ray_in_the_volume() -> None:
    """Rays that come from outside begin on the face, by rounding on either side of it."""
    z = np.linspace(0.0, 4.0, 41)
    data = np.broadcast_to((2.7e-4 - 2.5e-5 * np.exp(-z / 0.3))[:, None, None], (41, 2, 2))
    air = field.StratifiedVolume([0.1, 600.1], [-10, 10], z, data, DOUBLE)
    rng = np.random.default_rng(np.random.SeedSequence(5))
    start = np.stack([-rng.uniform(1, 50, 200), 0 * np.ones(200), rng.uniform(0.2, 1.0, 200)])
    rise = rng.uniform(0, 1e-3, 200)
    end = trace.march(air, DOUBLE.Array3f(start), flat(DOUBLE, *rise), accuracy=1e-9, max_steps=5000)
    assert np.all(np.array(end.steps) > 5)
    assert np.all(np.array(end.position.x) > 600)
    assert np.all(np.array(end.direction.z) > rise + 1e-6)  # all of them were bent


def test_statuses_speak() -> None:
    assert trace.RayStatus.OUT_OF_STEPS.label == "out-of-steps"
    assert "max_steps" in trace.RayStatus.OUT_OF_STEPS.message
    assert {s.label for s in trace.RayStatus} >= {"hit", "escaped", "out-of-steps"}


def test_steppers_are_data() -> None:
    assert trace.stepper_named("leapfrog") is trace.LEAPFROG
    with pytest.raises(InputError, match=r"no such stepper.*leapfrog"):
        trace.stepper_named("rk4")
    with pytest.raises(InputError, match="add up"):
        trace.Stepper("short", 1, (0.5, 0.4), (1.0,))
    with pytest.raises(InputError, match="one drift more"):
        trace.Stepper("kicks", 1, (1.0,), (1.0,))


def test_tracer_describes_every_field_and_refuses_nonsense() -> None:
    from pydantic import ValidationError

    tracer = trace.Tracer()
    assert (tracer.method, tracer.accuracy, tracer.accuracy_unit) == ("bent", 0.1, "pixel")
    assert (tracer.step, tracer.max_steps, tracer.sharing) == (None, 20_000, True)
    assert (tracer.interpolation, tracer.precision) == ("stratified", "auto")
    assert tracer.angle(2e-4) == pytest.approx(2e-5, rel=1e-12)
    assert trace.Tracer(accuracy=1e-6, accuracy_unit="radian").angle(2e-4) == 1e-6
    assert all(info.description for info in trace.Tracer.model_fields.values())
    for bad in (
        {"step": 0},
        {"max_steps": 0},
        {"method": "curved"},
        {"stepper": "rk4"},
        {"chord_tolerance": -1},
        {"accuracy": 0},
        {"accuracy": -0.1},
        {"accuracy_unit": "degree"},
        {"interpolation": "nearest"},
        {"precision": "half"},
        {"sharing": "sometimes"},
    ):
        with pytest.raises(ValidationError):
            trace.Tracer.model_validate(bad)


def test_long_steps_share_no_chord_that_is_not_asked_for() -> None:
    """Controlled steps are long; tested as they are, their chords would leave out the sag below them.

    The ground lies 0.1 mm above the ray's turning point, and below the chord of the step around it. Negative
    control: steps tested one by one miss it.
    """
    air = field.ExponentialSquare(DOUBLE, a=1.00027**2, amplitude=5e-5, height=0.05)
    eye, ahead = DOUBLE.Array3f(0, 0, 1.5), DOUBLE.Array3f(1, 0, -0.002)
    options = {"accuracy": 1e-7, "max_steps": 1000}
    turn = trace.march(air, eye, ahead, details=True, **options)
    low = float(turn.turning_height[0])
    ground = trace.ground_plane(low + 1e-4)
    assert status(trace.march(air, eye, ahead, surface=ground, **options)) == [trace.HIT]
    assert status(trace.march(air, eye, ahead, surface=ground, chord_tolerance=0, **options)) != [trace.HIT]
