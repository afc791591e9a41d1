"""The boxes around objects hold every surface, and little else."""

import functools

import mitsuba as mi
import numpy as np
import pytest

import nigemizu
from nigemizu import render
from nigemizu.errors import InputError
from nigemizu.render import meshes
from nigemizu.render.bounds import object_boxes


@functools.cache
def built_in(name):
    scene = nigemizu.load(name)
    return render.build(scene.camera, scene.light, scene.objects, integrator={"type": "direct"})


def mesh(triangles):
    made = mi.Mesh("mesh", len(triangles.vertices), len(triangles.faces))
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = mi.Float(triangles.vertices.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(triangles.faces.astype(np.uint32).ravel())
    parameters.update()
    return made


def scene_of(*shapes):
    return mi.load_dict({"type": "scene", **{f"shape{index}": shape for index, shape in enumerate(shapes)}})


def together(*parts):
    """One mesh of several."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return meshes.Triangles(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def houses(count, extent=2e3):
    rng = np.random.default_rng(11)
    places = np.column_stack([rng.uniform(-extent, extent, (count, 2)), np.zeros(count)])
    return [meshes.box((10.0, 8.0, 6.0)).moved(tuple(place)) for place in places]


def are_inside(points, boxes):
    """Whether each point (N, 3) is in some box."""
    found = np.zeros(len(points), dtype=bool)
    for lower, upper in boxes:
        found |= np.all((points >= lower) & (points <= upper), axis=1)
    return found


def vertices_of(shape):
    return shape.vertex_positions_buffer().numpy().reshape(-1, 3).astype(float)


def points_on(shape, count=2000):
    random = np.random.default_rng(3).random((2, count)).astype(np.float32)
    return shape.sample_position(0.0, mi.Point2f(random)).p.numpy().T.astype(float)


def hits(scene, target, count=4000):
    """Where rays from all around meet the scene."""
    rng = np.random.default_rng(4)
    start = rng.standard_normal((3, count)) * 20 + np.reshape(target, (3, 1))
    aim = rng.standard_normal((3, count)) + np.reshape(target, (3, 1))
    ray = mi.Ray3f(mi.Point3f(start), mi.Vector3f((aim - start) / np.linalg.norm(aim - start, axis=0)))
    found = scene.ray_intersect(ray)
    return found.p.numpy().T[found.is_valid().numpy()].astype(float)


def volume(boxes):
    return np.prod(boxes[:, 1] - boxes[:, 0], axis=1).sum()


@pytest.mark.parametrize("name", ["pyramid", "road"])
@pytest.mark.parametrize("most", [512, 4, 1])
def test_every_surface_of_the_built_in_scenes_is_inside(name, most):
    scene = built_in(name)
    boxes = object_boxes(scene, most=most)
    assert boxes.shape[1:] == (2, 3)
    assert 1 <= len(boxes) <= most
    assert np.all(boxes[:, 0] <= boxes[:, 1])
    for shape in scene.shapes():
        assert are_inside(vertices_of(shape), boxes).all()
        assert are_inside(points_on(shape), boxes).all()
    # Negative control: the boxes are no larger than they need be.
    assert not are_inside(vertices_of(scene.shapes()[-1]) + np.array([0, 0, 100.0]), boxes).all()


def test_the_ground_has_no_height_and_objects_few_boxes():
    boxes = object_boxes(built_in("pyramid"))
    wide = boxes[boxes[:, 1, 0] - boxes[:, 0, 0] > 1e4]
    assert len(wide) == 1
    assert np.ptp(wide[0, :, 2]) < 1e-9
    assert np.all(np.abs(wide[0, :, :2]) >= 1e6)
    tallest = boxes[1:, 1, 2].max()
    assert 24.0 <= tallest < 24.001
    assert len(boxes) < 20


def test_the_parts_of_a_car_share_a_box():
    boxes = object_boxes(built_in("road"))
    size = boxes[:, 1] - boxes[:, 0]
    cars = (size[:, 0] > 3) & (size[:, 0] < 6)
    assert cars.sum() == 2
    assert len(boxes) < 30


def test_raised_ground_is_as_thick_as_its_rounding():
    boxes = object_boxes(scene_of(mesh(meshes.plain(37.5))))
    assert len(boxes) == 1
    assert boxes[0, 0, 2] <= 37.5 <= boxes[0, 1, 2]
    assert np.ptp(boxes[0, :, 2]) < 1e-4


def test_a_house_in_the_mesh_of_the_ground_gets_its_own_box():
    scene = scene_of(mesh(together(meshes.plain(0.0), meshes.box((10, 8, 6)).moved((300.0, 5.0, 0.0)))))
    boxes = object_boxes(scene)
    assert len(boxes) == 2
    assert volume(boxes) == pytest.approx(480.0, rel=1e-3)
    assert are_inside(vertices_of(scene.shapes()[0]), boxes).all()


def test_a_ring_of_hills_leaves_its_middle_empty():
    ring = meshes.hills(render.Hills(distance=5000.0, height=40.0, spread=360.0))
    scene = scene_of(mesh(ring))
    boxes = object_boxes(scene)
    assert 8 <= len(boxes) <= 512
    assert not are_inside(np.array([[0.0, 0.0, 1.5]]), boxes).any()
    assert are_inside(vertices_of(scene.shapes()[0]), boxes).all()
    few = object_boxes(scene, most=5)
    assert len(few) <= 5
    assert are_inside(points_on(scene.shapes()[0]), few).all()


@pytest.mark.parametrize(
    ("count", "most", "filled"),
    # A box for each house; for every five of them; and so many that nothing between them can be left out.
    [(200, 512, 0.0011), (200, 40, 0.4), (1200, 100, 1.01)],
)
def test_houses_on_a_plain(count, most, filled):
    made = [mesh(house) for house in houses(count)]
    scene = scene_of(mesh(meshes.plain(0.0)), *made)
    boxes = object_boxes(scene, most=most)
    assert len(boxes) <= most
    assert all(are_inside(vertices_of(shape), boxes).all() for shape in scene.shapes())
    # The ground is not what neighbours are put together with.
    wide = boxes[boxes[:, 1, 0] - boxes[:, 0, 0] > 1e5]
    assert len(wide) == 1
    assert np.ptp(wide[0, :, 2]) < 1e-9
    assert volume(boxes) < filled * 4e3 * 4e3 * 6


def test_a_large_terrain():
    line = np.linspace(0.0, 1000.0, 300)
    x, y = np.meshgrid(line, line)
    terrain = meshes.quad_strip(np.stack([x, y, 60 * np.exp(-((x - 300) ** 2 + y**2) / 1e4)], axis=-1))
    scene = scene_of(mesh(terrain))
    boxes = object_boxes(scene)
    assert are_inside(terrain.vertices.astype(np.float32), boxes).all()
    assert volume(boxes) < 0.3 * 1e6 * 60


def test_spheres_instances_and_other_shapes():
    placed = mi.ScalarTransform4f().translate([50.0, 3.0, 2.0]) @ mi.ScalarTransform4f().scale(2.0)
    scene = mi.load_dict(
        {
            "type": "scene",
            "group": {"type": "shapegroup", "ball": {"type": "sphere"}},
            "twin": {
                "type": "instance",
                "to_world": placed,
                "shapegroup": {"type": "ref", "id": "group"},
            },
            "ball": {"type": "sphere", "center": [0.0, 0.0, 2.0], "radius": 1.5},
            "disk": {"type": "disk", "to_world": mi.ScalarTransform4f().translate([0.0, 90.0, 1.0])},
        }
    )
    boxes = object_boxes(scene)
    assert len(boxes) == 3
    assert volume(boxes) == pytest.approx(4.0**3 + 3.0**3, rel=1e-4)
    for target in ([50.0, 3.0, 2.0], [0.0, 0.0, 2.0], [0.0, 90.0, 1.0]):
        met = hits(scene, target)
        assert len(met) > 100
        # Met from 20 m away, which rounds by some micrometres.
        assert are_inside(met, boxes + np.array([[-1e-5], [1e-5]])).all()


def test_flat_shapes_far_apart_in_one_plane_stay_apart():
    signs = [mi.ScalarTransform4f().translate([0.0, y, 0.0]) for y in (0.0, 200.0)]
    boxes = object_boxes(scene_of(*({"type": "rectangle", "to_world": place} for place in signs)))
    assert len(boxes) == 2
    assert not are_inside(np.array([[0.0, 100.0, 0.0]]), boxes).any()


def test_a_scene_without_surfaces():
    assert object_boxes(mi.load_dict({"type": "scene"})).shape == (0, 2, 3)


def test_no_boxes_at_all_are_refused():
    with pytest.raises(InputError, match="at least one box"):
        object_boxes(mi.load_dict({"type": "scene"}), most=0)
