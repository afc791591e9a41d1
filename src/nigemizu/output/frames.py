"""The numbered frames of a film, so that an interrupted film goes on where it stopped."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal, final

from numpy.typing import ArrayLike

from nigemizu.errors import InputError
from nigemizu.output.files import write_bytes
from nigemizu.output.pictures import Highlights, write_picture
from nigemizu.output.provenance import Provenance

__all__ = ["FrameFolder"]

_MANIFEST: Final = "frames.json"


@final
class FrameFolder:
    """A folder of numbered frames, all made from one scene.

    Parameters
    ----------
    path : path
        Created if it is not there; its own folder must exist.
    count : int
        Number of frames of the whole film.
    provenance : Provenance
        The scene, which says all that matters for the pictures. The command does not count.
    suffix : {".png", ".exr"}
    inputs : mapping of str to str
        Whatever else the pictures depend on, such as the digest of a dataset.

    Raises
    ------
    InputError
        The folder holds frames of another scene, of another version or of other inputs, or it holds
        something else; or it cannot be written to.

    Notes
    -----
    The manifest ``frames.json`` lists the frames and what they were made from. A frame has its name only once
    it is whole, so that a file that is there is a frame that is done, also with several workers.
    """

    def __init__(
        self,
        path: str | Path,
        count: int,
        provenance: Provenance,
        *,
        suffix: Literal[".png", ".exr"] = ".png",
        inputs: Mapping[str, str] | None = None,
    ) -> None:
        if count < 1:
            raise InputError("a film needs at least one frame", key="frames", value=count)
        if suffix not in (".png", ".exr"):
            raise InputError("unknown kind of frame", key="suffix", value=suffix, expected=".png or .exr")
        self.path: Final = Path(path).expanduser()
        self.count: Final = count
        self.provenance: Final = provenance
        self._suffix: Final = suffix
        self._digits = max(4, len(str(count - 1)))
        self._origin = {"software": provenance.software, "scene": provenance.scene, **(inputs or {})}
        self._begin()

    def frame(self, number: int) -> Path:
        """Path of frame `number`, counted from 0, whether or not it is there."""
        if not 0 <= number < self.count:
            raise InputError(
                "no such frame", key="frame", value=number, expected=f"a number from 0 to {self.count - 1}"
            )
        return self.path / f"{number:0{self._digits}d}{self._suffix}"

    def frames(self) -> list[Path]:
        """Paths of all frames in order."""
        return [self.frame(number) for number in range(self.count)]

    def missing(self) -> list[int]:
        """Numbers of the frames that are still to be made."""
        return [number for number, frame in enumerate(self.frames()) if not frame.exists()]

    def write(
        self, number: int, radiance: ArrayLike, *, exposure: float = 0.0, highlights: Highlights = "clip"
    ) -> Path:
        """Write frame `number` of linear `radiance`, (height, width, 3), as `write_picture` does."""
        return write_picture(
            self.frame(number),
            radiance,
            exposure=exposure,
            highlights=highlights,
            provenance=self.provenance,
        )

    def _begin(self) -> None:
        manifest = self.path / _MANIFEST
        if self.path.exists() and not self.path.is_dir():
            raise InputError("not a folder", file=str(self.path), expected="a folder for the frames")
        if manifest.exists():
            self._compare(manifest)
        elif self.path.exists() and any(self.path.iterdir()):
            raise InputError(
                "the folder for the frames holds something else",
                file=str(self.path),
                remedy="choose another output name or empty the folder",
            )
        else:
            if not self.path.parent.is_dir():
                raise InputError(
                    "no such folder",
                    file=str(self.path.parent),
                    remedy=f"create it: mkdir -p {self.path.parent}",
                )
            self.path.mkdir(exist_ok=True)
            write_bytes(manifest, self._manifest().encode())
        for left_over in self.path.glob(f".*.part{self._suffix}"):
            left_over.unlink(missing_ok=True)  # of a run that was killed

    def _manifest(self) -> str:
        digest = hashlib.sha256(json.dumps(self._origin, sort_keys=True).encode()).hexdigest()
        content = {
            "sha256": digest,
            "origin": self._origin,
            "frames": [frame.name for frame in self.frames()],
        }
        return json.dumps(content, indent=1, ensure_ascii=False) + "\n"

    def _compare(self, manifest: Path) -> None:
        try:
            stored: Any = json.loads(manifest.read_text(encoding="utf-8"))
            origin, names = stored["origin"], stored["frames"]
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(
                "this list of frames cannot be read", file=str(manifest), remedy=f"remove {self.path}"
            ) from error
        if origin != self._origin:
            raise InputError(
                f"holds frames made otherwise: {_difference(origin, self._origin)}",
                file=str(self.path),
                remedy="choose another output name, or remove this folder to start again",
            )
        if names != [frame.name for frame in self.frames()]:
            raise InputError(
                f"holds {len(names)} frames like {names[0] if names else 'none'}",
                file=str(self.path),
                expected=f"{self.count} like {self.frame(0).name}",
                remedy="choose another output name, or remove this folder to start again",
            )


def _difference(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """The first thing in which two origins differ, in words."""
    for key in sorted({*old, *new} - {"scene"}):
        if old.get(key) != new.get(key):
            return f"{key} was {old.get(key)!r} and is {new.get(key)!r}"
    section = ""
    lines = itertools.zip_longest(
        str(old.get("scene", "")).splitlines(), new["scene"].splitlines(), fillvalue=""
    )
    for was, now in lines:
        if was != now:
            return f"{section} {was.strip() or 'nothing'!r} is now {now.strip() or 'nothing'!r}".strip()
        section = now if now.startswith("[") else section
    return "another scene"
