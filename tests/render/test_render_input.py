"""The user's own Mitsuba scenes, and what bad input gets."""

import subprocess
import sys

import mitsuba as mi
import numpy as np
import pytest
import xarray as xr
from pydantic import ValidationError
from render_scenes import sensor

from nigemizu import field, render, trace
from nigemizu.errors import InputError, MachineError

Y_UP = """<scene version="3.0.0">
  <integrator type="nigemizu">
    <string name="air" value="{air}"/>
    <float name="step" value="4"/>
    <integer name="max_depth" value="1"/>
    <string name="beyond" value="extend"/>
    <transform name="to_world">
      <rotate x="1" angle="-90"/>
      <scale value="100"/>
    </transform>
  </integrator>
  <sensor type="perspective">
    <float name="fov" value="3"/>
    <float name="near_clip" value="1"/>
    <float name="far_clip" value="1e9"/>
    <transform name="to_world">
      <lookat origin="0, 170, 0" target="100, 170, 0" up="0, 1, 0"/>
    </transform>
    <film type="hdrfilm">
      <integer name="width" value="48"/><integer name="height" value="48"/>
      <rfilter type="box"/><string name="pixel_format" value="rgb"/>
    </film>
    <sampler type="independent"/>
  </sensor>
  <emitter type="constant"/>
  <shape type="cube">
    <transform name="to_world">
      <scale x="500" y="150" z="250"/>
      <translate x="60000" y="150" z="-400"/>
    </transform>
    <emitter type="area"><rgb name="radiance" value="0.1"/></emitter>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><scale value="1e7"/><rotate x="1" angle="-90"/></transform>
    <emitter type="area"><rgb name="radiance" value="0.4"/></emitter>
  </shape>
</scene>"""


@pytest.fixture
def air_file(tmp_path):
    z = np.concatenate([[0.0], np.geomspace(0.005, 4.0, 40)])
    temperature = 303.0 + 25.0 * np.exp(-z / 0.2)
    data = np.broadcast_to(temperature[:, None, None], (z.size, 2, 2))
    dataset = xr.Dataset(
        {"air_temperature": (("z", "y", "x"), data, {"units": "K", "standard_name": "air_temperature"})},
        coords={"x": [-10.0, 1000.0], "y": [-100.0, 100.0], "z": z},
    )
    for axis in "xyz":
        dataset[axis].attrs["units"] = "m"
    path = tmp_path / "air.nc"
    dataset.to_netcdf(path)
    return path


def z_up(air):
    transform = mi.ScalarTransform4f
    camera = sensor(fov=3, width=48, height=48)
    camera["sampler"] = {"type": "independent"}
    return {
        "type": "scene",
        "integrator": {
            "type": "nigemizu", "air": str(air), "step": 4.0, "max_depth": 1, "beyond": "extend",
        },
        "sensor": camera,
        "sky": {"type": "constant"},
        "box": {
            "type": "cube",
            "to_world": transform().translate([600, 4, 1.5]) @ transform().scale([5, 2.5, 1.5]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 0.1}},
        },
        "ground": {
            "type": "rectangle",
            "to_world": transform().scale(1e5),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 0.4}},
        },
    }  # fmt: skip


def test_own_scene_with_y_up_in_centimetres_equals_ours(tmp_path, air_file):
    """The same world, described y-up in centimetres in XML and z-up in metres, gives the same picture."""
    path = tmp_path / "scene.xml"
    path.write_text(Y_UP.format(air=air_file))
    foreign = np.asarray(mi.render(mi.load_file(str(path)), spp=64, seed=1))
    ours = np.asarray(mi.render(mi.load_dict(z_up(air_file)), spp=64, seed=1))
    # Rounding differs, and with it the fate of a few samples on the edges.
    assert np.abs(foreign - ours).mean() < 1e-3
    straight = z_up(air_file)
    straight["integrator"] |= {"method": "straight"}
    unbent = np.asarray(mi.render(mi.load_dict(straight), spp=64, seed=1))
    assert np.abs(unbent - ours).mean() > 2e-2


def test_resolver_is_asked_for_names():
    asked = []

    def resolve(name, time):
        asked.append((name, time))
        z = np.array([0.0, 1.0, 4.0])
        return np.array([0.0, 10.0]), np.array([-1.0, 1.0]), z, np.full((3, 2, 2), 2.7e-4)

    render.register(resolve)
    try:
        mi.load_dict({"type": "nigemizu", "air": "desert", "time": 30.0})
    finally:
        render.register()
    assert asked == [("desert", 30.0)]


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"max_stepz": 3}, "did you mean 'max_steps'"),
        ({"step": -1.0}, "step"),
        ({"method": "curved"}, "method"),
        ({"air": "nowhere.nc"}, "nowhere.nc"),
        ({"air": "nowhere"}, "nowhere"),
        ({"visibility": 0.0}, "visibility"),
    ],
)
def test_bad_property_is_named(given, named):
    with pytest.raises(RuntimeError, match="nigemizu") as caught:
        mi.load_dict({"type": "nigemizu", **given})
    assert named in str(caught.value)


