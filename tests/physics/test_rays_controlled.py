"""Exact rays by error-controlled steps: the error asked for is kept, with as few steps as that takes.

An error is the distance from the exact ray, divided by the length of the path: an angle seen from the eye.
All accuracies are rays of one march, in double precision. Steps are controlled one by one, each to a tenth of
the accuracy, with an estimate that is too large: the sum over hundreds of them may come out above it, and so
may what strong lenses magnify. Where that is so the test says by how much.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np
import pytest
from numpy.typing import NDArray

from nigemizu import field, trace

FloatArray = NDArray[np.float64]

TYPES = field.types("llvm", "double")
ACCURACIES = 10.0 ** -np.arange(5.0, 11.0)
A, AMPLITUDE, HEIGHT = 1.00027**2, 5e-5, 0.05


class Flown(NamedTuple):
    """Ends of one ray at all accuracies."""

    position: FloatArray
    direction: FloatArray
    length: FloatArray
    steps: FloatArray
    turning: FloatArray


def fly(air: field.Field, origin: Any, angle: float, distance: float, plane: str = "xz") -> Flown:
    count = len(ACCURACIES)
    ahead = [np.cos(angle), 0, np.sin(angle)] if plane == "xz" else [np.cos(angle), np.sin(angle), 0]
    end = trace.march(
        air,
        TYPES.Array3f(np.tile(np.asarray(origin, dtype=np.float64)[:, None], (1, count))),
        TYPES.Array3f(np.tile(np.array(ahead)[:, None], (1, count))),
        accuracy=TYPES.Float(ACCURACIES),
        max_steps=20_000,
        max_distance=distance,
        details=True,
    )
    assert np.all(np.array(end.status) == trace.STOPPED)
    numbers = (end.position, end.direction, end.path_length, end.steps, end.turning_height)
    return Flown(*(np.array(values, dtype=np.float64) for values in numbers))


def log_cosh(u: Any) -> Any:
    return np.abs(u) + np.log1p(np.exp(-2 * np.abs(u))) - np.log(2)


def mirage(x: Any, z0: float, launch: float) -> tuple[Any, float]:
    """Height at x and turning height in n² = A − B exp(−z/h): z = z_t + 2h ln cosh(p∞ (σ − σ_t)/2h)."""
    layer = AMPLITUDE * np.exp(-z0 / HEIGHT)
    n = np.sqrt(A - layer)
    p_x, p_z = n * np.cos(launch), n * np.sin(launch)
    p_far = np.sqrt(p_z * p_z + layer)
    turn = -HEIGHT * np.log(p_far**2 / AMPLITUDE)
    # artanh r = ln(1 + r) − ½ ln(1 − r²), written without the difference of nearly equal numbers
    sigma_turn = 2 * HEIGHT / p_far * (np.log1p(-p_z / p_far) - 0.5 * np.log(layer / p_far**2))
    return turn + 2 * HEIGHT * log_cosh(p_far * (np.asarray(x) / p_x - sigma_turn) / (2 * HEIGHT)), turn


def grazing(z0: float, turn: float) -> float:
    """Elevation [rad] from z0 of the ray that turns at a height (Snell: p∞² = B exp(−z_t/h))."""
    layer = AMPLITUDE * np.exp(-z0 / HEIGHT)
    return -float(np.arcsin(np.sqrt((AMPLITUDE * np.exp(-turn / HEIGHT) - layer) / (A - layer))))


def step_growth(steps: FloatArray) -> float:
    """Power of 1/accuracy with which the steps grow."""
    return float(np.polyfit(np.log(1 / ACCURACIES), np.log(steps), 1)[0])


@pytest.mark.parametrize(
    ("launch", "turn_height", "height"),
    [(-0.002, 0.1262595025263739, 0.6138936891052358), (-0.004, 0.05694498447055655, 2.4752818662995835)],
)
def test_log_cosh_mirage(launch: float, turn_height: float, height: float) -> None:
    """n² = 1.00027² − 5e-5 exp(−z/0.05): z = z_t + 2h ln cosh(p∞ (σ − σ_t)/2h) (closed form).

    Of 120 to 180 steps each may use a tenth: at 1e-9 and 1e-10 the sum is within three times the accuracy.
    """
    exact, turn = mirage(1000.0, 1.5, launch)
    assert abs(exact - height) < 1e-11  # the numbers of test_rays_exact
    assert abs(turn - turn_height) < 1e-13
    flown = fly(field.ExponentialSquare(TYPES, A, AMPLITUDE, HEIGHT), [0, 0, 1.5], launch, 1000.0)
    errors = np.abs(flown.position[2] - mirage(flown.position[0], 1.5, launch)[0]) / flown.length
    assert np.all(errors <= np.where(ACCURACIES > 3e-9, 1.0, 3.0) * ACCURACIES)
    assert np.all(errors >= 1e-3 * ACCURACIES)
    # A local error of h⁵, a tenth of the accuracy each: steps grow by its fifth root.
    assert np.all(np.diff(flown.steps) > 0)
    assert 0.12 < step_growth(flown.steps) < 0.22
    assert flown.steps[0] <= 40
    # The turning height is that of the cubic within a step: seen from the turn 700 m away, a good deal finer.
    assert np.all(np.abs(flown.turning - turn_height) < 1000 * ACCURACIES)


def test_parabolas_are_exact_at_any_accuracy() -> None:
    """n² = a + b z has a constant slope n∇n = b/2, which Nyström's rule integrates without error.

    n² = 2.25 − z/2 at 45°: z = x − x²/9; n² = 1.00026² + 2e-6 z from 1.5 m at −1.5 mrad (closed forms).
    The estimate is 0, and so the steps are as long as the field's reach at all accuracies.
    """
    flown = fly(field.LinearSquare(TYPES, 2.25, -0.5), [0, 0, 0], np.pi / 4, 4.0)
    x, _, z = flown.position
    assert np.max(np.abs(z - (x - x * x / 9))) < 1e-13
    assert np.all(x > 3.0)
    assert np.all(flown.steps == flown.steps[0])
    assert flown.steps[0] <= 8
    flown = fly(field.LinearSquare(TYPES, 1.00026**2, 2e-6), [0, 0, 1.5], -0.0015, 2500.0)
    x, _, z = flown.position
    p_x2 = (1.00026**2 + 3e-6) * np.cos(0.0015) ** 2
    assert np.max(np.abs(z - (1.5 - np.tan(0.0015) * x + 2e-6 * x * x / (4 * p_x2)))) < 1e-10
    assert np.max(np.abs(flown.turning - 0.37441239314108504)) < 1e-11  # as in test_rays_exact
    assert flown.steps[0] <= 8


def test_parabolic_fibre() -> None:
    """n² = 1.5² (1 − 0.09 y²): y = y₀ cos kx + tan θ₀/k sin kx, k = g n₀/(n(y₀) cos θ₀) (closed form).

    Over half a period, 10 m, the sum of up to 180 steps comes to 0.4 … 8 times the accuracy.
    """
    flown = fly(field.ParabolicGrin(TYPES, 1.5, 0.3), [0, 0.4, 0], 0.2, 10.0, plane="xy")
    x, y, _ = flown.position
    k = 0.3 / (np.sqrt(1 - 0.09 * 0.4**2) * np.cos(0.2))
    errors = np.abs(y - (0.4 * np.cos(k * x) + np.tan(0.2) / k * np.sin(k * x))) / flown.length
    assert np.all(errors <= 12 * ACCURACIES)
    assert np.all(errors >= 0.03 * ACCURACIES)
    assert 0.17 < step_growth(flown.steps) < 0.25


def test_fisheye_circle() -> None:
    """In n = 2/(1 + r²) the ray from (½, 0) at 60° is a circle (closed form, test_rays_exact).

    It turns by more than π and what errs is magnified: 8 times the accuracy at 1e-5. From there errors fall
    with the power 4/5 of it, because each of accuracy^(−1/5) steps may err by a tenth of it.
    """
    flown = fly(field.Fisheye(TYPES), [0.5, 0, 0], np.pi / 3, 5.0, plane="xy")
    x, y, _ = flown.position
    centre, radius = (-0.75, 0.7216878364870322), 1.4433756729740643
    errors = np.abs(np.hypot(x - centre[0], y - centre[1]) - radius) / flown.length
    assert 1 < errors[0] / ACCURACIES[0] < 15
    slope = float(np.polyfit(np.log(ACCURACIES), np.log(errors), 1)[0])
    assert abs(slope - 0.8) < 0.05
    assert abs(step_growth(flown.steps) - 0.2) < 0.02
    assert np.all(x < -1.5)  # beyond the point opposite


def test_luneburg_lens_focuses() -> None:
    """Parallel light at y = ½ leaves the sphere n² = 2 − r² through (1, 0) at −30°; n = 1 around it."""
    flown = fly(field.Luneburg(TYPES), [-2, 0.5, 0], 0.0, 5.0, plane="xy")
    x, y, _ = flown.position
    beside = np.abs((x - 1) * 0.5 + y * np.sqrt(0.75)) / flown.length
    turned = np.abs(np.arctan2(flown.direction[1], flown.direction[0]) + np.pi / 6)
    assert np.all(x > 2)
    assert np.all(beside <= 6 * ACCURACIES)
    assert np.all(beside >= 0.03 * ACCURACIES)
    assert np.all(turned <= 20 * ACCURACIES)
    assert 0.1 < step_growth(flown.steps) < 0.25


def test_gaussian_blob_deflects() -> None:
    """n = 1 − 8.9e-6 exp(−r²/2s²), s = b = 2 cm: 1.353108741880697e-05 rad (DOP853), from 10 m away."""
    flown = fly(field.GaussianBlob(TYPES, 8.9e-6, 0.02), [-10, 0.02, 0], 0.0, 20.0, plane="xy")
    deflection = np.arctan2(flown.direction[1], flown.direction[0])
    errors = np.abs(deflection - 1.353108741880697e-05)
    assert np.all(errors <= ACCURACIES)
    assert np.all(errors[1:] >= 1e-5 * ACCURACIES[1:])
    # At 1e-5 the whole deflection would hardly be missed; it is seen all the same.
    assert abs(deflection[0] / 1.353108741880697e-05 - 1) < 0.02
    assert 0.1 < step_growth(flown.steps) < 0.22


# ---------------------------------------------------------------- grazing a thin hot layer


def layer_volume(west: float = -1100.0, flatness: float = 0.0) -> field.StratifiedVolume:
    """The layer in voxels of 1 mm near the ground, growing upwards to 20 m."""
    z = np.concatenate([np.arange(0.0, 0.3, 1e-3), 0.3 + np.cumsum(1e-3 * 1.05 ** np.arange(140))])
    z = z[z < 20]
    refractivity = np.sqrt(A - AMPLITUDE * np.exp(-z / HEIGHT)) - 1
    data = np.broadcast_to(refractivity[:, None, None], (len(z), 2, 2))
    return field.StratifiedVolume([west, 900], [-10, 10], z, data, TYPES, flatness=flatness)


@pytest.mark.parametrize("turn", [0.01, 0.06], ids=["1cm above the ground", "1cm above the layer"])
@pytest.mark.parametrize("before", [0.0, 1000.0], ids=["at once", "after 1 km of still air"])
@pytest.mark.parametrize("medium", ["closed form", "voxels", "voxels that begin late"])
def test_a_thin_layer_is_not_stepped_through(medium: str, before: float, turn: float) -> None:
    """A ray that turns at 1 cm in a layer of 5 cm, or at 6 cm, 1 cm above its scale height (Snell, log-cosh).

    The voxels differ from the closed form by less than 1e-11 rad here (spline through 1 mm cells).
    """
    launch = grazing(1.5, turn)
    # Up there the layer is e⁻³⁰ and less of what it is at the ground: the way before is straight to 1e-16.
    start = [-before, 0, 1.5 - before * np.tan(launch)]
    if medium == "closed form":
        air: field.Field = field.ExponentialSquare(TYPES, A, AMPLITUDE, HEIGHT)
    else:
        air = layer_volume(0.0 if medium == "voxels that begin late" else -1100.0)
    flown = fly(air, start, launch, before + 600.0)
    exact, turn_height = mirage(flown.position[0], 1.5, launch)
    assert abs(turn_height - turn) < 1e-12
    errors = np.abs(flown.position[2] - exact) / flown.length
    assert np.all(errors <= 2 * ACCURACIES + 1e-11)
    assert np.all(errors[ACCURACIES > 3e-9] <= ACCURACIES[ACCURACIES > 3e-9])
    assert np.all(np.abs(flown.turning - turn) < 200 * ACCURACIES + 1e-9)
    assert np.all(flown.position[2] > 0.5)  # it did turn


def test_rays_that_dip_into_a_steep_cell_do_not_leap_out_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The slope at the top of a thick cell says little of that where a ray turns within it.

    Bound: the accuracy that was asked for, against the same rays a hundred thousand times as accurate.
    """
    z = np.array(
        [0, 0.01, 0.032, 0.059, 0.092, 0.131, 0.18, 0.24, 0.31, 0.4, 0.5, 0.63, 0.78, 0.97, 1.2, 1.5]
    )
    n = 2.6e-4 - 2e-5 * np.exp(-z / 0.1)
    wide = [-1e5, 1e5]
    air = field.StratifiedVolume(wide, wide, z, np.broadcast_to(n[:, None, None], (16, 2, 2)), TYPES)
    elevation = -np.linspace(0.5e-3, 6e-3, 2000)
    ahead = TYPES.Array3f(TYPES.Float(np.cos(elevation)), 0, TYPES.Float(np.sin(elevation)))

    def heights(accuracy: float) -> FloatArray:
        eye = TYPES.Array3f(0, 0, 1.4)
        end = trace.march(air, eye, ahead, accuracy=accuracy, max_steps=20_000, max_distance=1500.0)
        return np.asarray(end.position, dtype=np.float64)[2]

    exact = heights(1e-11)
    for accuracy in (1e-4, 1e-5, 1e-6):
        assert np.abs(heights(accuracy) - exact).max() / 1500 < accuracy
    monkeypatch.setattr("nigemizu.trace.controlled._ASTRAY", 1e9)
    assert np.abs(heights(1e-5) - exact).max() / 1500 > 20e-5  # measured: 66 times the accuracy


