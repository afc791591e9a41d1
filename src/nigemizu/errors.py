"""Errors that a person can act on: one line each, naming what is wrong and the remedy."""

from __future__ import annotations

__all__ = ["InputError", "MachineError", "NigemizuError", "NigemizuWarning"]


class NigemizuError(Exception):
    """Base of every error that nigemizu raises on purpose.

    Its text is one line. The command line prints it on stderr and ends with exit code 2.
    """


class InputError(NigemizuError):
    """Input that cannot be used.

    Parameters
    ----------
    problem : str
        What is wrong, in a few words.
    key : str, optional
        Dotted key in the scene (``grid.cells``), or the name of the argument.
    file : str, optional
        The file that holds the value.
    value : object, optional
        The offending value, shown as its ``repr``.
    expected : str, optional
        What would have been accepted.
    remedy : str, optional
        What to do about it.
    """

    def __init__(
        self,
        problem: str,
        *,
        key: str | None = None,
        file: str | None = None,
        value: object = None,
        expected: str | None = None,
        remedy: str | None = None,
    ) -> None:
        self.problem = problem
        self.key = key
        self.file = file
        self.value = value
        self.expected = expected
        self.remedy = remedy
        super().__init__(self._line())

    def in_file(self, file: str | None) -> InputError:
        """The same error, saying in which file unless it says so already."""
        return InputError(
            self.problem,
            key=self.key,
            file=self.file or file,
            value=self.value,
            expected=self.expected,
            remedy=self.remedy,
        )

    def _line(self) -> str:
        where = ": ".join(part for part in (self.file, self.key) if part)
        shown = f" (got {_short(self.value)})" if self.value is not None else ""
        text = f"{where}: {self.problem}{shown}" if where else f"{self.problem}{shown}"
        if self.expected:
            text += f"; expected {self.expected}"
        if self.remedy:
            text += f"; {self.remedy}"
        return " ".join(text.split())


class MachineError(NigemizuError):
    """The machine lacks something that the work needs (LLVM, disk space, memory)."""


class NigemizuWarning(UserWarning):
    """Something a person should know about a result that could still be computed.

    Its text is one line. The command line prints it on stderr.
    """


def _short(value: object, limit: int = 80) -> str:
    text = repr(value)
    return text if len(text) <= limit else text[: limit - 1] + "…"
