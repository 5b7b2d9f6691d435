"""Points of a sweep that share the launches of one session, as worlds; several sessions, one after the other, are a
small experiment in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

from ..errors import UserError
from ..method.contract import Method, OutOfCapacity, Session
from ..method.frame import Frame
from ..method.suitability import refusal
from ..method.target import Target
from ..method.verdict import Verdict
from ..method.vitals import Vital, vital_of
from ..registry import get_method
from ..runs.child import cost, results, row_of
from ..runs.drive import Drive
from ..runs.needs import available_memory
from ..runs.provenance import machine
from ..scenario import Scenario
from ..scenario.extent import ADDRESSABLE
from ..scenario.layout import capacity_of
from ..scenario.numerics import configure
from .workplace import cores

Task = dict[str, Any]
WARP = 32  # slots by which a pool's capacity is rounded up
MOST = 64  # worlds in one launch, unless told
SLOWER = 2.0  # ratio of wave speeds within which worlds may share: each is judged by the fastest one's
FILLED = 0.5  # share of the memory that is left which they may take


def shared(method: type[Method], scenarios: Sequence[Scenario], target: Target, most: int) -> list[list[int]]:
    """Numbers of scenarios in groups that one session can hold, `most` in each; the order is that of their first. What
    the method refuses stands alone."""
    groups: list[list[int]] = []
    memory = FILLED * available_memory(target) if most > 1 else 0.0
    for i, scenario in enumerate(scenarios):
        config, capacity = configure(method, scenario), capacity_of(scenario)
        room = min(
            most, ADDRESSABLE // (capacity + WARP), int(memory / max(method.memory(scenario, config, capacity), 1))
        )
        fits = room > 1 and refusal(method, scenario, config, target) is None
        for group in groups if fits else []:
            if len(group) < room and _alike(method, scenarios[group[0]], scenario):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def _alike(method: type[Method], first: Scenario, other: Scenario) -> bool:
    """Whether both can be worlds of one session and come to what they would alone: what a session takes from its first
    scenario (the lattice and chance, ticks, the stream's profile, the sound of liquids, how the method treats solids)
    must be the same, and so must the settings that each decides; and neither waits for rest."""
    if "rest" in (first.until, other.until) or method.apart([first, other]) is not None:
        return False
    if any(s.nozzle is not None and s.nozzle.develops for s in (first, other)):
        return False
    same = [(s.seed, s.schedule, s.liquid_sound_speed, _kind(s)) for s in (first, other)]
    waves = sorted(s.top_wave_speed for s in (first, other))
    return same[0] == same[1] and waves[1] <= SLOWER * waves[0] and configure(method, first) == configure(method, other)


def _kind(scenario: Scenario) -> tuple[bool, ...]:
    """What sort of matter it is."""
    m = scenario.material
    return m.youngs_modulus is None, m.relaxation_time is None, m.is_solid, m.hardening is None, scenario.is_tensile


def run_batches(task: Task) -> dict[str, Any]:
    """Run batches of scenarios, each in a session of its own: how each ended, what it cost, and what each of its
    scenarios came to; and on what machine."""
    target, limit = Target(**task["target"]), task["wall_limit"]
    method, batches = get_method(task["method"]), [[Scenario.model_validate(s) for s in b] for b in task["batches"]]
    readers = min(cores(), max(map(len, batches)))
    with ProcessPoolExecutor(readers, get_context("spawn"), wake) as pool:  # a fork would share the GPU's context
        for _ in range(readers):
            pool.submit(int)  # now, so that they wake while the session begins
        found = [_guarded(method, batch, target, limit, pool) for batch in batches]
    return {"machine": machine(target), "batches": found}


def wake() -> None:
    """Import what a reader needs."""
    import pandas  # noqa: F401

    from ..measure import ledger, order, tower  # noqa: F401


def _guarded(
    method: type[Method], batch: list[Scenario], target: Target, limit: float, pool: Executor
) -> dict[str, Any]:
    """`run_together`, of which one that cannot be run does not end the others."""
    try:
        return run_together(method, batch, target, limit, pool)
    except (UserError, OutOfCapacity) as error:
        return {"verdict": Verdict.REFUSED, "reason": str(error), "cost": {}, "points": []}


def run_together(
    method: type[Method], scenarios: list[Scenario], target: Target, limit: float, pool: Executor
) -> dict[str, Any]:
    """Run scenarios in one session; what is measured of each is measured beside it, by the processes of a pool: reading
    many small runs would take far longer than running them."""
    start = time.perf_counter()
    session = method.start_together(scenarios, configure(method, scenarios[0]), target)
    series: list[list[Future[dict[str, Any]]]] = [[] for _ in scenarios]

    def observe(session: Session, vital: Vital) -> None:
        for rows, frame, scenario in zip(series, session.frames(), scenarios, strict=True):
            rows.append(pool.submit(seen, frame, scenario, vital))

    outcome = Drive(session, scenarios[0], observe, limit).run()
    found: list[dict[str, Any]] = []
    if outcome.verdict is Verdict.COMPLETED:
        ends = [
            pool.submit(come_to, scenario, frame, [row.result() for row in rows])
            for rows, frame, scenario in zip(series, session.frames(), scenarios, strict=True)
        ]
        found = [end.result() for end in ends]
    spent = cost(outcome, session, time.perf_counter() - start).model_dump(exclude_none=True)
    session.close()
    return {"verdict": outcome.verdict, "reason": outcome.reason, "cost": spent, "points": found}


def seen(frame: Frame, scenario: Scenario, vital: Vital) -> dict[str, Any]:
    """A row of a world's series, and what is wrong with it by its own scenario: a session judges all worlds at once."""
    return {"row": row_of(frame, scenario, vital), "complaint": vital_of(frame, scenario).complaint}


def come_to(scenario: Scenario, frame: Frame, outputs: list[dict[str, Any]]) -> dict[str, Any]:
    """What a scenario came to, as JSON can hold it; with a complaint where it broke, whatever the others did."""
    import pandas as pd

    complaint = next((o["complaint"] for o in outputs if o["complaint"]), None) or vital_of(frame, scenario).complaint
    rows = [o["row"] for o in outputs]
    whole = results(scenario, frame, pd.DataFrame(rows))
    kept = {key: whole[key] for key in ("measures", "print", "warnings")}
    return kept | {"complaint": complaint, "moving": list(whole["moving"])}
