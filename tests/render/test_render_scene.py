"""Pictures of described scenes: the horizon, haze, haste, and what a picture reports."""

import os
import signal
import time

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from render_scenes import bar, sensor, types

from nigemizu import field, render
from nigemizu.progress import ProgressMeter
from nigemizu.trace import Tracer


def hot_air(excess=25.0, depth=0.2, top=3.0):
    """n − 1 = 0.0797/T over ground that is warmer by `excess` (K)."""
    z = np.concatenate([[0.0], np.geomspace(0.005, top, 40)])
    refractivity = 0.0797 / (303.0 + excess * np.exp(-z / depth))
    column = np.broadcast_to(refractivity[:, None, None], (z.size, 2, 2))
    return field.TrilinearVolume([-10, 1500], [-300, 300], z, column, types(), beyond="extend")


def settings(**options):
    tracer = options.pop("tracer", Tracer(step=4.0))
    return render.Settings(tracer=tracer, **options)


def horizon_profile(medium, light):
    """Luminance by row, 0.025° per row, a telephoto view of bare ground and sky."""
    camera = render.Camera(eye=(0, 0, 1.7), field_of_view=0.4, width=16, height=192, samples=64)
    ground = render.Ground(material=render.Colour(colour=(0.2, 0.18, 0.15)))
    scene = render.build(camera, light, [ground], integrator=render.integrator(medium, settings()))
    return render.picture(scene, samples=64, seed=1).radiance.mean(axis=(1, 2))


@pytest.mark.parametrize("sky", ["sunsky", "gradient"])
@pytest.mark.parametrize("air", ["none", "hot"])
def test_horizon_is_closed(sky, air):
    """Rationale: a ground that ends, or a sky black below its horizon, leaves a dark stripe of few pixels.

    Expected: the ground fills the lower half of the picture (with no air), and no row is darker than the
    darker of ground and sky.
    """
    rows = horizon_profile(hot_air() if air == "hot" else None, render.Light(sky=sky))
    ground, above = rows[-3:].mean(), rows[86:94].mean()
    assert above > 1.3 * ground
    assert rows.min() > 0.95 * ground
    assert rows.max() < 1.05 * rows[:96].max()
    just_below = rows[98:106].mean()
    if air == "none":
        assert np.argmax(np.abs(np.diff(rows))) == 95
        assert abs(just_below - ground) < 0.1 * (above - ground)
    else:
        # The ground shows the sky as far down as the critical angle √(2 Δn) = 6.3 mrad, 14 rows.
        assert abs(just_below - above) < 0.1 * (above - ground)


def test_haze_hides_a_black_wall_by_koschmieder():
    """At the meteorological range V a black object has 2 % of its contrast left: radiance 0.98 of the sky."""
    sky = {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}
    found = []
    for distance in (100.0, 250.0, 1000.0):
        wall = bar(distance, 0.0, 1e3)
        del wall["emitter"]
        integrator = render.integrator(None, settings(visibility=1000.0, max_depth=2))
        scene = mi.load_dict(
            {"type": "scene", "sensor": sensor(width=4, height=4), "sky": sky, "wall": wall,
             "integrator": integrator}
        )  # fmt: skip
        found.append(render.picture(scene, samples=16).radiance.mean())
    expected = [1 - 0.02 ** (distance / 1000.0) for distance in (100.0, 250.0, 1000.0)]
    np.testing.assert_allclose(found, expected, rtol=3e-4)


def small_scene(medium, tracer=None):
    camera = render.Camera(eye=(0, 0, 1.7), field_of_view=4, width=48, height=32)
    objects = [render.Ground(), render.Pyramid(position=(600, 0, 0), base=30, height=15)]
    integrator = render.integrator(medium, settings(tracer=tracer or Tracer(step=4.0)))
    return render.build(camera, render.Light(), objects, integrator=integrator)


