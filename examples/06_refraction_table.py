"""Refraction of the stars through the standard atmosphere, from violet to red: the table and its figure."""

import numpy as np

import nigemizu
from nigemizu.scene.measuring import refraction_table

scene = nigemizu.Scene.from_toml('earth = {}\nprofile = { kind = "us1976" }')
table = refraction_table(scene, wavelengths=np.linspace(400e-9, 700e-9, 7))
print(table.save("refraction.csv"), table.save("refraction.svg"))

level = np.degrees(table.refraction[table.elevation == 0.0][0]) * 3600
print(f"at the horizon {level[3]:.1f} arcsec, violet {level[0] - level[-1]:.1f} arcsec more than red")
