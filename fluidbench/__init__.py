"""fluidbench: MPM, weakly compressible SPH and PBD on identical extrusion scenarios, fidelity beside cost.

    import fluidbench as fb

    result = fb.compare(fb.load("line_bead"), methods=["mpm", "sph"])
    result.table

Everything named here is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .paper.table1 import table1
    from .paper.table2 import table2
    from .scenario import Body, Scenario
    from .scenario.fill import fill
    from .scenario.library import define, load
    from .study.ablate import ablate
    from .study.bench import bench
    from .study.case import Case, Curve, Finding, Number
    from .study.compare import compare, run
    from .study.guide import guide
    from .study.select import select
    from .study.stability import stability
    from .study.sweep import sweep
    from .study.validate import validate

__version__ = "0.1.0"
__all__ = [
    "Body",
    "Case",
    "Curve",
    "Finding",
    "Number",
    "Scenario",
    "ablate",
    "bench",
    "compare",
    "define",
    "fill",
    "guide",
    "load",
    "run",
    "select",
    "stability",
    "sweep",
    "table1",
    "table2",
    "validate",
]
_ROOMS = {
    "Body": "scenario",
    "Scenario": "scenario",
    "fill": "scenario.fill",
    "define": "scenario.library",
    "load": "scenario.library",
    "Case": "study.case",
    "Curve": "study.case",
    "Finding": "study.case",
    "Number": "study.case",
    "compare": "study.compare",
    "run": "study.compare",
    "validate": "study.validate",
    "stability": "study.stability",
    "sweep": "study.sweep",
    "bench": "study.bench",
    "ablate": "study.ablate",
    "select": "study.select",
    "guide": "study.guide",
    "table1": "paper.table1",
    "table2": "paper.table2",
}


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        raise AttributeError(f"module 'fluidbench' has no attribute '{name}'")
    found = getattr(import_module(f".{_ROOMS[name]}", __name__), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