@pytest.mark.parametrize(
    "tracer", [Tracer(step=4.0), Tracer(sharing=False), Tracer()], ids=["fixed steps", "single", "shared"]
)
def test_frames_and_passes_reuse_kernels(monkeypatch, tracer):
    """New air and new random numbers must not be compiled in.

    With shared paths a picture's kernel is one of four: all blocks share or not, and their segments are short
    or not. The airs here are alike enough for that to stay as it is.
    """
    monkeypatch.setattr("nigemizu.render.passes._PASS_RAYS", 48 * 32 * 4)
    scene = small_scene(hot_air(), tracer)
    kernels = []
    for frame in range(3):
        scene.integrator().set_medium(hot_air(excess=20.0 + 0.1 * frame, depth=0.2 + 1e-3 * frame))
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            render.picture(scene, samples=12, seed=3, frame=frame)
            made = dr.kernel_history([dr.KernelType.JIT])
            # Small ones sort and copy; what they are differs with how the memory of arrays is aligned.
            kernels.append({entry["hash"] for entry in made if entry["operation_count"] > 500})
    assert kernels[0]
    assert kernels[2] <= kernels[0] | kernels[1]


class Counter(ProgressMeter):
    def __init__(self):
        self.log = []

    def start(self, label, total):
        self.log.append(total)

    def advance(self, amount=1):
        self.log.append(amount)

    def finish(self):
        self.log.append("end")


def test_picture_reports_and_repeats(monkeypatch):
    monkeypatch.setattr("nigemizu.render.passes._PASS_RAYS", 48 * 32 * 4)
    scene, meter = small_scene(hot_air()), Counter()
    first = render.picture(scene, samples=10, seed=3, frame=1, progress=meter)
    assert meter.log == [10, 4, 4, 2, "end"]
    assert first.radiance.shape == (32, 48, 3)
    assert first.radiance.dtype == np.float32
    assert sum(first.statuses.values()) == 48 * 32 * 10
    assert first.statuses["hit"] > 0
    assert first.statuses["escaped"] > 0
    assert first.statuses["out-of-steps"] == 0
    again = render.picture(small_scene(hot_air()), samples=10, seed=3, frame=1)
    np.testing.assert_allclose(again.radiance, first.radiance, rtol=1e-5, atol=1e-6)
    other = render.picture(scene, samples=10, seed=3, frame=2)
    assert np.abs(other.radiance - first.radiance).max() > 1e-2
    brighter = render.picture(scene, samples=10, seed=3, frame=1, exposure=1.0)
    np.testing.assert_allclose(brighter.radiance, 2 * first.radiance, rtol=1e-5, atol=1e-6)


def test_rays_out_of_steps_are_counted_and_go_straight_on():
    scene = small_scene(hot_air(), Tracer(step=4.0, max_steps=3))
    picture = render.picture(scene, samples=4)
    assert picture.statuses["out-of-steps"] > 0.3 * 48 * 32 * 4
    assert np.isfinite(picture.radiance).all()
    assert picture.radiance.min() > 0.01


@pytest.mark.parametrize(
    "light", [render.Light(), render.Light(sky="gradient"), render.Light(sky="constant")]
)
def test_white_ground_has_radiance_one(light):
    """Exposure 0 is defined by it (depth 2: light that comes straight from sun and sky)."""
    camera = render.Camera(eye=(0, 0, 10), pitch=-60, field_of_view=10, width=8, height=8)
    ground = render.Ground(material=render.Colour(colour=(1, 1, 1)))
    integrator = render.integrator(None, settings(max_depth=2))
    scene = render.build(camera, light, [ground], integrator=integrator)
    image = render.picture(scene, samples=1024).radiance.mean(axis=(0, 1))
    luminance = image @ [0.2126, 0.7152, 0.0722]
    assert 0.98 < luminance < 1.02


def test_all_objects_are_seen():
    """Each object changes the picture where it stands, and only a band around it."""
    camera = render.Camera(eye=(0, 0, 1.7), field_of_view=8, width=64, height=32)
    sky = render.Light(sky="constant", horizon_colour=(1, 1, 1))
    dark = render.Colour(colour=(0.01, 0.01, 0.01))
    objects = {
        "pyramid": render.Pyramid(position=(300, 0, 0), base=10, height=8),
        "box": render.Box(position=(300, 0, 0), size=(4, 4, 6), material=dark),
        "pole": render.Pole(position=(300, 0, 0), height=7, diameter=2, colours=((0, 0, 0), (0, 0, 0))),
        "sphere": render.Sphere(position=(300, 0, 3), radius=3, material=dark),
        "hills": render.Hills(distance=5000, height=150, spread=5, colour=(0, 0, 0)),
        "vehicle": render.Vehicle(position=(120, 0, 0)),
        "aircraft": render.Aircraft(position=(600, 0, 0), colour=(0.3, 0.3, 0.3)),
        "mitsuba": render.MitsubaFile(
            fragment={
                "type": "cube",
                "to_world": mi.ScalarTransform4f().translate([300, 0, 3]).scale(3),
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
            }
        ),
    }
    for name, item in objects.items():
        scene = render.build(camera, sky, [item], integrator=render.integrator(None, settings()))
        image = render.picture(scene, samples=32).radiance.mean(axis=2)
        covered = image < 0.8
        assert 6 < covered.sum() < 0.5 * covered.size, name
        middle = np.nonzero(covered)[1].mean() + 0.5
        assert abs(middle - 32) < 4, name
        assert covered[:, 0].sum() == 0, name


