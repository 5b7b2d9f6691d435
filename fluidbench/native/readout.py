"""What a native session shows: its particles, its costs, its arrays."""

from typing import Any

import numpy as np
import warp as wp

from ..method.contract import Session
from ..method.frame import Frame
from .pool import Pool
from .process.contact import Contact
from .process.curing import Curing
from .process.expansion import Growing
from .scene import Scene
from .solver import Solver


class Readout(Session):
    """A session's parts, looked at. Nothing here changes any."""

    scene: Scene
    pool: Pool
    solver: Solver
    curing: Curing | None
    growing: Growing | None
    contact: Contact | None
    substep_launches: int
    process_launches: int

    @property
    def capacity(self) -> int:
        return self.pool.size

    def frame(self, world: int = 0) -> Frame:
        """A world's particles as they are now, see method/frame.py."""
        spins, more = self.solver.spins(), {}
        more["spin"] = np.zeros((self.pool.size, 3), np.float32) if spins is None else spins
        for name, values in (("stress", self.solver.shear_stresses()), ("pressure", self.solver.pressures())):
            if values is not None:
                more[name] = values
        found = self.pool.snapshot(world, density=self.solver.densities(), **more)
        return {"time": np.array(self.now), **found}

    def frames(self) -> list[Frame]:
        return [self.frame(world) for world in range(self.scene.worlds)]

    def glimpse(self) -> Frame:
        pool, n = self.pool, self.pool.counts[0]
        return {name: pool.fields[name][:n].numpy() for name in ("position", "birth_time", "phase")}

    def footprint(self) -> dict[str, int]:
        """Bytes by part of everything allocated: the pool, the method, and each process that is on."""
        owners = {
            "pool": self.pool,
            "solver": self.solver,
            "curing": self.curing,
            "expansion": self.growing,
            "contact": self.contact,
        }
        return {
            f"{owner}.{name}": size
            for owner, part in owners.items()
            if part is not None
            for name, size in part.footprint().items()
        }

    def traffic(self) -> dict[str, float] | None:
        """The solver's, and each of its particles' fields read and written once."""
        found = self.solver.traffic()
        if found is not None:
            used = sum(self.pool.counts) / self.pool.size
            found["memory"] += 2.0 * used * sum(array.capacity for array in self.pool.fields.values())
        return found

    def statistics(self) -> dict[str, Any]:
        """Launches of kernels, of a substep and of the processes a tick, at most; what solves took."""
        launches = {"per_substep": self.substep_launches, "process_per_tick": self.process_launches}
        return {"launches": launches, "solves": self.solver.solves()}

    def peak_device_bytes(self) -> int | None:
        device = self.scene.device
        return None if device.is_cpu else wp.get_mempool_used_mem_high(device)

    def arrays(self) -> dict[str, wp.array]:
        """Everything on the device that a run must have to go on as it was."""
        found = {f"pool.{name}": array for name, array in self.pool.fields.items()}
        found |= {"pool.count": self.pool.count, "pool.fault": self.pool.fault}
        return found | {f"solver.{name}": array for name, array in self.solver.carried().items()}
