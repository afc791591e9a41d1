"""Objects that are moved between two pictures are met where they are, although paths are shared."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from render_scenes import bar, sensor, types

from nigemizu import field
from nigemizu.render import Settings, integrator
from nigemizu.trace import Tracer


def hot_layer() -> field.StratifiedVolume:
    z = np.linspace(0.0, 4.0, 41)
    profile = 2.7e-4 - 2e-5 * np.exp(-z / 0.1)
    data = np.broadcast_to(profile[:, None, None], (len(z), 3, 3))
    return field.StratifiedVolume([-10, 300, 600], [-9, 0, 9], z, data, types(), "extend")


def seen(scene: mi.Scene) -> np.ndarray:
    return np.asarray(mi.render(scene, spp=4))[..., 0].mean(axis=1) > 0.5


def test_a_bar_that_moves_is_seen_where_it_is() -> None:
    bent = integrator(hot_layer(), Settings(tracer=Tracer(beyond="extend"), max_depth=1))
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": bent,
            "sensor": sensor(eye=(0, 0, 2), fov=1.0),
            "bar": bar(400.0, 2.5, 0.2),
        }
    )
    before = seen(scene)
    assert bent.bending.paths is not None
    assert 2 < before.sum() < 8
    parameters = mi.traverse(scene)
    parameters["bar.to_world"] = mi.Transform4f().translate([0, 0, 1.2]) @ parameters["bar.to_world"]
    parameters.update()
    after = seen(scene)
    # 1.2 m at 400 m is 11 pixels of 0.27 mrad.
    moved = np.flatnonzero(before).mean() - np.flatnonzero(after).mean()
    assert 10 < moved < 12.5
    # a narrower view is another set of rays
    parameters["sensor.x_fov"] = 0.5
    parameters.update()
    assert abs(seen(scene).sum() - 2 * after.sum()) <= 2