@pytest.mark.parametrize("distance", [60.0, 1000.0, 20_000.0])
def test_ground_is_met_where_it_is(distance):
    """A ray that grazes the ground from 1.7 m meets it within 10⁻⁶ of the distance of the exact point.

    (One rectangle of the same size is off by 0.2 m at any distance.)
    """
    scene = render.build(render.Camera(), render.Light(), [render.Ground()], integrator={"type": "path"})
    rng = np.random.default_rng(2)
    x = distance * (1 + 0.1 * rng.random(10_000))
    towards = np.stack([x, 0.03 * x, np.full_like(x, -1.7)])
    towards = (towards / np.linalg.norm(towards, axis=0)).astype(np.float32)
    ray = mi.Ray3f(mi.Point3f(0, -1.9, 1.7), mi.Vector3f(towards))
    met = scene.ray_intersect(ray)
    exact = towards.astype(np.float64) * (np.float64(np.float32(1.7)) / -towards[2].astype(np.float64))
    exact += np.array([[0.0], [-1.9], [np.float64(np.float32(1.7))]])
    assert np.all(np.array(met.is_valid()))
    error = np.abs(np.array(met.p, dtype=np.float64) - exact).max(axis=1)
    assert error[0] < 1e-6 * distance
    assert error[1] < 1e-6 * distance
    assert np.all(np.array(met.p)[2] == 0)


def test_short_chords_meet_a_far_car():
    """Rationale: chords begin close to what they meet; packets of such rays must not lose flat parts.

    Expected: seen from 0.8 m behind, the rear of a car 760 m from the origin is met by every ray, at its
    body (x = 757.8), at what stands out from it, or where it is rounded (x < 758.4). Handed to Embree as
    coherent packets, a third of these rays went through.
    """
    car = render.Vehicle(position=(760.0, 1.9, 0.0), heading=0.0)
    scene = render.build(render.Camera(), render.Light(), [car], integrator=render.integrator())
    rng = np.random.default_rng(np.random.SeedSequence(11))
    places, lanes = 4000, 16
    middle = np.stack([np.full(places, 757.0), rng.uniform(1.3, 2.5, places), rng.uniform(0.5, 1.0, places)])
    origin = np.repeat(middle, lanes, axis=1)
    slope = np.stack([rng.uniform(-5e-3, 5e-3, places), rng.uniform(-6e-3, 6e-3, places)])
    direction = np.concatenate([np.ones((1, places * lanes)), np.repeat(slope, lanes, axis=1)])
    origin[1:] += rng.uniform(-1e-2, 1e-2, (2, places * lanes))
    direction[1:] += rng.uniform(-5e-5, 5e-5, (2, places * lanes))
    direction /= np.linalg.norm(direction, axis=0)
    query = render.surface_query(scene)
    hit, distance = query(
        mi.Point3f(origin), mi.Vector3f(direction), mi.Float(np.full(places * lanes, 40.0)), True
    )
    assert np.all(np.array(hit))
    assert 0.5 < np.array(distance).min() < np.array(distance).max() < 1.4


def test_ctrl_c_between_pictures_is_seen():
    """Mitsuba leaves its own handler behind, which drops the first Ctrl-C after a rendering."""
    scene = render.build(
        render.Camera(width=4, height=4), render.Light(), [render.Ground()], integrator=render.integrator()
    )
    render.picture(scene, samples=1)
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012  (the signal arrives a moment later)
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)
