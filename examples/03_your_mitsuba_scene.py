"""Your own Mitsuba scene through hot air: name the integrator ``nigemizu``, and the air."""

import mitsuba as mi

import nigemizu
from nigemizu.output import write_png
from nigemizu.render import register, select_variant

select_variant("auto")
register()
air = nigemizu.load(
    "pyramid", {"initial.unevenness": [], "time.duration": "5 min", "grid.cells": [16, 4, 48]}
)
air.save_air("hot_air.nc")

look = mi.ScalarTransform4f().look_at(origin=[0, 0, 1.8], target=[600, 0, 1.8], up=[0, 0, 1])
scene = mi.load_dict(
    {
        "type": "scene",
        "integrator": {
            "type": "nigemizu",
            "air": "hot_air.nc",
            "time": 300.0,
            "beyond": "extend",
            "accuracy": 0.1,
        },
        "sensor": {
            "type": "perspective",
            "fov": 2.0,
            "to_world": look,
            "film": {"type": "hdrfilm", "width": 320, "height": 240},
        },
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.4, 0.6, 0.9]}},
        "ball": {"type": "sphere", "center": [600, 0, 4], "radius": 3.0},
        "ground": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().scale([20000, 20000, 1]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.4, 0.3]}},
        },
    }
)
print(write_png("your_scene.png", mi.render(scene, spp=16).numpy()[..., :3]))
