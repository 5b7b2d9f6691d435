"""The command line: parses, calls a study, prints. Heavy imports stay inside the commands."""

import sys

from ..errors import UserError

from . import runs, studies, pictures, info  # isort: skip  (the order of the verbs in --help)
from .app import app

__all__ = ["app", "info", "main", "pictures", "runs", "studies"]


def main() -> None:
    """Entry point: user errors are one line and exit code 2, an interruption can be resumed."""
    try:
        app(standalone_mode=True)
    except UserError as error:
        for line in str(error).splitlines():
            print(f"fluidbench: {line}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("fluidbench: interrupted; the same command resumes with what is not finished", file=sys.stderr)
        sys.exit(130)
