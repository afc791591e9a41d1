"""Which way is up, left and towards the denser air, against closed forms and double precision."""

import math

import mitsuba as mi
import numpy as np
import pytest
from render_scenes import apparent_elevation, bar, height_at, row_of, sensor, types

from nigemizu import field, render
from nigemizu.trace import Tracer

FOV, WIDTH, HEIGHT = 2.0, 64, 128
PIXEL = 2 * math.tan(math.radians(FOV) / 2) / WIDTH


def image_of(medium, shapes, *, eye=(0, 0, 1.7), step=2.0, spp=64, method="bent", max_steps=2000):
    """Red channel of what shines."""
    tracer = Tracer(method=method, step=step, max_steps=max_steps, chord_tolerance=0.05)
    integrator = render.integrator(medium, render.Settings(tracer=tracer, max_depth=1))
    camera = sensor(eye=eye, fov=FOV, width=WIDTH, height=HEIGHT)
    scene = mi.load_dict({"type": "scene", "integrator": integrator, "sensor": camera, **shapes})
    return render.picture(scene, samples=spp, seed=5).radiance[..., 0].astype(float)


def centre_row(profile, top=0, bottom=None):
    rows = np.arange(len(profile)) + 0.5
    part = slice(top, bottom)
    return float(np.sum(rows[part] * profile[part]) / np.sum(profile[part]))


def test_up_is_the_first_row_and_left_is_the_first_column():
    pixel_at_500 = 500 * PIXEL
    shapes = {"dot": bar(500.0, 1.7 + 20 * pixel_at_500, pixel_at_500, pixel_at_500, y=10 * pixel_at_500)}
    image = image_of(None, shapes)
    rows, columns = np.nonzero(image > 0.5)
    assert abs(rows.mean() + 0.5 - (HEIGHT / 2 - 20)) < 0.1
    assert abs(columns.mean() + 0.5 - (WIDTH / 2 - 10)) < 0.1


@pytest.mark.parametrize("b", [-6e-6, 6e-6])
def test_apparent_elevation_in_a_linear_field(b):
    """n² = a + b z: Z − z₀ = X t + b X² (1 + t²)/(4 n₀²) with t the tangent of the apparent elevation."""
    a, x, z, eye = 1.00054, 400.0, 2.0, 1.7
    n2 = a + b * eye
    quadratic = [b * x * x / (4 * n2), x, b * x * x / (4 * n2) - (z - eye)]
    tangent = max(np.roots(quadratic), key=lambda t: -abs(t))
    image = image_of(field.LinearSquare(types(), a, b), {"bar": bar(x, z, 0.2)}, max_steps=250)
    expected = row_of(math.atan(tangent), FOV, WIDTH, HEIGHT)
    straight = row_of(math.atan((z - eye) / x), FOV, WIDTH, HEIGHT)
    # Denser air below (b < 0) bends rays down and lifts the image: nearer to row 0.
    assert math.copysign(1, expected - straight) == math.copysign(1, b)
    assert abs(expected - straight) > 1.0
    assert abs(centre_row(image.mean(axis=1)) - expected) < 0.1


@pytest.mark.parametrize("along", ["y", "z"])
def test_blob_moves_the_image_away_from_itself(along):
    """A denser blob beside the line of sight bends light towards itself; the arrays are [z][y][x]."""
    amplitude, width, offset, at, target = 2e-4, 0.8, 0.8, 60.0, 120.0
    x = np.linspace(at - 5, at + 5, 81)
    y, z = np.linspace(-4, 4, 65), np.linspace(-2.3, 5.7, 65)
    cy, cz = (offset, 1.7) if along == "y" else (0.0, 1.7 + offset)
    r2 = (x[None, None, :] - at) ** 2 + (y[None, :, None] - cy) ** 2 + (z[:, None, None] - cz) ** 2
    volume = field.TrilinearVolume(x, y, z, amplitude * np.exp(-r2 / (2 * width**2)), types())
    half = 4 * PIXEL * target
    image = image_of(volume, {"dot": bar(target, 1.7, half, half)}, step=0.25)
    # Deflection of a thin Gaussian lens: ∫ ∂n/∂y dx = A (y₀/w²) exp(−y₀²/2w²) w √2π.
    bend = amplitude * offset / width * math.exp(-(offset**2) / (2 * width**2)) * math.sqrt(2 * math.pi)
    expected = bend * (target - at) / target / PIXEL
    down = centre_row(image.mean(axis=1)) - HEIGHT / 2
    right = centre_row(image.mean(axis=0)) - WIDTH / 2
    moved, still = (right, down) if along == "y" else (down, right)
    assert expected > 0.1
    assert 0.9 * expected < moved < 1.1 * expected
    assert abs(still) < 0.02


