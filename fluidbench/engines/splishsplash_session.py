"""A run through SPlisHSPlasH under way. Its scene is a JSON file, with the particles in a BGEO file beside it; then the
engine takes steps of its own.
"""

from __future__ import annotations

import ctypes
import json
import os
import tempfile
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UserError
from ..method.contract import Session, Steps
from ..method.frame import FREE, Frame
from ..method.timestep import Bound
from ..method.vitals import Vital, vital_of
from ..scenario import Scenario
from ..scenario.layout import lay_out
from .bgeo import write_bgeo
from .guest import OWN_STEP, talking_aside
from .splishsplash import BEHIND, VISCOSITIES, sticks

if TYPE_CHECKING:
    from .splishsplash import SPlisHSPlasH

CORNERS = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
FACES = ("1 2 4", "1 4 3", "5 7 8", "5 8 6", "1 5 6", "1 6 2", "3 4 8", "3 8 7", "1 3 7", "1 7 5", "2 6 8", "2 8 4")
CUBE = "".join("v {} {} {}\n".format(*corner) for corner in CORNERS) + "".join(f"f {face}\n" for face in FACES)
"""The unit cube as OBJ, its faces outwards."""


class Course(Session):
    """A run under way. The engine holds one simulation a process."""

    def __init__(self, method: type[SPlisHSPlasH], scenario: Scenario, config: Any, threads: int) -> None:
        self.method, self.scenario, self.config, self._now = method, scenario, config, 0.0
        tick, _, per_output = scenario.schedule
        self.stride = 0.25 * tick * per_output
        self.cap, self.limit = min((dt, name) for name, dt in method.caps(scenario, config).items())
        laid = [lay_out(body, scenario) for body in scenario.bodies]
        self.points = np.concatenate([own.position for own in laid])
        self.volume = float(np.concatenate([own.volume for own in laid]).mean())
        os.environ["OMP_NUM_THREADS"] = str(threads)  # read when the engine is loaded
        self.engine = _load(method)
        self.folder = tempfile.TemporaryDirectory(prefix="fluidbench-splishsplash-", ignore_cleanup_errors=True)
        folder = Path(self.folder.name)
        write_bgeo(folder / "particles.bgeo", self.points, np.concatenate([own.velocity for own in laid]))
        (folder / "box.obj").write_text(CUBE)
        (folder / "scene.json").write_text(json.dumps(scene(method, scenario, config, self.volume, self.cap)))
        if self.engine.Simulation.hasCurrent():
            raise RuntimeError("SPlisHSPlasH holds one simulation a process")
        self.base = self.engine.Exec.SimulatorBase()
        with talking_aside():
            self.base.init(useGui=False, sceneFile=str(folder / "scene.json"), outputDir=str(folder / "out"))
            self.base.initSimulation()
        self.fluid = self.engine.Simulation.getCurrent().getFluidModel(0)
        self.clock = self.engine.TimeManager.getCurrent()
        if self.capacity != len(self.points):
            raise RuntimeError(f"the engine holds {self.capacity} of {len(self.points)} particles")

    @property
    def now(self) -> float:
        return self._now

    @property
    def capacity(self) -> int:
        return self.fluid.numActiveParticles()

    def prepare(self) -> None:
        """Lay out the walls. The engine does so in its own loop alone, so that takes a step and is put back."""
        with talking_aside():
            self.base.setValueFloat(self.base.STOP_AT, 1e-12)
            self.base.runSimulation()
            self.base.reset()
            self.base.setValueFloat(self.base.STOP_AT, 1e9)

    def begin(self) -> Vital:
        return self.look()

    def advance(self, until: float) -> Steps:
        """Steps of the engine's own, to the first that ends at `until` [s] or later. Its clock is of single precision
        and starts anew with every step; the sum is ours."""
        taken = Steps(peak_particles=self.capacity)
        with talking_aside():
            while taken.substeps == 0 or self._now < until * (1.0 - 1e-9):
                self.clock.setTime(0.0)
                self.base.timeStepNoGUI()
                dt = float(self.clock.getTime())
                name = self.limit if dt > 0.999 * self.cap else OWN_STEP
                taken.substeps += 1
                taken.binding[name] = taken.binding.get(name, 0.0) + dt
                self._now += dt
        taken.particle_substeps = taken.substeps * taken.peak_particles
        return taken

    def look(self) -> Vital:
        return vital_of(self.frame(), self.scenario)

    def frame(self) -> Frame:
        """Particles in order of creation: the engine may sort its own. Before its first step it has no densities, which
        then are the rest density."""
        n, rho = self.capacity, self.scenario.material.density
        fields = {name: np.array(self.fluid.getFieldBuffer(name))[:n] for name in ("id", "position", "velocity")}
        density = np.array(self.fluid.getFieldBuffer("density"))[:n]
        order = np.argsort(fields["id"])
        return {
            "time": np.array(self._now),
            "position": fields["position"][order],
            "velocity": fields["velocity"][order],
            "density": np.where(density > 0, density, np.float32(rho))[order],
            "mass": np.full(n, self.volume * rho),
            "volume": np.full(n, self.volume),
            "spin": np.zeros((n, 3), np.float32),
            "phase": np.zeros(n, np.int32),
            "held": np.full(n, FREE, np.int32),
            "birth_time": np.zeros(n, np.float32),
            "origin": np.arange(n, dtype=np.int32),
        }

    def bounds(self) -> list[Bound]:
        return []

    def footprint(self) -> dict[str, int]:
        return {}

    def close(self) -> None:
        with talking_aside():
            self.base.cleanup()
        self.folder.cleanup()


