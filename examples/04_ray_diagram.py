"""The figure of every mirage paper: rays against height and distance, and the same rays as numbers."""

import numpy as np

import nigemizu

scene = nigemizu.load("pyramid", {"initial.unevenness": []})
rays = scene.trace(elevations=np.linspace(-0.8, 0.1, 31), time=300.0)
print(rays.save("rays.svg"), rays.save("rays.csv"))

turned = ~np.isnan(rays.turning_height) & (rays.elevation < 0)
lowest = rays.turning_height[turned].min()
print(f"{turned.sum()} rays turn in the hot air, the lowest {1000 * lowest:.0f} mm up")
