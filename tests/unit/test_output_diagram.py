"""The ray diagram: what is drawn, from rays whose shape is known."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from PIL import Image

from nigemizu.errors import InputError
from nigemizu.output import DiagramRay, Outline, Profile, Provenance, ray_diagram, vanishing_line
from nigemizu.scene import Scene
from nigemizu.scene.ray_files import _outlines, _reach

X = np.linspace(0.0, 600.0, 1201)
EYE = 1.6


def ray(slope, curvature=2e-5):
    """z = eye + s x + c x²/2: the paraxial ray in a constant gradient, cut where it meets the ground."""
    z = EYE + slope * X + 0.5 * curvature * X**2
    hits = np.flatnonzero(z < 0.0)
    if hits.size:
        last = int(hits[0])
        return DiagramRay(np.append(X[:last], X[last]), np.append(z[:last], 0.0), "hit")
    return DiagramRay(X, z, "escaped")


BUNDLE = [ray(slope) for slope in np.linspace(-0.012, 0.002, 141)]
PROFILE = Profile(np.linspace(0, 5, 51), np.linspace(2.4e-4, 2.6e-4, 51), np.linspace(330, 300, 51))
PYRAMID = Outline("pyramid", np.array([400.0, 480.0, 560.0]), np.array([0.0, 30.0, 0.0]))


def test_kinds_of_rays():
    assert ray(-0.012).kind() == "direct"
    assert ray(-0.005).kind() == "turned"
    assert ray(0.002).kind() == "sky"
    assert ray(-0.001, curvature=0.0).kind() == "sky"
    assert DiagramRay(X, EYE + 0 * X, "out-of-steps").kind() == "lost"


def test_vanishing_line_is_the_envelope():
    """The limiting ray grazes the ground: s = -sqrt(2 c z_eye), at x0 = sqrt(2 z_eye/c) = 400 m.

    Beyond it the lowest ray is that one, z = c (x - x0)²/2; the bundle is 0.1 mrad fine and holds it.
    """
    x, z = vanishing_line(BUNDLE)
    assert x[0] == pytest.approx(400.0, abs=1.0)
    assert x[-1] == pytest.approx(600.0)
    assert z == pytest.approx(0.5 * 2e-5 * (x - 400.0) ** 2, abs=1e-4)


def test_vanishing_line_ends_at_an_object():
    cut = [
        DiagramRay(one.x[one.x <= 500.0], one.z[one.x <= 500.0], "hit") if one.x[-1] > 500.0 else one
        for one in BUNDLE
    ]
    x, _ = vanishing_line([*cut, DiagramRay(X, 5.0 + 0 * X, "escaped")])
    assert x[-1] == pytest.approx(500.0, abs=1.0)


def test_no_vanishing_line_where_all_is_ground():
    x, z = vanishing_line([ray(-0.02), ray(-0.03)])
    assert x.size == z.size == 0


def texts(path):
    words = path.read_text(encoding="utf-8")
    ElementTree.fromstring(words)  # well-formed
    # Each text is drawn as outlines: with itself as a comment, or with a halo and its identifier.
    return re.findall(r"<!-- (.*?) -->", words) + re.findall(r'<g id="(.*?)"', words)


def test_everything_is_named(tmp_path):
    path = ray_diagram(
        tmp_path / "rays.svg",
        rays=BUNDLE,
        profile=PROFILE,
        objects=[PYRAMID],
        vanishing=vanishing_line(BUNDLE),
        title="Hot sand",
        provenance=Provenance(scene="a = 1"),
    )
    words = texts(path)
    for expected in (
        "Hot sand",
        "object pyramid",
        "eye",
        "distance (m)",
        "height above the ground (m)",
        "temperature (°C)",
        "vanishing line: below it nothing is seen",
        "the ground is seen",
        "“water”: no ground is seen",
        "turned back up by the hot air",
        "to the ground or an object",
        "to the sky",
    ):
        assert expected in words
    assert any(word.startswith("heights exaggerated ×") for word in words)
    assert "a = 1" in path.read_text(encoding="utf-8")


def test_parts_may_be_left_out(tmp_path):
    words = texts(ray_diagram(tmp_path / "rays.svg", rays=[ray(0.002)]))
    assert "temperature (°C)" not in words
    assert "to the ground or an object" not in words
    assert "height above the ground (m)" in words


def over_a_round_sea(dip, radius=6371e3, eye=10.0):
    """A straight ray: z = eye - dip x + x²/2R, which turns up over the sea without any air."""
    x = np.linspace(0.0, 34e3, 1201)
    z = eye - dip * x + x**2 / (2.0 * radius)
    return DiagramRay(x, z, "escaped")


def test_over_the_sea_of_a_round_earth(tmp_path):
    """Nothing hot turns these rays, and 34 km are not written in metres."""
    # sqrt(2·10 m / 6371 km) = 1.772 mrad is the dip of the horizon: these pass above it.
    rays = [over_a_round_sea(dip) for dip in (0.0005, 0.001, 0.00177)]
    assert {one.kind() for one in rays} == {"turned"}
    line = (rays[-1].x[600:], rays[-1].z[600:])
    words = texts(ray_diagram(tmp_path / "a.svg", rays=rays, profile=PROFILE, vanishing=line, surface="sea"))
    for expected in (
        "distance (km)",
        "height above the sea (m)",
        "lowest over the sea, then up again",
        "the sea is seen",
        "no sea is seen",
        "vanishing line: below it nothing is seen",
    ):
        assert expected in words
    assert not [word for word in words if "hot air" in word or "ground" in word]
    ticks = [float(word) for word in words if re.fullmatch(r"\d+", word) and float(word) <= 40]
    assert {0, 10, 20, 30} <= set(ticks)


def test_a_point_of_a_vanishing_line_and_parts_of_a_ship_are_not_all_named(tmp_path):
    rays = [over_a_round_sea(0.001)]
    sides = np.array([29990.0, 30010.0, 30010.0, 29990.0])
    parts = [
        Outline(name, sides + shift, np.array([low, low, high, high]))
        for name, low, high, shift in (("hull", 0, 8, 0), ("mast", 8, 20, 2), ("buoy", 0, 3, -9e3))
    ]
    line = (np.array([29900.0, 30000.0]), np.array([0.0, 0.1]))
    path = tmp_path / "a.svg"
    words = texts(ray_diagram(path, rays=rays, objects=parts, vanishing=line, surface="sea"))
    assert {word for word in words if word.startswith("object ")} == {"object mast", "object buoy"}
    assert not [word for word in words if word.startswith("vanishing")]


def test_colours_reach_the_picture(tmp_path):
    path = ray_diagram(tmp_path / "rays.png", rays=BUNDLE, profile=PROFILE, top=5.0)
    with Image.open(path) as image:
        assert image.size == (1680, 800)
        assert image.text["Software"].startswith("nigemizu ")
        pixels = np.asarray(image.convert("RGB")).astype(int)[150:650, 420:1600]
    for colour in ((0xC8, 0x44, 0x2B), (0x2A, 0x6F, 0x97), (0x8F, 0xB3, 0xC9)):
        assert (np.abs(pixels - colour).max(axis=-1) < 40).sum() > 300


@pytest.mark.parametrize("suffix", [".svg", ".png", ".pdf"])
def test_equal_rays_give_equal_bytes(tmp_path, suffix):
    first, second = (
        ray_diagram(tmp_path / f"{name}{suffix}", rays=BUNDLE[::20], profile=PROFILE).read_bytes()
        for name in "ab"
    )
    assert first == second


def test_refused(tmp_path):
    with pytest.raises(InputError, match=r"\.jpg.*expected \.svg, \.png or \.pdf"):
        ray_diagram(tmp_path / "rays.jpg", rays=BUNDLE)
    with pytest.raises(InputError, match="no rays to draw"):
        ray_diagram(tmp_path / "rays.svg", rays=[])
    (tmp_path / "file").write_text("a file")
    with pytest.raises(InputError, match="Not a directory"):
        ray_diagram(tmp_path / "file" / "rays.svg", rays=[ray(0.002)])


@pytest.mark.parametrize(
    ("name", "kilometres"),
    [
        ("fata-morgana", 18.5),  # 1.15 times the 16.093 km to the ship; the coast behind it does not count
        ("looming", 51.8),  # of the 45 km to the coast
        ("sunset-mock", 83.0),  # three times sqrt(2 · 6378.14 km · 60 m) = 27.67 km
    ],
)
def test_how_far_the_figure_goes(name, kilometres):
    scene = Scene.load(name)
    assert _reach(scene, _outlines(scene)) == pytest.approx(1e3 * kilometres, rel=3e-3)


def test_a_coast_is_what_is_looked_at_where_nothing_else_is():
    scene = Scene.load("looming")
    (coast,) = _outlines(scene)
    assert (coast.name, coast.z.min(), coast.z.max()) == ("hills", 0.0, 75.0)
    assert coast.x.mean() == pytest.approx(45e3, rel=1e-9)
    assert "hills" not in {one.name for one in _outlines(Scene.load("fata-morgana"))}
    assert "hills" not in {one.name for one in _outlines(Scene.load("pyramid"))}