def test_flat_cells_are_crossed_in_one_go() -> None:
    """Where rays may turn by 1e-6 otherwise on the whole way, fewer than half the steps suffice."""
    launch = grazing(1.5, 0.01)
    every = fly(layer_volume(), [0, 0, 1.5], launch, 600.0)
    joined = fly(layer_volume(flatness=1e-6 / 2000), [0, 0, 1.5], launch, 600.0)
    exact, _ = mirage(joined.position[0], 1.5, launch)
    errors = np.abs(joined.position[2] - exact) / joined.length
    assert np.all(errors <= 1e-6)
    assert np.all(errors >= 1e-11)  # something is joined
    assert np.all(joined.steps[:2] * 2 < every.steps[:2])


def test_without_its_reach_a_blob_is_missed() -> None:
    """Negative control: a field that does not say how far a step may go is stepped through unseen."""

    class Reckless(field.UnboundedField):
        def __init__(self, inner: field.Field) -> None:
            super().__init__(inner.types)
            self._inner = inner

        def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
            return self._inner.value_and_gradient(position, active)

    blob = field.GaussianBlob(TYPES, 8.9e-6, 0.02)
    flown = fly(Reckless(blob), [-10, 0.02, 0], 0.0, 20.0, plane="xy")
    assert np.all(np.abs(flown.direction[1]) < 1e-9)


