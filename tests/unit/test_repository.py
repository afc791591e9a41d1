"""What a stranger clones: its metadata, its lock files and its README agree with each other."""

from __future__ import annotations

import ast
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]

REQUIREMENT = re.compile(r'^\s*"(?P<name>[A-Za-z0-9._-]+)[^"]*",?(?P<rest>.*)$')
LOCKED = re.compile(r"^(?P<name>[a-z0-9._-]+)==(?P<version>[^ ;\\]+)", re.MULTILINE)
MACHINE_PATH = re.compile(r"(?<![\w.~:/$-])/(?:home|root|Users|work|opt/wheels)/\w+")
# Written in two halves, so that this file does not hold what it forbids.
REGISTRY = re.compile("(?:files.python" + r"hosted|pypi)\." + "(?:org|python)")
IMAGE_OR_LINK = re.compile(r"!?\[[^\]]*\]\((?P<target>[^)#\s]+)[^)]*\)")


def _project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _readme() -> str:
    return (ROOT / "README.md").read_text(encoding="utf-8")


def _blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", _readme(), re.MULTILINE | re.DOTALL)


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _names(requirements: list[str]) -> set[str]:
    return {_normal(re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0]) for requirement in requirements}


def _locked(file: str) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for match in LOCKED.finditer((ROOT / file).read_text(encoding="utf-8")):
        found.setdefault(_normal(match["name"]), set()).add(match["version"])
    return found


def _uncommented(lines: list[str]) -> list[str]:
    matches = [REQUIREMENT.match(line) for line in lines]
    return [match["name"] for match in matches if match and not re.search(r"#.*\w{3,}", match["rest"])]


def _tracked() -> list[Path]:
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    if listing.returncode != 0:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listing.stdout.decode().split("\0") if name and (ROOT / name).is_file()]


def _texts() -> dict[Path, str]:
    found = {}
    for path in _tracked():
        data = path.read_bytes()
        if b"\0" not in data[:8000]:
            found[path] = data.decode("utf-8")
    return found


def test_every_dependency_says_why() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    sections = re.findall(
        r"^(?:dependencies|test|docs|build|requires) = \[(.*?)\]$", text, re.MULTILINE | re.DOTALL
    )
    lines = [line for section in sections for line in section.splitlines()]
    assert len([line for line in lines if REQUIREMENT.match(line)]) > 15
    assert _uncommented(lines) == []
    assert _uncommented(['    "leftpad>=1",', '    "numpy>=2",  # arrays']) == ["leftpad"]


def test_the_locks_cover_the_dependencies() -> None:
    project = _project()
    runtime, everything = _locked("requirements.lock"), _locked("requirements-dev.lock")
    needed = _names(project["project"]["dependencies"] + project["dependency-groups"]["build"])
    extras = _names(
        [name for extra in project["project"]["optional-dependencies"].values() for name in extra]
    )
    assert needed <= set(runtime)
    assert needed | extras <= set(everything)
    assert {name: everything[name] for name in runtime} == runtime
    # A first picture must not wait for the tools of developers.
    assert not {"sphinx", "mypy", "ruff", "pytest"} & set(runtime)


@pytest.mark.parametrize("file", ["requirements.lock", "requirements-dev.lock"])
def test_every_locked_version_has_hashes(file: str) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    entries = re.split(r"^(?=[a-z0-9])", text, flags=re.MULTILINE)[1:]
    assert len(entries) > 30
    assert [entry.split()[0] for entry in entries if "--hash=sha256:" not in entry] == []


def test_no_registry_and_no_machine_is_named() -> None:
    texts = _texts()
    assert len(texts) > 20
    here = Path(__file__)
    assert [str(path) for path, text in texts.items() if REGISTRY.search(text)] == []
    assert [str(path) for path, text in texts.items() if path != here and MACHINE_PATH.search(text)] == []
    assert MACHINE_PATH.search('open("/home/someone/air.nc")')
    assert REGISTRY.search("https://pypi" + ".org/simple")


def test_the_commands_of_the_readme_exist() -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    commands = [line.split("#")[0].split() for block in _blocks("sh") for line in block.splitlines() if line]
    makes = [words[1] for words in commands if words[0] == "make"]
    assert makes[:2] == ["run", "test"]
    assert set(makes) <= targets
    inline = set(re.findall(r"`make ([a-z]+)`", _readme()))
    assert inline <= targets
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert re.search(r"^make .*\btest\b", ci, re.MULTILINE)


def test_the_nigemizu_commands_of_the_readme_are_understood() -> None:
    from nigemizu.cli.parser import parse
    from nigemizu.errors import InputError

    commands = [
        line.split("#")[0].split(">")[0].split()[1:]
        for block in _blocks("sh")
        for line in block.splitlines()
        if line.startswith(".venv/bin/nigemizu")
    ]
    assert len(commands) >= 7
    assert all(callable(parse(words).run) for words in commands)
    with pytest.raises(InputError):
        parse(["render", "pyramid", "--no-such-flag"])


def test_six_lines_of_python_make_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import nigemizu

    block = _blocks("python")[0]
    lines = [line for line in block.splitlines() if line.strip()]
    assert len(lines) <= 6
    # The same calls, on a picture and an air small enough for a test.
    small = {
        "camera.width": 48,
        "camera.height": 27,
        "camera.samples": 1,
        "grid.cells": [8, 4, 16],
        "initial.unevenness": [],
        "grid.first_cell": 0.02,
        "time.duration": 2.0,
        "tracer.beyond": "straight",
    }
    load = nigemizu.load
    monkeypatch.setattr(nigemizu, "load", lambda name: load(name, small), raising=False)
    monkeypatch.chdir(tmp_path)
    exec(compile(ast.parse(block), "README.md", "exec"), {})
    written = tmp_path / "mirage.png"
    assert written.read_bytes().startswith(b"\x89PNG")


def test_the_toml_of_the_readme_is_a_scene() -> None:
    from nigemizu.scene import Scene

    scene = Scene.from_toml(_blocks("toml")[0], file="README.md")
    assert scene.ground.kind == "held"
    assert Scene.from_toml(scene.to_toml()) == scene


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_links_lead_somewhere(page: str) -> None:
    text = re.sub(
        r"^```.*?^```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL
    )
    targets = [match["target"] for match in IMAGE_OR_LINK.finditer(text)]
    local = [target for target in targets if not re.match(r"[a-z]+:", target)]
    assert [target for target in local if not (ROOT / target).exists()] == []


def test_the_citation_is_complete() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = _project()["project"]
    assert citation["cff-version"] == "1.2.0"
    assert (citation["version"], citation["license"]) == (project["version"], project["license"])
    references = citation["references"]
    assert references[0]["title"] == "Volume Ray Tracing of Inferior Mirages"
    assert all({"type", "title", "authors", "notes"} <= set(reference) for reference in references)
    dois = [reference["doi"] for reference in references if "doi" in reference]
    assert all(re.fullmatch(r"10\.\d{4,9}/\S+", doi) for doi in dois)
    assert len(dois) == len(set(dois)) >= 5


def test_the_changelog_begins_with_this_version() -> None:
    versions = re.findall(
        r"^## (\d+\.\d+\.\d+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert versions[0] == _project()["project"]["version"]
