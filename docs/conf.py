"""Configuration of the documentation: Sphinx, with pages made from the code itself at each build."""

from __future__ import annotations

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

project = "nigemizu"
author = copyright = "The nigemizu developers"
release = version = installed_version("nigemizu")

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
]
exclude_patterns = ["_build", "_generated/parts"]
myst_enable_extensions = ["colon_fence", "dollarmath", "deflist"]
myst_heading_anchors = 3

# Units and defaults stand in the docstrings; the types of pydantic fields would only hide them.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "furo"
html_title = f"nigemizu {release}"
html_theme_options = {"navigation_with_keys": True}
html_static_path = []


def _generate(app: Sphinx) -> None:
    from generators import (
        arrival_page,
        command_line,
        convection_page,
        python_api,
        refraction_page,
        scene_reference,
        turbulence_page,
        validation,
    )

    parts, images = HERE / "_generated" / "parts", HERE / "_generated" / "images"
    for folder in (parts, images):
        folder.mkdir(parents=True, exist_ok=True)
    command_line.write(parts / "command_line.rst")
    scene_reference.write(parts / "scene.rst")
    python_api.write(HERE / "_generated")
    validation.write(parts / "validation.rst")
    convection_page.write(parts / "convection.rst", images / "convection.svg")
    turbulence_page.write(parts / "turbulence.rst", images / "turbulence.svg")
    refraction_page.write(parts / "refraction.rst", images / "refraction.svg")
    arrival_page.write(parts, images)


def setup(app: Sphinx) -> None:
    app.connect("builder-inited", _generate)
