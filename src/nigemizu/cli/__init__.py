"""The command ``nigemizu``: verbs over `nigemizu.scene`.

Exit codes: 0 done; 2 bad input or a machine that lacks something, said in one line on stderr; 130
interrupted; 141 the reader of the output went away. Results go to stdout, everything else to stderr.
"""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from nigemizu.errors import NigemizuError, NigemizuWarning

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        What was typed after ``nigemizu``; by default that of this process.
    """
    from nigemizu.cli.parser import parse

    typed = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in typed
    try:
        with _only_our_warnings(show_all=debug):
            options = parse(typed)
            code: int = options.run(options)
            sys.stdout.flush()
            return code
    except SystemExit as leaving:  # argparse has printed --help or --version
        return int(leaving.code or 0)
    except KeyboardInterrupt:
        return _say("interrupted", 130, debug)
    except BrokenPipeError:
        _silence_stdout()
        return 141
    except NigemizuError as error:
        return _say(f"error: {error}", 2, debug)
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        return _say(f"error: {place}{error.strerror or error}", 2, debug)
    except MemoryError:
        return _say("error: not enough memory; make grid.cells or camera.size smaller", 2, debug)
    except RuntimeError as error:
        # Dr.Jit wraps whatever is raised while it records a loop, Ctrl-C too.
        if not _caused_by(error, KeyboardInterrupt):
            raise
        return _say("interrupted", 130, debug)


def _caused_by(error: BaseException, kind: type[BaseException]) -> bool:
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, kind):
        cause = cause.__cause__ or cause.__context__
    return cause is not None


def _say(text: str, code: int, debug: bool) -> int:
    if debug:
        traceback.print_exc()
    print(f"nigemizu: {text}", file=sys.stderr, flush=True)
    return code


def _silence_stdout() -> None:
    # Python flushes stdout once more on its way out, which would complain a second time.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _only_our_warnings(*, show_all: bool) -> Iterator[None]:
    """Print nigemizu's own warnings as one line each; libraries' warnings only with ``--debug``."""
    with warnings.catch_warnings():
        if not show_all:
            warnings.simplefilter("ignore")
            warnings.filterwarnings("always", category=NigemizuWarning)
        ordinary = warnings.showwarning

        def show(message, category, *place, **more):  # type: ignore[no-untyped-def]
            if issubclass(category, NigemizuWarning):
                print(f"nigemizu: warning: {' '.join(str(message).split())}", file=sys.stderr)
            else:
                ordinary(message, category, *place, **more)

        warnings.showwarning = show
        yield
