"""All render tests share one process and so one variant."""

import sys
from pathlib import Path

import pytest

from nigemizu import render

sys.path.insert(0, str(Path(__file__).parent))  # for render_scenes, the helpers of these tests


@pytest.fixture(autouse=True, scope="session")
def variant():
    name = render.select_variant("auto")
    render.register()
    return name
