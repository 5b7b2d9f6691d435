"""Standard streams as the system gives them: closed, full, or without the letters that are printed."""

import io
import os
import sys
from pathlib import Path


def ready() -> None:
    """Give a stream that is closed a place to go to or come from, and have characters replaced that standard output
    cannot show."""
    if sys.stdin is None:
        sys.stdin = Path(os.devnull).open()  # noqa: SIM115
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


def unprintable() -> str:
    """Why standard output takes nothing more, and nothing where it does. What was not printed is thrown away then, or
    Python would fail at it once more as it ends."""
    try:
        sys.stdout.flush()
    except OSError as stuck:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return stuck.strerror or str(stuck)
    return ""
