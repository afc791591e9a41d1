"""The textures of the ground, in the view along it that mirages are photographed in."""

import numpy as np

from nigemizu import render
from nigemizu.trace import Tracer

EVEN_SKY = render.Light(sky="constant", horizon_colour=(1, 1, 1), sun_scale=0)
TELEPHOTO = {"field_of_view": 2.6, "pitch": -0.7}  # shows 85 to 160 m of the ground
PLAIN = (0.085, 0.085, 0.085)


def view(material, *, road=None, **camera):
    """Brightness of the ground under an even sky, (height, width)."""
    shown = {"eye": (0.0, 0.0, 1.3), "width": 256, "height": 96, **TELEPHOTO, **camera}
    settings = render.Settings(tracer=Tracer(method="straight"), max_depth=2)
    ground = render.Ground(material=material, road=road)
    integrator = render.integrator(None, settings)
    scene = render.build(render.Camera(**shown), EVEN_SKY, [ground], integrator=integrator)
    return render.picture(scene, samples=64, seed=2).radiance.mean(axis=-1)


def streakiness(picture):
    """How much faster the brightness changes from row to row than from column to column."""
    return np.abs(np.diff(picture, axis=0)).mean() / np.abs(np.diff(picture, axis=1)).mean()


def unevenness(picture):
    return picture.std() / picture.mean()


def test_sand_has_no_streaks_along_the_line_of_sight():
    """A patch as long as wide is seen a hundred times wider than high: streaks like the grain of wood.

    Negative control: a pattern of squares.
    """
    assert 1.0 < streakiness(view(render.Sand())) < 4.5
    assert 1.0 < streakiness(view(render.Asphalt())) < 4.5
    assert streakiness(view(render.Checker(size=4.0))) > 6.0
    # Looking down, the ground near by has no direction.
    assert 0.7 < streakiness(view(render.Sand(), field_of_view=40.0, pitch=-30.0)) < 1.4


def test_patterns_keep_the_mean_reflectance():
    for material in (render.Sand(), render.Asphalt()):
        even = view(render.Colour(colour=material.colour), field_of_view=40.0, pitch=-12.0)
        shown = view(material, field_of_view=40.0, pitch=-12.0)
        assert 0.97 < shown.mean() / even.mean() < 1.03


def test_sand_is_even_where_a_pixel_covers_its_patches():
    """Six rows just below the horizon, where a pixel covers 40 m of ground and more, and six at 30 m."""
    picture = view(render.Sand(), field_of_view=26.0, pitch=-2.0)
    assert unevenness(picture[:28]) < 1e-5  # sky
    assert unevenness(picture[30:36]) < 0.03
    assert 0.06 < unevenness(picture[-6:]) < 0.15


def test_the_edge_of_a_road_crumbles():
    """One edge, at y = −0.25 m: it fades over some pixels, and jumps by less than one from row to row."""
    bare = render.Asphalt(colour=PLAIN, contrast=0.0)
    road = render.Road(centre=-4.0, surface=bare, line_colour=PLAIN)
    picture = view(render.Sand(contrast=0.0), road=road)
    share = (picture - picture.min()) / np.ptp(picture)
    place, rows = share.sum(axis=1), np.arange(len(share))
    wander = place - np.polyval(np.polyfit(rows, place, 2), rows)
    assert 0.2 < np.abs(np.diff(wander)).mean() < 1.0
    fading = np.count_nonzero((share > 0.1) & (share < 0.9), axis=1)
    assert 4 <= np.median(fading) <= 25
