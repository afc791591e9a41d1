"""Air that someone else computed: any CF dataset with ``air_temperature``, here in degrees Celsius."""

import numpy as np
import xarray

import nigemizu

height = np.array([0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0])
air = xarray.Dataset(
    {"air_temperature": ("height", 30.0 + 25.0 * np.exp(-height / 0.08), {"units": "degC"})},
    {"height": ("height", height, {"units": "m", "positive": "up"})},
)
air.to_netcdf("other_air.nc")

scene = nigemizu.load("pyramid", {"camera.width": 480, "camera.height": 270, "camera.samples": 16})
print(scene.render(air="other_air.nc").save("other_air.png"))
