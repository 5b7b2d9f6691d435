"""Eight particles that fall, in steps that are told."""

from fluidbench.method.timestep import Bound
from fluidbench.native.simulation import Simulation

from ..conftest import scenario
from .ballistic import Ballistic

FALLING = {
    "duration": 1.0,
    "tick": 0.125,
    "output_interval": 0.25,
    "spacing": 0.02,
    "domain": {"lower": [0, 0, -9.0], "upper": [1, 1, 1]},
    "bodies": [{"kind": "box", "center": [0.5, 0.5, 0.9], "size": [0.04] * 3}],
}


class Stepping(Ballistic):
    """Takes the steps that it is told to, and notes the speeds it was asked for."""

    dt = 0.05

    @classmethod
    def bounds(cls, s, config, speed):
        return [Bound("loose", 9.0, "", ""), Bound("told", cls.dt, f"{speed!r}", "")]


def falling(method=Ballistic, **more):
    return Simulation(scenario(**{**FALLING, **more}), method)
