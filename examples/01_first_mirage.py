"""The first mirage: six lines from a scene's name to a picture."""

import nigemizu

scene = nigemizu.load("pyramid", {"camera.width": 480, "camera.height": 270, "camera.samples": 16})
picture = scene.render(time=300.0)
print(picture.save("first_mirage.png"))
