"""Errors meant for the user: what was wrong, where, and what would be right."""

import difflib
from collections.abc import Iterable

LONGEST = 60  # characters of somebody's input that a message quotes


class UserError(Exception):
    """A mistake in the input or the machine's set-up; the command line prints it as one line and exits with 2."""


class Obstacle(Exception):
    """Something outside the program stopped it, such as a full disk; one line, exit code 1. What was finished stays."""


class Halted(Obstacle):
    """An obstacle that was met while runs were under way, or when they had ended: what of them is finished stays, and
    the same command resumes with the rest."""


class Interrupted(BaseException):
    """The user, or the system, wants it to stop; the message says what is finished. No KeyboardInterrupt, which the
    parser of the command line would swallow."""


def of_system(error: OSError) -> str:
    """What the system would not do, and with which file, where it says so."""
    name = f": {quoted(str(error.filename))[1:-1]}" if error.filename else ""
    return f"{error.strerror or error}{name}"


def quoted(value: object) -> str:
    """A value as it was given, shortened to what a line can hold."""
    text = repr(value[: LONGEST + 1] if isinstance(value, str | bytes) else value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def suggestion(word: str, known: Iterable[str]) -> str:
    """`; did you mean 'x'?` for the nearest known word, or the list of known words when none is near."""
    known = sorted(known)
    lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word[:LONGEST].lower(), lower, n=1, cutoff=0.6)
    if near:
        return f"; did you mean '{lower[near[0]]}'?"
    return f"; known: {', '.join(known)}" if known else ""
