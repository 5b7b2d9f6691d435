"""The engines that can be added, as data."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import UserError, quoted, suggestion


@dataclass(frozen=True)
class Engine:
    """An engine that pip can install: the `requirement` that brings its `package`, the methods that it is good for, and
    a line of Python that succeeds where it works."""

    name: str
    title: str
    requirement: str
    package: str
    methods: tuple[str, ...]
    licence: str
    address: str
    trial: str


ENGINES = {
    engine.name: engine
    for engine in (
        Engine(
            "splishsplash",
            "SPlisHSPlasH",
            "pysplishsplash>=2.19",
            "pysplishsplash",
            ("splishsplash-wcsph", "splishsplash-dfsph"),
            "MIT",
            "https://github.com/InteractiveComputerGraphics/SPlisHSPlasH",
            "import ctypes; ctypes.CDLL('libGL.so.1', mode=ctypes.RTLD_GLOBAL); import pysplishsplash",
        ),
    )
}


def engine_named(name: str) -> Engine:
    """The engine of this name; raises UserError with the nearest known name."""
    if name not in ENGINES:
        raise UserError(f"no engine named {quoted(name)}{suggestion(name, ENGINES)}")
    return ENGINES[name]
