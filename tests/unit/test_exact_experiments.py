"""Small experiments: kept, found again, and blamed one by one when a process dies."""

import os
from io import StringIO

import pytest
from rich.console import Console

from fluidbench.errors import Halted, Interrupted, Obstacle, UserError
from fluidbench.method.target import HERE, Target
from fluidbench.report.progress import Display
from fluidbench.runs import execute as execution
from fluidbench.runs import experiment as module
from fluidbench.runs import process
from fluidbench.runs.execute import Hooks, execute
from fluidbench.runs.experiment import Experiment
from fluidbench.runs.job import Job
from fluidbench.runs.store import Store, read_record

from .made import BEAD, SILENT, change, finished

DUTIES = """
import os, signal

def double(task):
    if task["x"] < 0:
        raise ValueError("bad")
    if task["x"] == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"y": 2 * task["x"], "process": os.getpid()}

def decline(task):
    from fluidbench.errors import UserError
    raise UserError("there is no\\nsuch thing")
"""


@pytest.fixture(autouse=True)
def duties(tmp_path, monkeypatch):
    """A module of functions for experiments, where children find it as well."""
    (tmp_path / "duties").mkdir()
    (tmp_path / "duties" / "duties_of_tests.py").write_text(DUTIES)
    monkeypatch.syspath_prepend(str(tmp_path / "duties"))


def task(x, function="double", **more):
    return Experiment(f"duties_of_tests:{function}", f"t{x}", "mpm", {"x": x} | more)


@pytest.fixture
def done(monkeypatch):
    """Experiments as they are launched, done here; one whose function raises has crashed."""
    asked = []

    def launch(work, folder, progress=None, gpu=""):
        asked.append(work.task["x"])
        folder.mkdir(parents=True, exist_ok=True)
        try:
            work.perform(folder, lambda _: None)
        except ValueError as error:
            return work.bury(folder, False, f"ValueError: {error}")
        return work.recall(folder)[0]

    monkeypatch.setattr(execution, "launch", launch)
    return asked


def values(results):
    return [r.get("y", r.get("crash")) for r in results]


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_order_and_are_kept(tmp_path, done, workers):
    tasks = [task(3), task(1), task(-1), task(2)]
    results = execute(tasks, Store(tmp_path), SILENT, workers)
    assert values(results) == [6, 2, "ValueError: bad", 4] and sorted(done) == [-1, 1, 2, 3]
    kept = sorted(tmp_path.glob("runs/*/result.json"))
    assert len(kept) == 3 and read_record(kept[0].parent, "result.json")[0]["result"] in results
    again = execute(tasks, Store(tmp_path), SILENT, workers)
    assert again == results and done[4:] == [-1]  # what crashed is tried again
    fresh = Store(tmp_path, fresh=True)
    execute(tasks[:2], fresh, SILENT)
    execute(tasks[:2], fresh, SILENT)
    assert done[5:] == [3, 1]  # once, whatever was there before


def test_results_of_other_code_are_measured_again(tmp_path, done, monkeypatch):
    asked, notes = [], []
    hooks = Hooks(*[lambda *_: None] * 3, notes.append)
    execute([task(1)], Store(tmp_path), hooks)
    real = module.code
    monkeypatch.setattr(module, "code", lambda *given: asked.append(given) or {"sources": "edited"})
    execute([task(1)], Store(tmp_path), hooks)
    assert done == [1, 1] and set(asked) == {("mpm", "warp", ("study",))}
    assert len(notes) == 1 and notes[0].endswith("is run again: the code, or Warp or Taichi, has changed since")
    monkeypatch.setattr(module, "code", real)
    execute([task(1, more=2)], Store(tmp_path), hooks)
    assert len(list(tmp_path.glob("runs/*/result.json"))) == 2


def test_an_experiment_knows_its_own_result(tmp_path):
    own = task(1)
    assert own.recall(tmp_path) == (None, "") and own.forestall(tmp_path) is None and own.limit is None
    own.perform(tmp_path, lambda _: None)
    assert own.recall(tmp_path) == ({"y": 2, "process": os.getpid()}, "")
    assert task(1, more=2).recall(tmp_path)[0] is None and own.key != task(2).key
    path = tmp_path / "result.json"
    path.write_text(path.read_text().replace('"y": 2', '"y": 3'))
    assert own.recall(tmp_path) == (None, "result.json is not as it was written")
    path.write_text("{")
    assert own.recall(tmp_path) == (None, "result.json cannot be read")
    assert own.refuse(tmp_path, "no") == {"crash": "no"} == own.bury(tmp_path, True, "no")
    assert own.name == "t1" and own.target == HERE and own.inputs() == {"x": 1}
    with pytest.raises(UserError, match="there is no"):
        task(1, "decline").perform(tmp_path, lambda _: None)


def test_an_interruption_says_how_much_is_finished(tmp_path, monkeypatch):
    def launch(work, folder, progress=None, gpu=""):
        if work.task["x"] == 2:
            raise KeyboardInterrupt
        return {"y": 0}

    monkeypatch.setattr(execution, "launch", launch)
    with pytest.raises(Interrupted, match="2 of 4 runs are finished"):
        execute([task(x) for x in range(4)], Store(tmp_path), SILENT)


