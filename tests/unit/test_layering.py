"""The order of the rooms and the size of their pieces, read from the source itself."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "nigemizu"

SHARED = {"errors", "memory", "progress", "units", "values"}
"""Modules that every room may import."""

ROOMS: dict[str, set[str]] = {
    "air": set(),
    "heat": {"air"},
    "field": {"air"},
    "trace": {"air", "field"},
    "render": {"air", "heat", "field", "trace"},
    "output": {"air", "heat", "field", "trace"},
    "measure": {"air", "heat", "output"},
    "scene": {"air", "heat", "field", "trace", "render", "output"},
    "cli": {"air", "heat", "field", "trace", "render", "output", "scene", "measure"},
}
"""What each room may import of the others: the chain, read from left to right."""

OUTSIDE: dict[str, set[str]] = {
    "air": {"numpy", "pydantic"},
    "heat": {"PIL", "drjit", "numba", "numpy", "pydantic", "pydantic_core", "scipy", "xarray"},
    "field": {"drjit", "numpy", "pydantic", "scipy"},
    "trace": {"drjit", "numpy", "pydantic"},
    "render": {"PIL", "drjit", "mitsuba", "numpy", "pydantic", "pydantic_core", "xarray"},
    "output": {"OpenEXR", "PIL", "av", "matplotlib", "netCDF4", "numpy", "pydantic", "xarray", "zarr"},
    "measure": {"PIL", "av", "netCDF4", "numpy", "pydantic", "scipy", "xarray"},
    "scene": {"drjit", "numpy", "pydantic", "xarray"},
    "cli": {"drjit", "numba", "numpy", "pydantic", "rich", "scipy", "xarray"},
}
"""What each room may import from outside, besides the standard library."""

HEAVY = {
    "OpenEXR",
    "av",
    "drjit",
    "matplotlib",
    "mitsuba",
    "netCDF4",
    "numba",
    "pandas",
    "scipy",
    "xarray",
    "zarr",
}
"""What the front rooms import only when they need it, so that `nigemizu --help` answers at once."""

FRONT = {"", "scene", "cli"}

_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)

LONGEST_FILE = 400
LONGEST_FUNCTION = 60
DEVICE_LOOP = re.compile(r"^\s*# -{3,} \w.*$", re.MULTILINE)
"""The section banners that excuse a long function, which must then be one device loop."""


def _sources() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def _room(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return parts[0] if len(parts) > 1 else ""


def _imports(tree: ast.AST, package: str) -> Iterator[tuple[int, str]]:
    """Every module name that `tree` imports, with its line; relative names are resolved in `package`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")
            base = ".".join(parents[: len(parents) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (base, node.module) if part)
            # `from nigemizu import heat` names a room only in its list of names.
            names = [f"{module}.{alias.name}" for alias in node.names] if module == "nigemizu" else [module]
            yield from ((node.lineno, name) for name in names)


def _violations(source: str, room: str) -> list[str]:
    """What `source`, a module of `room`, imports against the order of the rooms."""
    found = []
    for line, name in _imports(ast.parse(source), f"nigemizu.{room}"):
        top, *rest = name.split(".")
        if top == "nigemizu":
            other = rest[0] if rest else ""
            if other in ROOMS and other != room and other not in ROOMS[room]:
                found.append(f"line {line}: {room} imports {name}")
            elif other not in ROOMS and other not in SHARED and not other.startswith("__"):
                found.append(f"line {line}: {room} imports {name}, which is neither a room nor shared")
        elif top not in sys.stdlib_module_names and top not in OUTSIDE[room]:
            found.append(f"line {line}: {room} imports {name}")
    return found


def _run_at_import(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """The statements that run when the module is imported: not those of functions or for the type checker."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from _run_at_import(node.orelse)
            continue
        yield node
        for name in ("body", "orelse", "finalbody"):
            yield from _run_at_import(getattr(node, name, []))


def _heavy_at_import(source: str) -> list[str]:
    names = [
        name
        for node in _run_at_import(ast.parse(source).body)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for _, name in _imports(node, "nigemizu")
    ]
    return [name for name in names if name.split(".")[0] in HEAVY]


def _long_functions(source: str) -> list[str]:
    """Functions beyond the limit that are not a device loop in sections.

    Neither docstrings nor inner functions count.
    """
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, _FUNCTIONS):
            continue
        text = ast.get_source_segment(source, node) or ""
        length = _own_lines(node)
        if length > LONGEST_FUNCTION and len(DEVICE_LOOP.findall(text)) < 2:
            found.append(f"{node.name}: {length} lines")
    return found


def _own_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    documented = ast.get_docstring(function) is not None and len(function.body) > 1
    first = function.body[1] if documented else function.body[0]
    lines = set(range(first.lineno, (function.end_lineno or first.lineno) + 1))
    for inner in ast.walk(function):
        if inner is not function and isinstance(inner, _FUNCTIONS):
            lines -= set(range(inner.lineno, (inner.end_lineno or inner.lineno) + 1))
    return len(lines)


def _caught_blindly(source: str) -> list[int]:
    blind = {"Exception", "BaseException"}
    return [
        node.lineno
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ExceptHandler)
        and (
            node.type is None
            or any(isinstance(name, ast.Name) and name.id in blind for name in ast.walk(node.type))
        )
    ]


@pytest.mark.parametrize("path", _sources(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_module_keeps_the_house_rules(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    room = _room(path)
    assert not room or room in ROOMS, f"{room} is not a room of the plan"
    if room:
        assert _violations(source, room) == []
    if room in FRONT:
        assert _heavy_at_import(source) == []
    assert len(source.splitlines()) <= LONGEST_FILE
    assert _long_functions(source) == []
    assert _caught_blindly(source) == []


def test_only_render_imports_mitsuba() -> None:
    importers = {
        _room(path)
        for path in _sources()
        for _, name in _imports(ast.parse(path.read_text(encoding="utf-8")), "nigemizu")
        if name.split(".")[0] == "mitsuba"
    }
    assert importers <= {"render"}
    assert "mitsuba" not in set().union(*(OUTSIDE[room] for room in OUTSIDE if room != "render"))


def test_the_order_of_the_rooms_has_no_cycle() -> None:
    done: set[str] = set()
    while waiting := set(ROOMS) - done:
        ready = {room for room in waiting if ROOMS[room] <= done}
        assert ready, f"a cycle among {sorted(waiting)}"
        done |= ready
    assert done == set(ROOMS)


@pytest.mark.parametrize(
    ("room", "source"),
    [
        ("air", "from nigemizu.heat import Grid"),
        ("air", "def late():\n    from nigemizu import render"),
        ("air", "from ..heat import Grid"),
        ("air", "import scipy.special"),
        ("heat", "from nigemizu import field"),
        ("field", "import mitsuba as mi"),
        ("trace", "if True:\n    from mitsuba import Point3f"),
        ("render", "import nigemizu.output"),
        ("output", "from nigemizu.render import picture"),
        ("render", "from nigemizu.scene import Scene"),
        ("scene", "from nigemizu.cli import main"),
        ("heat", "from nigemizu.shortcut import everything"),
    ],
)
def test_an_import_against_the_order_is_caught(room: str, source: str) -> None:
    assert len(_violations(source, room)) == 1


@pytest.mark.parametrize(
    ("room", "source"),
    [
        ("heat", "from nigemizu.air import refractivity\nimport numpy as np\nimport math"),
        ("air", "from nigemizu.errors import InputError\nfrom .laws import refractivity"),
        ("render", "from nigemizu import trace, errors\nimport mitsuba as mi"),
        ("cli", "from nigemizu import __version__"),
    ],
)
def test_an_import_along_the_order_passes(room: str, source: str) -> None:
    assert _violations(source, room) == []


def test_what_runs_at_import_is_told_from_what_runs_later() -> None:
    early = "try:\n    import xarray\nexcept ImportError:\n    raise\nclass Scene:\n    import scipy.special"
    late = (
        "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    import xarray\n"
        "def load():\n    import mitsuba\n"
        "class Scene:\n    def simulate(self):\n        import numba\n"
    )
    assert _heavy_at_import(early) == ["xarray", "scipy.special"]
    assert _heavy_at_import(late) == []


def test_a_long_function_is_caught_unless_it_is_a_loop_in_sections() -> None:
    lines = [f"    step({i})" for i in range(LONGEST_FUNCTION + 1)]
    assert _long_functions("\n".join(["def march():", *lines])) == [f"march: {LONGEST_FUNCTION + 1} lines"]
    assert _long_functions("\n".join(["def march():", *lines[1:]])) == []
    inner = ["    def bend():", *(f"    {line}" for line in lines[:40]), *lines[:40]]
    assert _long_functions("\n".join(["def march():", *inner])) == []
    sections = ["    # --- Bend ---", *lines[:30], "    # --- Meet surfaces ---", *lines[30:]]
    assert _long_functions("\n".join(["def march():", *sections])) == []


def test_a_blind_handler_is_caught() -> None:
    attempt = "try:\n    work()\nexcept {}:\n    pass"
    assert [len(_caught_blindly(attempt.format(kind))) for kind in ("Exception", "(OSError, Exception)")] == [
        1,
        1,
    ]
    assert _caught_blindly("try:\n    work()\nexcept:\n    pass") == [3]
    assert _caught_blindly(attempt.format("(OSError, ValueError)")) == []


def test_importing_the_front_rooms_loads_nothing_heavy() -> None:
    # Dr.Jit alone is quick to load and chooses nothing; the values of `trace` bring it along.
    slow = sorted(HEAVY - {"drjit"})
    code = f"import sys, nigemizu, nigemizu.scene, nigemizu.cli\nprint(*set(sys.modules) & set({slow!r}))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.split() == []
