"""What made a file, told inside the file."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import final

__all__ = ["Provenance"]


@final
@dataclass(frozen=True)
class Provenance:
    """What made a result. It holds no time and no name of a machine, so that equal work gives equal bytes.

    Parameters
    ----------
    scene : str
        The whole scene as TOML.
    command : str
        The command line.
    """

    scene: str = ""
    command: str = ""

    @property
    def software(self) -> str:
        """This program and its version."""
        return f"nigemizu {version('nigemizu')}"

    def fields(self) -> dict[str, str]:
        """Name and text of everything that is known, for a file's header."""
        known = {"Software": self.software, "Scene": self.scene, "Command": self.command}
        return {name: text for name, text in known.items() if text}
