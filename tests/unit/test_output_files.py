"""Files that appear whole or not at all, and paths refused before any work is done."""

import errno
import os
import shutil
from types import SimpleNamespace

import pytest

from nigemizu.errors import InputError, MachineError
from nigemizu.output import ready_to_write, whole_file, whole_folder


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_good_path_leaves_no_trace(tmp_path):
    assert ready_to_write(tmp_path / "a.PNG", (".png", ".exr")) == tmp_path / "a.PNG"
    assert names(tmp_path) == []


def test_home_is_expanded(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert ready_to_write("~/a.png") == tmp_path / "a.png"


def test_unknown_extension_lists_what_is_possible(tmp_path):
    with pytest.raises(InputError, match=r"cannot write \.jpg; expected an extension out of \.png, \.exr"):
        ready_to_write(tmp_path / "a.jpg", (".png", ".exr"))
    with pytest.raises(InputError, match="without an extension"):
        ready_to_write(tmp_path / "a", (".png",))


def test_missing_folder_comes_with_its_remedy(tmp_path):
    with pytest.raises(InputError, match=r"no such folder; create it: mkdir -p .*/missing"):
        ready_to_write(tmp_path / "missing" / "a.png")


def test_a_file_in_place_of_the_folder(tmp_path):
    (tmp_path / "folder").write_text("a file")
    with pytest.raises(InputError, match="not a folder"):
        ready_to_write(tmp_path / "folder" / "a.png")


def test_a_folder_in_place_of_the_file(tmp_path):
    (tmp_path / "a.png").mkdir()
    with pytest.raises(InputError, match="this is a folder"):
        ready_to_write(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("number", "kind", "words"),
    [
        (errno.ENOSPC, MachineError, "the disk is full"),
        (errno.EDQUOT, MachineError, "the disk is full"),
        (errno.EACCES, InputError, "Permission denied"),
        (errno.EROFS, InputError, "Read-only file system"),
        (errno.EIO, MachineError, "writing failed"),
    ],
)
def test_trouble_with_the_disk_becomes_one_line(tmp_path, number, kind, words):
    def write_half():
        with whole_file(tmp_path / "a.txt") as temporary:
            temporary.write_text("half")
            raise OSError(number, os.strerror(number))

    with pytest.raises(kind, match=words) as raised:
        write_half()
    assert "a.txt" in str(raised.value)
    assert "\n" not in str(raised.value)
    assert names(tmp_path) == []


def test_a_full_disk_is_noticed_beforehand(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=5_000_000))
    assert ready_to_write(tmp_path / "a.nc", size=4_000_000)
    with pytest.raises(MachineError, match="5 MB free of the 6 MB needed"):
        ready_to_write(tmp_path / "a.nc", size=6_000_000)


def test_interrupted_writing_keeps_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def write_half():
        with whole_file(path) as temporary:
            temporary.write_text("half of the n")
            assert temporary.suffix == ".txt"
            assert path.read_text() == "old"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert names(tmp_path) == ["a.txt"]
    assert path.read_text() == "old"
    with whole_file(path) as temporary:
        temporary.write_text("new")
    assert names(tmp_path) == ["a.txt"]
    assert path.read_text() == "new"


def test_permissions_are_those_of_any_new_file(tmp_path):
    with whole_file(tmp_path / "a.txt") as temporary:
        temporary.write_text("new")
    (tmp_path / "b.txt").write_text("new")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


def make_store(path, content):
    path.mkdir()
    (path / "zarr.json").write_text(content)


def test_a_store_is_replaced_whole(tmp_path):
    path = tmp_path / "a.zarr"
    make_store(path, "old")

    def write_half():
        with whole_folder(path) as temporary:
            make_store(temporary, "half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert (path / "zarr.json").read_text() == "old"
    with whole_folder(path) as temporary:
        make_store(temporary, "new")
    assert names(tmp_path) == ["a.zarr"]
    assert (path / "zarr.json").read_text() == "new"


def test_when_the_new_store_cannot_move_in_the_old_one_stays(tmp_path, monkeypatch):
    path = tmp_path / "a.zarr"
    make_store(path, "old")
    real = os.rename

    def rename(source, target):
        if str(source).endswith(".part.zarr") and (source / "zarr.json").read_text() == "new":
            raise OSError(errno.ENOSPC, "No space left on device")
        real(source, target)

    monkeypatch.setattr(os, "rename", rename)
    with pytest.raises(MachineError, match="full"), whole_folder(path) as temporary:
        make_store(temporary, "new")
    assert names(tmp_path) == ["a.zarr"]
    assert (path / "zarr.json").read_text() == "old"


def test_other_folders_are_never_overwritten(tmp_path):
    path = tmp_path / "a.zarr"
    path.mkdir()
    (path / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="no Zarr store has this name"):
        ready_to_write(path, (".zarr",))
    with pytest.raises(InputError, match="no Zarr store"), whole_folder(path) as temporary:
        temporary.mkdir()
    assert names(path) == ["thesis.txt"]
    (tmp_path / "b.zarr").write_text("a file")
    with pytest.raises(InputError, match="a file has this name"):
        ready_to_write(tmp_path / "b.zarr")