def test_uneven_frame_is_refused():
    stretched = mi.ScalarTransform4f().scale([1, 1, 2])
    with pytest.raises(RuntimeError, match="scaled evenly only"):
        mi.load_dict({"type": "nigemizu", "to_world": stretched})


def test_registering_twice_is_harmless():
    render.register()
    render.register()
    assert mi.load_dict({"type": "nigemizu"}) is not None


def test_second_variant_is_refused(variant):
    other = "cuda" if variant.startswith("llvm") else "llvm"
    with pytest.raises(MachineError, match="already in use"):
        render.select_variant(other)
    assert render.select_variant("auto") == variant
    with pytest.raises(InputError, match="backend"):
        render.select_variant("opengl")


def test_describing_a_scene_loads_no_mitsuba():
    code = "import sys, nigemizu.render as r; r.Ground(); r.Camera(); sys.exit('mitsuba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def build(objects, **camera):
    return render.build(render.Camera(**camera), render.Light(), objects, integrator={"type": "path"})


def test_bad_scenes_are_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"camera.eye.*not above the ground"):
        build([render.Ground(height=2.0)], eye=(0, 0, 1.7))
    with pytest.raises(InputError, match=r"camera.target"):
        build([], eye=(0, 0, 1.7), target=(0, 0, 1.7))
    texture = render.Texture(image=tmp_path / "brick.png")
    with pytest.raises(InputError, match=r"brick.png: objects.0.material.image: file not found"):
        build([render.Box(position=(10, 0, 0), material=texture)])
    with pytest.raises(InputError, match=r"bunny.ply: objects.1.file: file not found"):
        build([render.Ground(), render.Mesh(file=tmp_path / "bunny.ply")])
    with pytest.raises(InputError, match=r"mine.xml: objects.0.file: file not found"):
        build([render.MitsubaFile(file=tmp_path / "mine.xml")])
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"broken.png: objects.0.material.image: Mitsuba cannot read it"):
        build([render.Box(position=(10, 0, 0), material=render.Texture(image=broken))])
    with pytest.raises(InputError, match=r"objects.0.fragment.sun: not a Mitsuba shape"):
        build([render.MitsubaFile(fragment={"sun": {"type": "directional"}})])


def test_values_refuse_nonsense():
    for make in (
        lambda: render.Camera(field_of_view=0),
        lambda: render.Camera(width=0),
        lambda: render.Camera(filed_of_view=3),
        lambda: render.Colour(colour=(2, 0, 0)),
        lambda: render.Pyramid(height=-1),
        lambda: render.Light(turbidity=99),
        lambda: render.MitsubaFile(),
    ):
        with pytest.raises(ValidationError):
            make()


def test_layered_method_from_a_dataset(air_file):
    """The panes are cut from the dataset's profile; many panes come close to the volume, few do not."""
    pictures = {}
    for method, layers in (("bent", 2), ("layered", 300), ("layered", 4)):
        scene = z_up(air_file)
        scene["integrator"] |= {"method": method, "layers": layers}
        pictures[method, layers] = np.asarray(mi.render(mi.load_dict(scene), spp=64, seed=1))
    many = np.abs(pictures["layered", 300] - pictures["bent", 2]).mean()
    few = np.abs(pictures["layered", 4] - pictures["bent", 2]).mean()
    assert many < 0.01
    assert few > 3 * many


@pytest.mark.parametrize("precision", ["single", "double"])
def test_surfaces_of_a_scene_serve_the_tracer(variant, precision):
    """The callback takes and gives the caller's array types, double precision without derivatives too."""
    kind = field.types(variant.split("_")[0], precision, differentiable=precision == "single")
    wall = {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, -500]).scale(1e3)}
    surface = render.surface_query(mi.load_dict({"type": "scene", "wall": wall}))
    origin, down = kind.Array3f([0, 0], [0, 0], [0, 0]), kind.Array3f([0, 0], [0, 0], [-1, 1])
    end = trace.march(field.Uniform(kind), origin, down, step=10.0, max_steps=100, surface=surface)
    assert np.array(end.hit).tolist() == [True, False]
    assert isinstance(end.path_length, kind.Float)
    assert np.array(end.path_length)[0] == pytest.approx(500.0, rel=1e-6)
