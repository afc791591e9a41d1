"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NoReturn

from nigemizu.errors import InputError, MachineError

__all__ = ["ready_to_write", "remove", "whole_file", "whole_folder", "write_bytes"]

_FULL: Final = (errno.ENOSPC, errno.EDQUOT)
_ZARR_MARKS: Final = ("zarr.json", ".zgroup")


def ready_to_write(path: str | os.PathLike[str], suffixes: Sequence[str] = (), *, size: int = 0) -> Path:
    """Make sure, before any work is done, that a file can be written.

    Parameters
    ----------
    path : path
        The file; its folder must exist.
    suffixes : sequence of str
        The extensions that are possible (``".png"``); empty allows any.
    size : int, bytes
        Room that the file will need, when it is known.

    Returns
    -------
    Path
        With ``~`` expanded.

    Raises
    ------
    InputError
        The extension is unknown, the folder is missing or cannot be written to, or the path is a folder.
    MachineError
        The disk is full.

    Notes
    -----
    A file of one byte is written and removed again: permissions alone say too little. An existing file
    will be replaced.
    """
    target = Path(path).expanduser()
    if suffixes and target.suffix.lower() not in suffixes:
        raise InputError(
            f"cannot write {target.suffix or 'a file without an extension'}",
            file=str(target),
            expected=f"an extension out of {', '.join(suffixes)}",
        )
    folder = target.parent
    if not folder.exists():
        raise InputError("no such folder", file=str(folder), remedy=f"create it: mkdir -p {folder}")
    if not folder.is_dir():
        raise InputError("not a folder", file=str(folder), expected="a folder to write to")
    _check_replaceable(target)
    with whole_file(target, replace=False) as probe:
        probe.write_bytes(b"?")
    free = shutil.disk_usage(folder).free
    if size > free:
        raise MachineError(
            f"{target}: the disk has {free / 1e6:.0f} MB free of the {size / 1e6:.0f} MB needed; "
            "make room or write elsewhere"
        )
    return target


@contextmanager
def whole_file(path: Path, *, replace: bool = True) -> Iterator[Path]:
    """Give a temporary path beside `path`; on leaving, what is there takes the name `path` in one step.

    Parameters
    ----------
    path : Path
        The file to be written.
    replace : bool
        False only tries: the temporary file is removed in the end.

    Yields
    ------
    Path
        Hidden name in the same folder, with the same extension.

    Raises
    ------
    InputError
        The folder cannot be written to.
    MachineError
        The disk is full or failing.

    Notes
    -----
    Whatever ends the block, Ctrl-C included, leaves either the old file or the new one, and no third.
    """
    temporary = _beside(path)
    try:
        yield temporary
        if replace:
            _flush(temporary)
            os.replace(temporary, path)
    except OSError as error:
        refuse(error, path)
    finally:
        remove(temporary)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Like `whole_file` for a folder that is one dataset (Zarr); an older Zarr store is replaced.

    Parameters
    ----------
    path : Path
        The folder to be written.

    Yields
    ------
    Path
        Hidden name beside it.

    Raises
    ------
    InputError
        The folder cannot be written to, or something else than a Zarr store has its name.
    MachineError
        The disk is full or failing.
    """
    _check_replaceable(path)
    temporary, retired = _beside(path), _beside(path)
    try:
        yield temporary
        if path.exists():
            # A folder that holds anything cannot be replaced in one step; the old one steps aside first.
            os.rename(path, retired)
        os.rename(temporary, path)
    except OSError as error:
        refuse(error, path)
    finally:
        if retired.exists() and not path.exists():
            os.rename(retired, path)
        remove(temporary)
        remove(retired)


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a whole file and return its path; errors as `whole_file`."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content)
    return path


def remove(path: Path) -> None:
    """Remove a file, or a folder with all it holds, if it is there."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        with suppress(FileNotFoundError, NotADirectoryError):
            path.unlink()


def refuse(error: OSError, path: Path) -> NoReturn:
    """Raise what a person can act on in place of `error`, met while `path` was written."""
    if error.errno in _FULL:
        raise MachineError(
            f"{path}: the disk is full; make room or write elsewhere, nothing was left behind"
        ) from error
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.ENOENT):
        raise InputError(
            f"cannot be written: {error.strerror}",
            file=str(path),
            remedy="choose a folder that you may write to",
        ) from error
    raise MachineError(f"{path}: writing failed: {error.strerror or error}") from error


def _beside(path: Path) -> Path:
    return path.with_name(f".{path.stem}.{secrets.token_hex(4)}.part{path.suffix}")


def _flush(path: Path) -> None:
    descriptor = os.open(path, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _check_replaceable(path: Path) -> None:
    if not path.is_dir():
        if path.suffix.lower() == ".zarr" and path.exists():
            raise InputError("a file has this name", file=str(path), expected="a Zarr store or nothing there")
        return
    if path.suffix.lower() != ".zarr":
        raise InputError("this is a folder", file=str(path), expected="the name of a file")
    if any(path.iterdir()) and not any((path / mark).exists() for mark in _ZARR_MARKS):
        raise InputError(
            "a folder that is no Zarr store has this name",
            file=str(path),
            remedy="choose another name; it will not be overwritten",
        )
