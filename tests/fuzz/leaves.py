"""Every key of the scenario model, found by walking it, with what kind of value it takes and a scenario that has it."""

import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from fluidbench.registry import get_method
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import assign, load, validate

NUMBER, VECTOR, CHOICE, FLAG, TEXT = "number", "vector", "choice", "flag", "text"
PASTE = {"density": 1000.0, "youngs_modulus": 6e3, "poisson_ratio": 0.45, "yield_stress": 60.0, "bulk_modulus": 2e4}
LINE = {
    "domain": {"lower": [-0.03, -0.03, 0.0], "upper": [0.12, 0.03, 0.03]},
    "material": PASTE,
    "duration": 0.5,
    "spacing": 2e-3,
    "nozzle": {"diameter": 0.012, "flow_rate": 1.1e-5, "standoff": 0.01},
    "tick": 1e-3,
    "toolpath": {
        "kind": "polyline",
        "points": [[0.0, 0.0], [0.03, 0.0], [0.03, 0.01]],
        "speed": 0.1,
        "layers": 2,
        "layer_height": 0.008,
        "pause": 0.1,
    },
    "pool": 100_000,
    "output_interval": 0.1,
    "name": "polyline",
}
STILL = {
    "domain": {"lower": [0.0, 0.0, 0.0], "upper": [0.3, 0.3, 0.3], "walls": {"z_lower": {"friction": 0.3}}},
    "material": {"density": 1000.0, "youngs_modulus": 1e5, "viscosity": 1.0, "relaxation_time": 0.1},
    "duration": 0.1,
    "spacing": 0.01,
    "body_force_gradient": [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
    "jitter": 0.1,
    "name": "bodies",
    "bodies": [
        {
            "kind": "box",
            "center": [0.1, 0.1, 0.1],
            "size": [0.1, 0.1, 0.1],
            "angular_velocity": [0.0, 0.0, 1.0],
            "velocity_gradient": [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
            "wave": {"amplitude": [0.1, 0.0, 0.0], "number": [0.0, 20.0, 0.0], "phase": 0.5},
        },
        {"kind": "cylinder", "center": [0.22, 0.22, 0.05], "radius": 0.03, "height": 0.1},
        {"kind": "sphere", "center": [0.22, 0.1, 0.22], "radius": 0.04, "velocity": [0.0, 0.0, -0.1]},
    ],
}
SPAWN = LINE | {
    "name": "spawn",
    "toolpath": {"kind": "line", "start": [0.0, 0.0], "speed": 0.0, "dwell": 0.2},
    "material": PASTE
    | {
        "expansion": {"kind": "spawn", "ratio": 4.0, "delay": 0.1, "passes": 2, "interval": 0.1, "impulse": 0.1},
        "cure": {"kind": "kamal_sourour", "delay": 0.3, "rate": 2.0, "rate_autocatalytic": 3.0, "yield_stress": 2e3},
    },
}
SHIPPED = ("line_bead", "ring_tower_drone", "foam_wall", "dam_break", "column_slump", "honey_line")
OWN = {"polyline": LINE, "bodies": STILL, "spawn": SPAWN}


@dataclass(frozen=True)
class Leaf:
    """A key that holds a value: its dotted path, what it takes, its limits (gt, ge, lt, le), and a base that has it."""

    path: str
    kind: str
    base: str
    size: int = 0
    limits: tuple[tuple[str, float], ...] = ()

    @property
    def key(self) -> str:
        """The path without the positions at its end, as a message may give it."""
        parts = self.path.split(".")
        while parts[-1].isdigit():
            parts.pop()
        return parts[-1]

    def forbids(self, value: float) -> bool:
        """Whether the key's own limits exclude a number."""
        outside = {"gt": value.__le__, "ge": value.__lt__, "lt": value.__ge__, "le": value.__gt__}
        return any(outside[name](float(limit)) is True for name, limit in self.limits)


@cache
def full(base: str) -> dict[str, Any]:
    """A base as a whole table, defaults included."""
    made = validate(OWN[base], base) if base in OWN else load(base)
    return made.model_dump(mode="json")


@cache
def table(base: str) -> dict[str, Any]:
    """A base as it may stand in a file: without defaults."""
    if base in OWN:
        return OWN[base]
    return load(base).model_dump(mode="json", exclude_defaults=True)


@cache
def leaves() -> tuple[Leaf, ...]:
    """Every key once, on the first base that has its table; numerics by the methods' own models."""
    found: dict[str, Leaf] = {}
    for base in (*SHIPPED, *OWN):
        for leaf in _walk(Scenario, full(base), "", base, ()):
            found.setdefault(leaf.path, leaf)
    for method in ("mpm", "sph", "pbd"):
        for name, info in get_method(method).Config.model_fields.items():
            for leaf in _walk(info.annotation, None, f"numerics.{method}.{name}", "line_bead", info.metadata):
                found.setdefault(leaf.path, leaf)
    return tuple(found.values())


def changed(base: str, path: str, value: Any) -> dict[str, Any]:
    """A base's table with one key changed."""
    import copy

    made = copy.deepcopy(table(base))
    node, parts = full(base), path.split(".")
    for i, part in enumerate(parts[:-1]):  # a default that only the full table has, such as a vector's
        node = node[int(part)] if isinstance(node, list) else (node or {}).get(part, {})
        if isinstance(node, list) and parts[i + 1].isdigit():
            assign(made, ".".join(parts[: i + 1]), copy.deepcopy(node))
            break
    assign(made, path, value)
    return made


def _walk(annotation: Any, present: Any, path: str, base: str, metadata: Any) -> Iterator[Leaf]:
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if isinstance(present, dict):
            for name, info in annotation.model_fields.items():
                below = f"{path}.{name}" if path else name
                yield from _walk(info.annotation, present.get(name), below, base, info.metadata)
    elif origin is typing.Annotated:
        yield from _walk(arguments[0], present, path, base, [*metadata, *annotation.__metadata__])
    elif origin in (typing.Union, types.UnionType):
        for inner in arguments:
            yield from _walk(inner, present, path, base, metadata)
    elif origin is typing.Literal:
        yield Leaf(path, CHOICE, base)
    elif origin is tuple and Ellipsis in arguments:
        for i, item in enumerate(present or ()):
            yield from _walk(arguments[0], item, f"{path}.{i}", base, ())
    elif origin is tuple:
        yield Leaf(path, VECTOR, base, len(arguments))
        for i, item in enumerate(present or ()):
            yield from _walk(arguments[i], item, f"{path}.{i}", base, ())
    elif annotation in (int, float):
        yield Leaf(path, NUMBER, base, limits=tuple(_limits(metadata)))
    elif annotation in (bool, str):
        yield Leaf(path, FLAG if annotation is bool else TEXT, base)


def _limits(metadata: Any) -> Iterator[tuple[str, float]]:
    for item in metadata:
        if isinstance(item, FieldInfo):
            yield from _limits(item.metadata)
        for name in ("gt", "ge", "lt", "le"):
            if getattr(item, name, None) is not None:
                yield name, float(getattr(item, name))
