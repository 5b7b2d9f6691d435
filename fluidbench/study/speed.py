"""How fast a method's substep is by itself: a block of material at rest that fills a closed box, in a process of its
own."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ..errors import UserError
from ..method.target import Target
from ..registry import get_method
from ..scenario import Scenario
from ..scenario.numerics import configure

Task = dict[str, Any]
SPACING = 1.0 / 128.0  # [m]
MATERIALS = {
    "liquid": {"density": 1000.0},
    "paste": {
        "density": 1000.0,
        "youngs_modulus": 2e4,
        "poisson_ratio": 0.4,
        "yield_stress": 50.0,
        "plastic_viscosity": 2.0,
    },
}
BATCH, BATCHES = 64, 8  # substeps asked of a GPU at a time, and how often until its clock is looked at


def block(material: str, side: int) -> Scenario:
    """A cube of side^3 particles in a box of smooth walls that it fills."""
    edge = side * SPACING
    faces = [f"{axis}_{end}" for axis in "xyz" for end in ("lower", "upper")]
    return Scenario.model_validate(
        {
            "name": f"{material} of {side**3}",
            "domain": {"lower": [0.0] * 3, "upper": [edge] * 3, "walls": dict.fromkeys(faces, "slip")},
            "material": MATERIALS[material],
            "bodies": [{"kind": "box", "center": [edge / 2] * 3, "size": [edge] * 3}],
            "duration": 1.0,
            "spacing": SPACING,
        }
    )


def speed_tasks(methods: Sequence[str], sides: Sequence[int], seconds: float, target: Target) -> list[tuple[str, Task]]:
    """(label, task) of every method, material and size."""
    return [
        (
            f"{method}-{material}-{side**3}",
            {"method": method, "material": material, "side": side, "seconds": seconds, "target": asdict(target)},
        )
        for side in sides
        for method in methods
        for material in MATERIALS
    ]


def measure_speed(task: Task) -> dict[str, Any]:
    """Substeps a second of wall and CPU time, compilation apart, beside what memory would allow: the bytes that a
    substep moves (Session.traffic) over the bandwidths that this device has at this moment."""
    import warp as wp

    from ..native.bandwidth import bandwidth

    method, target = get_method(task["method"]), Target(**task["target"])
    named = {"method": task["method"], "material": task["material"], "particles": task["side"] ** 3}
    scenario = block(task["material"], task["side"])
    config = configure(method, scenario)
    try:
        start = time.perf_counter()
        session = method.start(scenario, config, target)
        session.prepare()
        compiled = time.perf_counter() - start
        bounds = method.bounds(scenario, config, scenario.reference_speed)
        dt = min(bound.dt for bound in bounds) if bounds else scenario.schedule[0]
        session.begin()
        batch, batches = (1, 1) if target.device == "cpu" else (BATCH, BATCHES)
        for _ in range(2):  # the second time all is recorded
            session.sort()
            session.march(dt, batch)
    except UserError as reason:
        return named | {"reason": str(reason).splitlines()[0], "refused": True}
    wp.synchronize()
    substeps, wall, cpu = 0, time.perf_counter(), time.process_time()
    while substeps == 0 or time.perf_counter() - wall < task["seconds"]:
        if batches > 1:
            session.sort()
        for _ in range(batches):
            session.march(dt, batch)
        wp.synchronize()
        substeps += batch * batches
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    vital = session.look()
    if broken := vital.complaint or vital.shortage:
        return named | {"reason": broken}
    ceilings, moved = bandwidth(target.device), session.traffic()
    least = None if moved is None else sum(moved[where] / ceilings[where] for where in ceilings)
    return named | {
        "substeps_per_s": substeps / wall,
        "particle_substeps_per_s": substeps * named["particles"] / wall,
        "particle_substeps_per_cpu_s": substeps * named["particles"] / cpu,
        "bytes_per_particle": sum(session.footprint().values()) / session.capacity,
        "limit_substeps_per_s": None if least is None else 1.0 / least,
        "share_of_limit": None if least is None else substeps / wall * least,
        "prepare_s": compiled,
        "memory_GB_per_s": ceilings["memory"] / 1e9,
        "cache_GB_per_s": ceilings["cache"] / 1e9,
    }