def scene(method: type[SPlisHSPlasH], scenario: Scenario, config: Any, volume: float, cap: float) -> dict[str, Any]:
    """The engine's scene: its particles are of mass rho (2 r)^3, so r follows from their volume [m^3]."""
    d, m, domain = volume ** (1 / 3), scenario.material, scenario.domain
    low, high = np.asarray(domain.lower) - BEHIND * d, np.asarray(domain.upper) + BEHIND * d
    nu = m.viscosity / m.density + method.artificial(scenario, config)
    number, section = VISCOSITIES[config.viscosity] if nu > 0 else (0, "")
    held = m.viscosity / m.density if sticks(scenario) else 0.0
    viscous = {"viscosity": nu, "viscosityBoundary": held, "viscoMaxIter": 200, "viscoMaxError": config.viscous_error}
    return {
        "Configuration": {
            "particleRadius": d / 2,
            "simulationMethod": method.number,
            "gravitation": scenario.acceleration.tolist(),
            "boundaryHandlingMethod": 0,
            "cflMethod": 1,
            "cflFactor": config.cfl,
            "timeStepSize": cap,
            "cflMaxTimeStepSize": cap,
            "cflMinTimeStepSize": 1e-4 * cap,
            **method.pressure(scenario, config),
        },
        "Materials": [{"id": "Fluid", "density0": m.density, "viscosityMethod": number, section: viscous}],
        "RigidBodies": [
            {
                "geometryFile": "box.obj",
                "translation": (0.5 * (low + high)).tolist(),
                "scale": (high - low).tolist(),
                "isDynamic": False,
                "isWall": True,
                "mapInvert": True,
                "samplingMode": 0,
            }
        ],
        "FluidModels": [{"particleFile": "particles.bgeo", "id": "Fluid"}],
    }


def _load(method: type[SPlisHSPlasH]) -> Any:
    """The engine's module. Its wheel brings a part of libGL that crashes unless the system's own is loaded first."""
    try:
        ctypes.CDLL("libGL.so.1", mode=ctypes.RTLD_GLOBAL)
        return import_module("pysplishsplash")
    except OSError:
        raise UserError(f"{method.name}: the system's libGL.so.1 is missing (on Debian: apt install libgl1)") from None
    except ImportError as error:
        raise UserError(method.missing() or f"{method.name}: {error}") from None
