"""What a run will need, against what there is, before anything starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..method.contract import Method
from ..method.target import Target
from ..scenario.layout import capacity_of
from ..scenario.numerics import configure

if TYPE_CHECKING:
    from ..scenario import Scenario

BASE = 300 * 2**20  # a process with Warp, before it has a particle [bytes]


def memory_needed(scenario: Scenario, method: type[Method]) -> float:
    """What a run will take [bytes], its process included."""
    return BASE + method.memory(scenario, configure(method, scenario), capacity_of(scenario))


def shortage(scenario: Scenario, method: type[Method], target: Target) -> str | None:
    """Why a run would not fit into memory, in words; None where it does."""
    need, there = memory_needed(scenario, method), available_memory(target)
    if need <= there:
        return None
    return (
        f"it needs about {need / 2**30:.3g} GiB ({capacity_of(scenario)} particles), and this machine has "
        f"{there / 2**30:.3g} GiB left; use a larger spacing or a smaller pool"
    )


def available_memory(target: Target) -> float:
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
