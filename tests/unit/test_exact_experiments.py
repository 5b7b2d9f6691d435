"""Small experiments: kept, found again, and blamed one by one when a process dies."""

import json
import os
import sys

import pytest

from fluidbench.errors import Interrupted
from fluidbench.offspring import search_path
from fluidbench.store import Store, read_record
from fluidbench.study import experiments
from fluidbench.study.experiments import run_tasks

TARGET = {"device": "cpu", "backend": "warp", "threads": 1}


def task(x, **more):
    return (f"t{x}", {"method": "mpm", "target": TARGET, "x": x} | more)


@pytest.fixture
def rounds(monkeypatch):
    """Rounds of tasks as they are asked for, run here: those in `deadly` kill a process, and all that run with it."""
    asked, deadly = [], set()

    def round_(tasks, function, workers):
        asked.append((sorted(t["x"] for t in tasks.values()), workers))
        died = False
        for i, t in reversed(tasks.items()):
            died = died or t["x"] in deadly
            yield i, None if died else function(t)

    monkeypatch.setattr(experiments, "_round", round_)
    return asked, deadly


def double(task):
    return {"crash": "ValueError: bad"} if task["x"] < 0 else {"y": 2 * task["x"]}


def test_results_come_in_order_and_are_kept(tmp_path, rounds):
    asked, _ = rounds
    told = []
    tasks = [task(3), task(1), task(-1), task(2)]
    results = run_tasks(tasks, double, Store(tmp_path), 2, lambda i, r: told.append((i, r)))
    assert results == [{"y": 6}, {"y": 2}, {"crash": "ValueError: bad"}, {"y": 4}]
    assert sorted(told, key=lambda row: row[0]) == list(enumerate(results)) and asked == [([-1, 1, 2, 3], 2)]
    kept = sorted(tmp_path.glob("runs/*/result.json"))
    assert len(kept) == 3 and read_record(kept[0].parent, "result.json")[0]["result"] in results
    again = run_tasks(tasks, double, Store(tmp_path), 2, lambda i, r: None)
    assert again == results and asked[1:] == [([-1], 2)]  # what crashed is tried again
    fresh = Store(tmp_path, fresh=True)
    run_tasks(tasks[:2], double, fresh, 1, lambda *_: None)
    run_tasks(tasks[:2], double, fresh, 1, lambda *_: None)
    assert asked[2:] == [([1, 3], 1)]  # once, whatever was there before


def test_results_of_other_code_are_measured_again(tmp_path, rounds, monkeypatch):
    asked, _ = rounds
    run_tasks([task(1)], double, Store(tmp_path), 1, lambda *_: None)
    monkeypatch.setattr(experiments, "code", lambda method, backend: {"sources": "edited"})
    run_tasks([task(1)], double, Store(tmp_path), 1, lambda *_: None)
    assert [row[0] for row in asked] == [[1], [1]]
    run_tasks([task(1, more=2)], double, Store(tmp_path), 1, lambda *_: None)
    assert len(list(tmp_path.glob("runs/*/result.json"))) == 2


def test_who_kills_a_process_is_found_and_the_others_are_run(tmp_path, rounds):
    asked, deadly = rounds
    deadly.add(4)
    tasks = [task(x) for x in range(8)]
    results = run_tasks(tasks, double, Store(tmp_path), 2, lambda *_: None)
    assert results == [{"y": 2 * x} if x != 4 else {"crash": "its process died without a word"} for x in range(8)]
    # all at once; then three of those that may have been it, alone; then the others together
    assert [row for row in asked if len(row[0]) > 1] == [(list(range(8)), 2), ([0, 1], 2)]
    assert sorted(row for row in asked if len(row[0]) == 1) == [([2], 1), ([3], 1), ([4], 1)]


def test_an_interruption_says_how_much_is_finished(tmp_path, rounds):
    def stop(task):
        if task["x"] == 1:
            raise KeyboardInterrupt
        return {"y": 0}

    with pytest.raises(Interrupted, match="2 of 4 experiments are finished"):
        run_tasks([task(x) for x in range(4)], stop, Store(tmp_path), 1, lambda *_: None)


def test_workers_inherit_a_clean_environment(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/elsewhere")
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    with experiments._clean_environment():
        assert "PYTHONPATH" not in os.environ and os.environ["PYTHONSAFEPATH"] == "1"
    assert os.environ["PYTHONPATH"] == "/elsewhere" and "PYTHONSAFEPATH" not in os.environ
    monkeypatch.setattr(sys, "path", list(sys.path))
    wanted = search_path()
    experiments._begin(wanted)
    assert sys.path == wanted


def test_a_task_runs_in_a_process_of_its_own(tmp_path):
    results = run_tasks(
        [("a", {"method": "mpm", "target": TARGET, "s": "[1"})], json.loads, Store(tmp_path), 1, lambda *_: None
    )
    assert results[0]["crash"].startswith("TypeError: the JSON object must be str")
