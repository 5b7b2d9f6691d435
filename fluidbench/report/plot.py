"""What a plot shows, as plain data: drawn by figures.py into files and by page.py into pages."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..registry import method_names

if TYPE_CHECKING:
    import numpy as np

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe & Ito: distinct for colour-blind readers."""
FADED = 0.3
"""Opacity of what is faded."""
LIGHTER = ("#7FC1EC", "#F3A873", "#84D7BC", "#E5BBD3", "#F2CF80", "#AADAF4", "#808080")
"""The same through another backend."""


@functools.cache
def _names() -> list[str]:
    return method_names()


def colour(label: str) -> str:
    """A method's colour, by its place among the registered ones: the same in every plot; lighter for "mpm (taichi)" and
    its like. What is no method has one by its name."""
    method, _, backend = label.partition(" ")
    names = _names()
    place = names.index(method) if method in names else sum(map(ord, label))
    return (LIGHTER if backend else COLOURS)[place % len(COLOURS)]


@dataclass(frozen=True)
class Trace:
    """One line (or points, or bars) of a plot; `spread` is how uncertain each of its points is, `names` what each is,
    told by number and a key; a `faded` one shows through."""

    label: str
    x: list[Any]
    y: list[float]
    style: str = "line"
    colour: str = "#000000"
    spread: list[float] | None = None
    names: list[str] | None = None
    faded: bool = False


@dataclass(frozen=True)
class Cloud:
    """Particles to turn about on the page: positions (n, 3) and, of each, what it is coloured by (n,), whose name and
    unit are `legend`, between `limits`; `size` is a particle's, in the positions' unit."""

    name: str
    title: str
    position: np.ndarray
    value: np.ndarray
    legend: str
    limits: tuple[float, float]
    size: float


@dataclass(frozen=True)
class Plot:
    """One plot: traces, axis titles with units; `equal`: both axes share a scale, `log`: both are logarithmic."""

    name: str
    title: str
    x: str
    y: str
    traces: list[Trace] = field(default_factory=list)
    equal: bool = False
    log: bool = False

    @property
    def key(self) -> dict[str, int]:
        """The number of every name of a point, from 1, in the order of their first points."""
        names = dict.fromkeys(name for trace in self.traces for name in trace.names or [])
        return {name: i for i, name in enumerate(names, 1)}
