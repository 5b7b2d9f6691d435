"""The command line: parses, calls a study, prints. Heavy imports stay inside the commands."""

import contextlib
import signal
import sys
from typing import NoReturn

import typer

from ..errors import Halted, Interrupted, Obstacle, UserError, of_system
from . import engines, info, pictures, runs, start, streams, studies
from .app import app

__all__ = ["app", "engines", "info", "main", "pictures", "runs", "start", "streams", "studies"]
USAGE = typer.BadParameter.__base__  # what the parser raises; its module differs between versions
MOST_LINES = 6


def main() -> None:
    """Entry point: a user's mistake is a line and exit code 2, an obstacle a line and 1; what was cut off resumes."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    streams.ready()
    try:
        code = _called()
        sys.stdout.flush()  # what cannot be printed is told below, not by Python as it ends
        sys.exit(code)
    except UserError as error:
        _leave(2, *str(error).splitlines()[:MOST_LINES])
    except Obstacle as error:
        resumes = "; what is finished stays, the same command resumes" if isinstance(error, Halted) else ""
        _leave(1, f"{error}{resumes}")
    except (KeyboardInterrupt, Interrupted) as error:
        _leave(
            130, f"interrupted: {str(error) or 'nothing is lost'}; the same command resumes with what is not finished"
        )
    except BrokenPipeError:  # whoever read our output has gone
        sys.stderr.close()
        sys.exit(1)
    except OSError as error:
        if why := streams.unprintable():
            _leave(1, f"cannot print to standard output: {why}")
        _leave(1, of_system(error))


def _called() -> int:
    """The exit code of the command that is called; raises UserError for what the parser cannot make out."""
    try:
        return app(standalone_mode=False) or 0
    except Exception as error:
        if not isinstance(error, USAGE or ()):
            raise
        return _misused(error)


def _stop(*_: object) -> NoReturn:
    raise Interrupted


def _misused(error: Exception) -> int:
    """Help where a command was given nothing at all; otherwise what the parser says, in one line, as a UserError."""
    if type(error).__name__ == "NoArgsIsHelpError":
        print(error.format_message())  # type: ignore[attr-defined]
        return 2
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "fluidbench"
    words = " ".join(error.format_message().split())  # type: ignore[attr-defined]
    raise UserError(f"{words[:300]} (see `{command} --help`)") from None


def _leave(code: int, *lines: str) -> NoReturn:
    with contextlib.suppress(OSError):  # where nothing can be said the exit code still is
        for line in lines:
            print(f"fluidbench: {line}", file=sys.stderr)
    sys.exit(code)
