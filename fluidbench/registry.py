"""How methods are found: entry points of the group `fluidbench.solvers`, by name."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from .errors import UserError, quoted, suggestion

if TYPE_CHECKING:
    from .method.contract import Method

ENTRY_POINTS = "fluidbench.solvers"


def registered() -> list[str]:
    """Names of all registered methods; loads none of them."""
    return sorted({point.name for point in entry_points(group=ENTRY_POINTS)})


def method_names() -> list[str]:
    """The same in the order in which tables show them (Method.rank)."""
    return sorted(registered(), key=lambda name: (get_method(name).rank, name))


def get_method(name: str) -> type[Method]:
    """The method registered under this name; raises UserError with the nearest known name."""
    for point in entry_points(group=ENTRY_POINTS, name=name):
        return point.load()
    raise UserError(f"no solver named {quoted(name)}{suggestion(name, registered())}")
