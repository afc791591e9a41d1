"""A panel of random dots: how much they cover, how large they are, and that they differ by their seed."""

import math

import numpy as np
import pytest
from scipy import ndimage

from nigemizu import render
from nigemizu.render.textures import covered_by_dots
from nigemizu.trace import Tracer

EVEN_SKY = render.Light(sky="constant", horizon_colour=(1, 1, 1), sun_scale=0)
BLACK_ON_WHITE = ((0.8, 0.8, 0.8), (0.0, 0.0, 0.0))


def view(*, rotation=0.0, distance=10.0, samples=16, **dots):
    """A panel, of which the picture shows half a metre at 10 m: (256, 256), 1 where it is bare."""
    camera = render.Camera(eye=(0, 0, 5), width=256, height=256, field_of_view=math.degrees(0.05))
    material = render.Dots(colours=BLACK_ON_WHITE, **dots)
    panel = render.Box(
        position=(distance, 0, 0), size=(0.02, 2 * distance, 10), rotation=rotation, material=material
    )
    integrator = render.integrator(None, render.Settings(tracer=Tracer(method="straight"), max_depth=2))
    scene = render.build(camera, EVEN_SKY, [panel], integrator=integrator)
    return render.picture(scene, samples=samples, seed=1).radiance.mean(axis=-1) / 0.8


@pytest.mark.parametrize("density", [0.1, 0.5, 1.0])
def test_dots_cover_their_share(density):
    """A little more than the 1 − exp(−density) of dots anywhere: one in each square overlap less."""
    covered, expected = 1 - view(diameter=0.012, density=density).mean(), covered_by_dots(density)
    assert abs(covered - expected) < 0.02
    assert 0 < expected - (1 - math.exp(-density)) < 0.15


def test_dots_have_their_diameter_and_are_round():
    """12 mm at 10 m, where a pixel is 1.95 mm: six pixels."""
    labels, count = ndimage.label(view(diameter=0.012, density=0.05) < 0.5)
    whole = [piece for piece in ndimage.find_objects(labels) if piece[0].start and piece[1].start
             and piece[0].stop < 256 and piece[1].stop < 256]  # fmt: skip
    sides = np.array([[part.stop - part.start for part in piece] for piece in whole])
    areas = ndimage.sum_labels(labels > 0, labels, np.arange(1, count + 1))
    assert len(whole) > 15
    assert abs(np.median(sides[:, 0]) - 6.1) < 1
    assert abs(np.median(sides[:, 1]) - 6.1) < 1
    assert abs(np.median(areas) / (math.pi / 4 * 6.15**2) - 1) < 0.15


def test_a_seed_makes_a_pattern():
    one, same, other = (view(seed=seed, diameter=0.02) for seed in (3, 3, 4))
    assert np.array_equal(one, same)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.1


def test_dots_turn_with_the_panel():
    """Seen straight on in both cases: the same share is covered from the side that faces along y."""
    covered = [1 - view(rotation=rotation, diameter=0.012).mean() for rotation in (0.0, 40.0)]
    assert abs(covered[0] - covered[1]) < 0.03


def test_far_dots_are_an_even_tone():
    """At 10 m a dot of 0.1 mm is a twentieth of a pixel."""
    picture = view(diameter=1e-4, density=0.5)
    assert picture.std() < 0.02
    assert abs(1 - picture.mean() - covered_by_dots(0.5)) < 0.01
