"""Shared by all tests: a quiet Warp, small scenarios, and the list of methods under contract."""

from typing import Any

import numpy as np

from fluidbench.native.device import quiet_warp
from fluidbench.native.solver import Solver
from fluidbench.registry import get_method, method_names
from fluidbench.runs.drive import Drive
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import validate

quiet_warp()
G = 9.81
NATIVE = [name for name in method_names() if issubclass(get_method(name), Solver)]
"""Methods on our own pool, in order; those of engines are tested in tests/contract/test_engines.py."""
PERIODIC = {f"{axis}_{end}": "periodic" for axis in "xyz" for end in ("lower", "upper")}
"""The walls of a domain that has none."""


def drive(session: Any, observe: Any = None, **more: Any) -> Any:
    """Run a session to its end, see Drive."""
    return Drive(session, session.scenario, observe, **more).run()


def scenario(**table: Any) -> Scenario:
    """A scenario from keyword tables, over a box of water in a unit domain."""
    base: dict[str, Any] = {
        "name": "test",
        "domain": {"lower": [0.0, 0.0, 0.0], "upper": [0.2, 0.2, 0.2]},
        "material": {"density": 1000.0},
        "bodies": [{"kind": "box", "center": [0.05, 0.05, 0.05], "size": [0.08, 0.08, 0.08]}],
        "duration": 0.01,
        "spacing": 0.01,
    }
    return validate({**base, **table}, "test")


def bead(**table: Any) -> Scenario:
    """A short line of paste, 6 particles across."""
    base: dict[str, Any] = {
        "domain": {"lower": [-0.02, -0.02, 0.0], "upper": [0.05, 0.02, 0.025]},
        "material": {
            "density": 1000.0,
            "youngs_modulus": 6e3,
            "poisson_ratio": 0.45,
            "yield_stress": 60.0,
            "plastic_viscosity": 1.0,
        },
        "bodies": [],
        "nozzle": {"diameter": 0.012, "exit_speed": 0.1, "standoff": 0.010},
        "toolpath": {"kind": "line", "start": [0.0, 0.0], "end": [0.03, 0.0], "speed": 0.1},
        "duration": 0.1,
        "spacing": 0.002,
    }
    return scenario(**{**base, **table})


def center_of_mass(frame: dict[str, np.ndarray]) -> np.ndarray:
    m = frame["mass"].astype(float)
    return m @ frame["position"].astype(float) / m.sum()