@pytest.mark.parametrize("error", [Obstacle("the disk is full"), OSError(12, "Cannot allocate memory")], ids=repr)
def test_what_is_under_way_resumes_and_what_never_began_does_not(tmp_path, monkeypatch, error):
    def fail(*_):
        raise error

    monkeypatch.setattr(execution, "launch", fail)
    with pytest.raises(Halted, match=r"^(the disk is full|Cannot allocate memory)$"):
        execute([task(1)], Store(tmp_path), SILENT)
    monkeypatch.setattr(execution, "kernels", fail)  # no folder for them
    with pytest.raises(type(error)) as met:
        execute([task(1)], Store(tmp_path), SILENT)
    assert not isinstance(met.value, Halted)


def test_a_file_in_the_place_of_a_run_halts_what_is_finished_alone(tmp_path, done):
    store, tasks = Store(tmp_path), [task(1), task(2)]
    place = store.folder(tasks[1].name, tasks[1].inputs())
    place.parent.mkdir()
    place.write_text("mine")
    with pytest.raises(Halted, match="File exists"):
        execute(tasks, Store(tmp_path), SILENT)
    with pytest.raises(Obstacle, match="File exists") as met:
        execute(tasks[1:], Store(tmp_path), SILENT)
    assert not isinstance(met.value, Halted) and place.read_text() == "mine" and done == [1]


def test_who_kills_a_process_is_found_and_the_others_are_run(tmp_path):
    """Real children, each one's own: who is killed, raises or declines says so, and takes nobody along."""
    results = execute([task(3), task(4), task(-1), task(5, "decline")], Store(tmp_path), SILENT, 2)
    assert results[0]["y"] == 6 and results[0]["process"] != os.getpid()
    assert results[1]["crash"].startswith("its process was killed (SIGKILL)")
    assert results[2] == {"crash": "its process ended with code 1: ValueError: bad"}
    assert list(results[3]) == ["crash"]
    again = Store(tmp_path)
    kept = [
        t for t in (task(3), task(4), task(-1), task(5, "decline")) if t.recall(again.folder(t.name, t.inputs()))[0]
    ]
    assert kept == [task(3)]
    assert not process._children


# --- what is shown meanwhile


PROGRESS = {"time": 0.5, "until": 1.0, "speed": 0.25}


def display(planned, line=None, quiet=False, terminal=False):
    console = Console(file=StringIO(), width=200, force_terminal=terminal)
    return Display("title", planned, line, quiet, console), console.file


def reused(i, time="now"):
    run = change(finished("mpm", repeat=i), machine={"time": time})
    object.__setattr__(run, "reused", True)
    return run


def show(shown, *results):
    with shown as hooks:
        for i, result in enumerate(results):
            known = getattr(result, "reused", False)
            hooks.started(i, shown.planned[i], known)
            if not known:
                hooks.progress(i, PROGRESS)
            hooks.ended(i, result)
        hooks.note("a note")


JOBS = [Job(BEAD.model_dump(mode="json"), "mpm", Target(backend="taichi"), repeat=i) for i in range(5)]


def test_lines_are_said_of_what_has_ended_and_nothing_where_there_is_nothing_to_say():
    said = []
    shown, text = display([*JOBS[:2], task(1)], lambda i, result: said.append((i, result)) or f"[line {i}]" * (i != 1))
    results = finished(), finished(), {"y": 2}
    show(shown, *results)
    assert said == list(enumerate(results)) and shown.progress.tasks[0].completed == 3 and not shown.tasks
    assert text.getvalue() == "[line 0]\n[line 2]\nfluidbench: a note\n"  # no bars where nobody looks


def test_what_was_reused_is_named_or_counted():
    shown, text = display(JOBS[:2])
    show(shown, reused(0, "monday"), finished())
    assert text.getvalue().splitlines()[-1] == (
        "fluidbench: reused: mpm (monday); --fresh (fresh=True) runs them again"
    )
    shown, text = display(JOBS)
    show(shown, *[reused(i, f"2026-01-0{9 - i}") for i in range(5)])
    assert "reused: 5 runs, the oldest of 2026-01-05; " in text.getvalue()


def test_a_quiet_display_passes_notes_on_and_says_nothing_else():
    shown, text = display(JOBS[:2], lambda i, result: "a line", quiet=True, terminal=True)
    show(shown, reused(0), finished())
    assert text.getvalue().replace("\x1b", "").strip() == "fluidbench: a note"


def test_bars_are_drawn_in_a_terminal():
    shown, text = display(JOBS[:1], terminal=True)
    with shown as hooks:
        hooks.started(0, JOBS[0], False)
        hooks.progress(0, PROGRESS)
        (bar,) = [t for t in shown.progress.tasks if t.id in shown.tasks.values()]
        assert (bar.description, bar.completed) == ("  line_bead-mpm (taichi)", 50)
        assert bar.fields["state"] == "t = 0.500 of 1 s, top speed 0.25 m/s"
        hooks.ended(0, finished())
    assert "title" in text.getvalue() and "1/1" in text.getvalue() and "mpm completed" in text.getvalue()
