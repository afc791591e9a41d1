"""Your own air: a temperature profile as a formula, seen at the instant 0 by straight and by bent light."""

import nigemizu

scene = nigemizu.load(
    "road",
    {
        # the fit of measurements over asphalt of the built-in scene, with a skin of your own
        "initial.profile": "308.168 + 6.37*exp(-10.08*z) + 20*exp(-z/0.02)",
        "initial.unevenness": [],
        "ground.temperature": "61 degC",
        "camera.width": 480,
        "camera.height": 270,
        "camera.samples": 16,
    },
)
for method in ("straight", "bent"):
    picture = scene.render(time=0.0, method=method)
    print(picture.save(f"own_profile_{method}.png"), picture.statuses)