def hot_layer(z, a=1.00054, amplitude=4e-5, h=0.25):
    less = amplitude * math.exp(-z / h)
    return a - less, less / h


def test_inverted_image_stands_below_the_horizon():
    """A bar over a hot layer is seen twice: once directly, once below the horizon, turned upside down."""
    eye, x, z, half = 1.5, 600.0, 1.2, 0.1
    medium = field.ExponentialSquare(types(), 1.00054, 4e-5, 0.25)
    image = image_of(medium, {"bar": bar(x, z, half)}, eye=(0, 0, eye), step=1.0, max_steps=700)
    profile = image.mean(axis=1)
    # The lowest height at the bar's distance divides the two images.
    angles = np.linspace(-6.3e-3, 2e-3, 161)
    heights = np.array([height_at(angle, x, eye, hot_layer) for angle in angles])
    fold = angles[np.argmin(heights)]
    lower = [apparent_elevation(z + s * half, -6.3e-3, fold, x, eye, hot_layer) for s in (-1, 1)]
    upper = [apparent_elevation(z + s * half, fold, 2e-3, x, eye, hot_layer) for s in (-1, 1)]
    assert lower[1] < lower[0] < fold  # upside down
    assert fold < upper[0] < upper[1]
    split = round(row_of(fold, FOV, WIDTH, HEIGHT))
    for edges, part in ((upper, slice(0, split)), (lower, slice(split, None))):
        rows = [row_of(angle, FOV, WIDTH, HEIGHT) for angle in edges]
        assert abs(profile[part].sum() - abs(rows[1] - rows[0])) < 0.15
        assert abs(centre_row(profile, part.start, part.stop) - sum(rows) / 2) < 0.15
    straight = image_of(None, {"bar": bar(x, z, half)}, eye=(0, 0, eye)).mean(axis=1)
    assert straight[split:].sum() == 0


def test_panes_reflect_totally():
    """One boundary at 0.5 m: a mirror for rays flatter than the critical angle, glass for steeper ones."""
    boundary, eye, x, z, half = 0.5, 1.5, 400.0, 1.5, 0.1
    cold, hot = 2.7e-4, 2.5e-4
    medium = field.Layers([boundary], [hot, cold], types())
    image = image_of(medium, {"bar": bar(x, z, half)}, eye=(0, 0, eye), method="layered")
    profile = image.mean(axis=1)
    mirrored = -math.atan((eye + z - 2 * boundary) / x)
    critical = math.acos((1 + hot) / (1 + cold))
    assert -mirrored < critical
    row = row_of(mirrored, FOV, WIDTH, HEIGHT)
    assert abs(centre_row(profile, HEIGHT // 2 + 3) - row) < 0.1
    assert abs(profile[HEIGHT // 2 + 3 :].sum() - 2 * half / x / PIXEL) < 0.1
    # Negative control: with a smaller step of the index the ray goes through.
    faint = field.Layers([boundary], [cold - 0.5 * mirrored**2 / 2, cold], types())
    image = image_of(faint, {"bar": bar(x, z, half)}, eye=(0, 0, eye), method="layered")
    assert image.mean(axis=1)[round(row) - 3 : round(row) + 3].sum() == 0
