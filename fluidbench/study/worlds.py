"""Points of a sweep that share the launches of one session, as worlds; several sessions, one after the other, are a
small experiment in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

from ..method.contract import Method, Session
from ..method.frame import Frame
from ..method.target import Target
from ..method.verdict import Verdict
from ..method.vitals import Vital
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
FILLED = 0.5  # share of the memory that is left which they may take


def shared(method: type[Method], scenarios: Sequence[Scenario], target: Target, most: int) -> list[list[int]]:
    """Numbers of scenarios in groups that one session can hold, `most` in each; the order is that of their first."""
    groups: list[list[int]] = []
    memory = FILLED * available_memory(target) if most > 1 else 0.0
    for i, scenario in enumerate(scenarios):
        capacity = capacity_of(scenario)
        each = method.memory(scenario, configure(method, scenario), capacity)
        room = min(most, ADDRESSABLE // (capacity + WARP), int(memory / each))
        for group in groups:
            if len(group) < room and _alike(method, scenarios[group[0]], scenario):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def _alike(method: type[Method], first: Scenario, other: Scenario) -> bool:
    """Whether both can be worlds of one session: the same settings, decided by each; and neither waits for rest."""
    if "rest" in (first.until, other.until) or method.apart([first, other]) is not None:
        return False
    return configure(method, first) == configure(method, other)


def run_batches(task: Task) -> dict[str, Any]:
    """Run batches of scenarios, each in a session of its own: how each ended, what it cost, and what each of its
    scenarios came to; and on what machine."""
    target, limit = Target(**task["target"]), task["wall_limit"]
    method, batches = get_method(task["method"]), [[Scenario.model_validate(s) for s in b] for b in task["batches"]]
    readers = min(cores(), max(map(len, batches)))
    with ProcessPoolExecutor(readers, get_context("spawn")) as pool:  # a fork would share the GPU's context
        found = [run_together(method, batch, target, limit, pool) for batch in batches]
    return {"machine": machine(target), "batches": found}


def run_together(
    method: type[Method], scenarios: list[Scenario], target: Target, limit: float, pool: Executor
) -> dict[str, Any]:
    """Run scenarios in one session; what is measured of each is measured beside it, by the processes of a pool: reading
    many small runs would take far longer than running them."""
    start = time.perf_counter()
    session = method.start_together(scenarios, configure(method, scenarios[0]), target)
    series: list[list[Future[dict[str, float]]]] = [[] for _ in scenarios]

    def observe(session: Session, vital: Vital) -> None:
        for rows, frame, scenario in zip(series, session.frames(), scenarios, strict=True):
            rows.append(pool.submit(row_of, frame, scenario, vital))

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


def come_to(scenario: Scenario, frame: Frame, rows: list[dict[str, float]]) -> dict[str, Any]:
    """What a scenario came to, as JSON can hold it."""
    import pandas as pd

    whole = results(scenario, frame, pd.DataFrame(rows))
    return {"measures": whole["measures"], "moving": list(whole["moving"]), "print": whole["print"]}