# ---------------------------------------------------------------- the asphalt transfer curve

ARCMIN = np.pi / 180 / 60
# T = 308.168 + 6.37 exp(−10.08 h) K, n = 1 + 7.86e-4·101/T, from 1.2 m: see test_rays_asphalt.
HEIGHT_AT_500_M = {
    -2: 0.9092409349804159,
    -4: 0.6189739252595535,
    -6: 0.3336197571947891,
    -8: 0.09430189437829967,
    -10: 0.06417386919454562,
}
GROUND_HIT_M = {
    -12: 365.154000310489,
    -14: 305.37817750549135,
    -16: 264.3289758952179,
    -18: 233.49241138439015,
    -20: 209.291456283213,
}


def wall(distance: float) -> trace.Surface:
    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        t = (distance - origin.x) / direction.x
        return active & (t > 0) & (t <= length), t

    return surface


@pytest.mark.parametrize("medium", ["closed form", "voxels"])
@pytest.mark.parametrize("accuracy", [1e-6, 1e-8, 1e-10])
def test_asphalt_transfer_curve(medium: str, accuracy: float) -> None:
    """Heights at the wall, 500 m away, and ground hits, chords included (two integrators, 3e-10 m).

    Voxels: 2 mm cells at the ground, through which the spline errs by less than 1e-9 rad.
    """
    if medium == "closed form":
        air: field.Field = field.ExponentialTemperature(TYPES)
    else:
        z = np.concatenate([np.arange(0.0, 0.5, 2e-3), 0.5 + np.cumsum(2e-3 * 1.03 ** np.arange(160))])
        z = z[z < 6]
        profile = 7.86e-4 * 101 / (308.168 + 6.37 * np.exp(-10.08 * z))
        data = np.broadcast_to(profile[:, None, None], (len(z), 2, 2))
        air = field.StratifiedVolume([-1, 600], [-5, 5], z, data, TYPES)
    angle = np.array([*HEIGHT_AT_500_M, *GROUND_HIT_M]) * ARCMIN
    end = trace.march(
        air,
        TYPES.Array3f(0, 0, 1.2),
        TYPES.Array3f(np.stack([np.cos(angle), 0 * angle, np.sin(angle)])),
        accuracy=accuracy,
        chord_tolerance=accuracy,
        max_chord_steps=1000,
        max_steps=20_000,
        surface=trace.combine(wall(500.0), trace.ground_plane(0.0)),
    )
    assert np.all(np.array(end.status) == trace.HIT)
    length = np.array(end.path_length)
    across = np.abs(np.array(end.position.z)[:5] - list(HEIGHT_AT_500_M.values())) / length[:5]
    along = np.abs(np.array(end.position.x)[5:] - list(GROUND_HIT_M.values())) / length[5:]
    across = np.concatenate([across, along * np.abs(np.array(end.direction.z)[5:])])
    # What integration and chords may add each; the source's own digits and the voxels' error.
    assert np.all(across <= 2 * accuracy + (1e-12 if medium == "closed form" else 1e-9))
    assert np.max(across) >= 1e-3 * accuracy
    assert np.max(np.abs(np.array(end.position.z)[5:])) < 1e-12
    assert float(dr.max(end.steps)[0]) < {1e-6: 700, 1e-8: 7000, 1e-10: 20_000}[accuracy]
