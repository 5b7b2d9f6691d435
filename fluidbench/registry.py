"""How methods are found: entry points of the group `fluidbench.solvers`, by name."""

from __future__ import annotations

import functools
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from .errors import UserError, quoted, suggestion

if TYPE_CHECKING:
    from .method.contract import Method

ENTRY_POINTS = "fluidbench.solvers"


@functools.cache
def _points() -> tuple[EntryPoint, ...]:
    """What is registered by what is installed, of which each look reads all metadata."""
    return tuple(entry_points(group=ENTRY_POINTS))


def registered() -> list[str]:
    """Names of all registered methods; loads none of them."""
    return sorted({point.name for point in _points()})


def method_names() -> list[str]:
    """Those that can be loaded, in the order in which tables show them (Method.rank)."""
    return sorted(
        (name for name in registered() if name not in broken()), key=lambda name: (get_method(name).rank, name)
    )


def broken() -> dict[str, str]:
    """Registered methods that cannot be loaded, with the reason."""
    found = {}
    for name in registered():
        try:
            get_method(name)
        except UserError as error:
            found[name] = str(error)
    return found


def get_method(name: str) -> type[Method]:
    """The method registered under this name; raises UserError with the nearest known name."""
    for point in _points():
        if point.name != name:
            continue
        try:
            return point.load()
        except Exception as error:  # whatever its package does: the message names it
            reason = f"{type(error).__name__}: {error}"
            raise UserError(f"the method {quoted(name)[1:-1]} ({point.value}) cannot be loaded: {reason}") from None
    raise UserError(f"no solver named {quoted(name)}{suggestion(name, registered())}")
