"""What a run will need, against what there is, before anything starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .layout import capacity_of
from .target import Target

if TYPE_CHECKING:
    from .scenario import Scenario
    from .solver import Solver

BASE = 300 * 2**20  # a process with Warp, before it has a particle [bytes]


def shortage(scenario: Scenario, solver: type[Solver], target: Target) -> str | None:
    """Why a run would not fit into memory, in words; None where it does, or where the device's memory is not known."""
    particles = capacity_of(scenario)
    need, there = BASE + particles * solver.typical_bytes, available_memory(target)
    if there is None or need <= there:
        return None
    return (
        f"it needs about {need / 2**30:.3g} GiB ({particles} particles of some {solver.typical_bytes:.0f} bytes), and "
        f"this machine has {there / 2**30:.3g} GiB left; use a larger spacing or a smaller pool"
    )


def available_memory(target: Target) -> float | None:
    """Memory that a new process could have [bytes]: of the host, within its control group, or of the GPU."""
    if target.device != "cpu":
        import warp as wp

        return float(wp.get_device(target.device).free_memory)
    import psutil

    free = float(psutil.virtual_memory().available)
    limit, used = _cgroup("memory.max"), _cgroup("memory.current")
    return free if limit is None or used is None else min(free, limit - used)


def _cgroup(name: str) -> float | None:
    """A number of this process's control group; None where there is none."""
    from pathlib import Path

    try:
        return float((Path("/sys/fs/cgroup") / name).read_text())
    except (OSError, ValueError):
        return None
