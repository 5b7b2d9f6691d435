"""What names a run, what seals it, what makes it stale, what it cost, and what a dead child leaves."""

import hashlib
import json
import threading
from pathlib import Path

import pytest

from fluidbench import provenance, store
from fluidbench.errors import Interrupted, Obstacle, UserError
from fluidbench.run import GRACE, Job
from fluidbench.store import Store, digest, key_of, make_way, read_record, seal, write_atomically, write_record
from fluidbench.study import execute as execution
from fluidbench.study.execute import Finished, Hooks, execute, misfit
from fluidbench.target import HERE, Target
from fluidbench.verdict import FINAL, Verdict

from .made import BEAD, finished

TABLE = BEAD.model_dump(mode="json")


def test_a_key_is_the_hash_of_the_sorted_inputs():
    inputs = {"b": [1, 2.5], "a": "x"}
    text = '{"a": "x", "b": [1, 2.5]}'
    assert key_of(inputs) == hashlib.sha256(text.encode()).hexdigest()[:10] == key_of({"a": "x", "b": [1, 2.5]})
    assert key_of({"a": Path("p")}) == hashlib.sha256(b'{"a": "p"}').hexdigest()[:10]


def test_a_run_is_its_scenario_method_target_repeat_and_variant():
    first = Job(TABLE, "mpm")
    same = [Job(TABLE, "mpm", wall_limit=5.0), Job(TABLE, "mpm", keep_frames=True), Job(TABLE, "mpm", film_every=0.1),
            Job(TABLE, "mpm", checkpoint_every=1.0)]  # fmt: skip
    assert {job.key for job in same} == {first.key}
    other = [
        Job(TABLE, "sph"),
        Job(TABLE, "mpm", repeat=1),
        Job(TABLE, "mpm", variant="v"),
        Job(TABLE | {"seed": 1}, "mpm"),
        Job(TABLE, "mpm", Target(backend="taichi")),
        Job(TABLE, "mpm", Target(backend="taichi", threads=2)),
    ]
    assert len({job.key for job in [first, *other]}) == 7
    assert "variant" not in first.inputs() and other[2].inputs()["variant"] == "v"
    assert first.heading() == {
        "scenario": "line_bead", "method": "mpm", "device": "cpu", "backend": "warp", "threads": 1, "repeat": 0,
        "key": first.key, "seed": 0, "spacing_m": 1.5e-3, "code": provenance.code("mpm", "warp"),
    }  # fmt: skip
    assert (first.target, first.checkpoint_every, first.wall_limit) == (HERE, 300.0, None) and GRACE == 120.0


def test_a_seal_is_of_all_but_itself(tmp_path):
    record = {"b": 1, "a": [1.5]}
    expected = hashlib.sha256(b'{"a": [1.5], "b": 1}').hexdigest()
    assert seal(record) == expected == seal(record | {"seal": "anything"})
    (tmp_path / "x.bin").write_bytes(b"data")
    written = write_record(tmp_path, record, [tmp_path / "x.bin"])
    assert written["files"] == {"x.bin": hashlib.sha256(b"data").hexdigest()} == {"x.bin": digest(tmp_path / "x.bin")}
    assert written["seal"] == seal(written) and read_record(tmp_path) == (written, "")
    assert read_record(tmp_path / "none") == (None, "") and read_record(tmp_path, "other.json") == (None, "")


def test_a_record_that_was_touched_or_lost_a_file_is_not_read(tmp_path):
    (tmp_path / "x.bin").write_bytes(b"data")
    whole = write_record(tmp_path, {"a": 1}, [tmp_path / "x.bin"])
    path = tmp_path / "record.json"
    for broken, words in (
        (whole | {"a": 2}, "record.json is not as it was written"), (whole | {"seal": "0"}, "not as it was written"),
        ({k: v for k, v in whole.items() if k != "seal"}, "not as it was written"), ([whole], "not as it was written"),
    ):  # fmt: skip
        path.write_text(json.dumps(broken))
        assert read_record(tmp_path)[0] is None and words in read_record(tmp_path)[1]
    lists = {"files": ["x.bin"]}
    path.write_text(json.dumps(lists | {"seal": seal(lists)}))
    assert read_record(tmp_path) == (None, "record.json is not as it was written")
    path.write_text("{")
    assert read_record(tmp_path) == (None, "record.json cannot be read")
    path.write_text(json.dumps(whole))
    (tmp_path / "x.bin").write_bytes(b"Data")
    assert read_record(tmp_path) == (None, "x.bin is not as it was written")
    (tmp_path / "x.bin").unlink()
    assert read_record(tmp_path) == (None, "x.bin is missing")
    (tmp_path / "x.bin").mkdir()
    assert read_record(tmp_path) == (None, "x.bin cannot be read")


def test_writing_leaves_the_whole_or_nothing(tmp_path, monkeypatch):
    path = tmp_path / "deep" / "a.txt"
    write_atomically(path, "text")
    write_atomically(path, b"bytes")
    assert path.read_bytes() == b"bytes" and [p.name for p in path.parent.iterdir()] == ["a.txt"]

    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(Obstacle, match=r"cannot write .*a\.txt: No space left on device"):
        write_atomically(path, "more")
    assert path.read_bytes() == b"bytes" and [p.name for p in path.parent.iterdir()] == ["a.txt"]
    monkeypatch.setattr(Path, "replace", lambda self, target: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, "more")
    assert [p.name for p in path.parent.iterdir()] == ["a.txt"]


def test_a_folder_in_the_way_is_put_aside(tmp_path):
    (tmp_path / "empty").mkdir()
    make_way(tmp_path / "empty")
    assert not (tmp_path / "empty").exists()
    for number in (1, 2):
        (tmp_path / "full").mkdir()
        (tmp_path / "full" / "thing").write_text("kept")
        make_way(tmp_path / "full")
        assert not (tmp_path / "full").exists()
        assert (tmp_path / f"full.aside-{number}" / "thing").read_text() == "kept"
    (tmp_path / "file").write_text("kept")
    make_way(tmp_path / "file")
    make_way(tmp_path / "nothing")
    assert (tmp_path / "file").read_text() == "kept"


def test_a_store_finds_by_inputs_and_reuses_what_fits(tmp_path):
    kept = Store(tmp_path)
    folder = kept.folder("a-mpm", {"x": 1})
    assert folder == tmp_path / "runs" / f"a-mpm-{key_of({'x': 1})}"
    assert kept.record(folder, lambda r: "") == (None, "")
    written = write_record(folder, {"a": 1})
    assert kept.record(folder, lambda r: "") == (written, "")
    assert kept.record(folder, lambda r: "stale") == (None, "stale")
    fresh = Store(tmp_path, fresh=True)
    assert fresh.record(folder, lambda r: "") == (None, "")
    fresh.made.add(folder)
    assert fresh.record(folder, lambda r: "") == (written, "")
    (folder / "record.json").write_text("{")
    assert kept.record(folder, lambda r: "never asked") == (None, "record.json cannot be read")
    Store(tmp_path / "a" / "b")
    assert not (tmp_path / "a").exists()
    Store(tmp_path / ("n" * 255))
    for wrong in (tmp_path / ("n" * 256), folder / "record.json" / "x"):
        with pytest.raises(UserError, match="cannot write to the output folder"):
            Store(wrong)


def test_a_claim_is_waited_for_and_sweeps_what_the_dead_left(tmp_path, monkeypatch):
    from filelock import SoftFileLock

    folder, notes = tmp_path / "run", []
    folder.mkdir()
    (folder / ".record.json.1.part").write_text("torn")
    with store.claimed(folder, notes.append):
        assert not list(folder.glob(".*.part")) and (folder / "claim.lock").exists()
    with store.claimed(folder, notes.append):  # it was given back
        pass
    assert notes == [] and store.PATIENCE == 5.0
    monkeypatch.setattr(store, "PATIENCE", 0.05)
    with SoftFileLock(folder / "claim.lock") as held, pytest.raises(RuntimeError, match="asked"):

        def note(text):
            held.release()
            notes.append(text)

        with store.claimed(folder, note):
            assert notes[0].startswith("waiting for run, which another process makes")
            raise RuntimeError("asked")
    (tmp_path / "file").write_text("")
    with pytest.raises(Obstacle, match="cannot write to"), store.claimed(tmp_path / "file" / "x", notes.append):
        pass


# --- which stored runs serve


@pytest.fixture
def stored(monkeypatch):
    """A job, and a record that stands for it."""
    monkeypatch.setattr("fluidbench.job.code", lambda method, backend: {"sources": f"{method} {backend}"})
    monkeypatch.setattr(execution, "hardware", lambda target: dict.fromkeys(provenance.HARDWARE, "here"))
    job = Job(TABLE, "mpm")
    machine = dict.fromkeys(provenance.HARDWARE, "here") | {"load": "9"}
    record = job.heading() | {"verdict": "completed", "code": {"sources": "mpm warp"}, "machine": machine, "files": {}}
    return job, record | {"film_every": None}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, ""),
        *[({"verdict": v}, "") for v in ("diverged", "out_of_capacity")],
        *[({"verdict": v}, f"it ended as {v}") for v in ("timeout", "error", None)],
        ({"key": "x"}, "it is of other inputs"),
        ({"code": {"sources": "other"}}, "the code, or Warp or Taichi, has changed since"),
        *[({"machine": {k: "here" for k in ("arch", "cores", "processor", "device") if k != gone}}, "another machine")
          for gone in ("arch", "cores", "processor", "device")],
        ({"film_every": 0.1}, "its cost includes pictures"),
        ({"verdict": "refused", "machine": {}}, ""),
        ({"verdict": "refused", "code": {}}, "the code"),
    ],
)  # fmt: skip
def test_a_stored_run_serves_for_the_same_inputs_code_and_machine(stored, change, words):
    job, record = stored
    why = misfit(record | change, job)
    assert (words in why) if words else why == ""


def test_a_stored_run_serves_with_the_frames_and_pictures_that_are_wanted(stored):
    _, record = stored
    framed, filmed = Job(TABLE, "mpm", keep_frames=True), Job(TABLE, "mpm", film_every=0.1)
    assert misfit(record, framed) == "its snapshots are wanted" and misfit(record, filmed) == "pictures are wanted"
    assert misfit(record | {"files": {"frame_0000.npz": ""}}, framed) == ""
    assert misfit(record | {"files": {"final.npz": ""}}, framed) != ""
    assert misfit(record | {"film_every": 0.1}, filmed) == "" and misfit(record | {"film_every": 0.2}, filmed) != ""
    assert {Verdict.COMPLETED, Verdict.DIVERGED, Verdict.OUT_OF_CAPACITY, Verdict.REFUSED} == FINAL


def test_a_refusal_is_recorded_without_a_child(tmp_path, monkeypatch):
    monkeypatch.setattr(execution, "launch", lambda *_: pytest.fail("it was launched"))
    ticks = []
    hooks = Hooks(
        lambda i, j, reused: ticks.append(reused), lambda *_: None, lambda i, r: ticks.append(r.verdict), ticks.append
    )
    thick = Job(TABLE | {"material": TABLE["material"] | {"viscosity": 1e6}}, "mpm")
    (made,) = execute([thick], Store(tmp_path), hooks)
    assert (made.verdict, made.reused, made.ok) == ("refused", False, False) and "single precision" in made.reason
    (again,) = execute([thick], Store(tmp_path), hooks)
    assert again.reused and ticks == [False, "refused", True, "refused"]
    monkeypatch.setattr(execution, "shortage", lambda *_: "too little")
    (short,) = execute([Job(TABLE, "mpm")], Store(tmp_path), hooks)
    assert short.reason == "too little" and short.folder.parent == tmp_path / "runs"


@pytest.mark.parametrize("workers", [1, 2])
def test_runs_are_made_once_and_an_interruption_counts_what_is_done(tmp_path, monkeypatch, workers):
    def launch(job, folder, progress):
        if job.repeat == 2:
            raise KeyboardInterrupt
        return write_record(folder, job.heading() | {"verdict": "completed", "files": {}})

    monkeypatch.setattr(execution, "launch", launch)
    nothing = Hooks(*[lambda *_: None] * 3, lambda _: None)
    made = execute([Job(TABLE, "mpm", repeat=r) for r in (0, 1)], Store(tmp_path), nothing, workers)
    assert [r.record["repeat"] for r in made] == [0, 1]
    with pytest.raises(Interrupted, match=r"of 3 runs are finished"):
        execute([Job(TABLE, "mpm", repeat=r) for r in (0, 2, 1)], Store(tmp_path), nothing, workers)
    if workers == 1:
        with pytest.raises(Interrupted, match=r"^1 of 2 runs are finished"):
            execute([Job(TABLE, "mpm", repeat=r) for r in (0, 2)], Store(tmp_path), nothing)


def test_runs_of_one_worker_are_made_one_by_one_and_each_once(tmp_path, monkeypatch):
    threads, stopped = [], []

    def launch(job, folder, progress):
        threads.append(threading.current_thread())
        if job.repeat == 9:
            raise KeyboardInterrupt
        return write_record(folder, job.heading() | {"verdict": "timeout", "files": {}})

    monkeypatch.setattr(execution, "launch", launch)
    monkeypatch.setattr(execution, "stop_children", lambda: stopped.append(1))
    nothing = Hooks(*[lambda *_: None] * 3, lambda _: None)
    execute([Job(TABLE, "mpm")], Store(tmp_path), nothing)
    assert threads == [threading.main_thread()]
    execute([Job(TABLE, "mpm", repeat=1)], Store(tmp_path), nothing, 2)
    assert threads[1] != threading.main_thread() and not stopped
    with pytest.raises(Interrupted):
        execute([Job(TABLE, "mpm", repeat=9)], Store(tmp_path), nothing, 2)
    assert stopped == [1]


def test_a_fresh_store_makes_each_run_once(tmp_path, monkeypatch):
    made = []

    def launch(job, folder, progress):
        made.append(job)
        machine = execution.hardware(job.target)
        return write_record(folder, job.heading() | {"verdict": "completed", "machine": machine, "film_every": None,
                                                     "files": {}})  # fmt: skip

    monkeypatch.setattr(execution, "launch", launch)
    nothing = Hooks(*[lambda *_: None] * 3, lambda _: None)
    store = Store(tmp_path, fresh=True)
    results = execute([Job(TABLE, "mpm")] * 3, store, nothing)
    assert len(made) == 1 and [r.reused for r in results] == [False] * 3 and store.made == {results[0].folder}


def test_a_run_in_words():
    run = finished("sph", spacing=1.234e-3, threads=2)
    assert run.name == "line_bead, sph, d = 1.23 mm" and run.label == "sph" and run.target == HERE and run.ok
    other = Finished(run.record | {"backend": "taichi", "spacing_m": None}, run.folder, False)
    assert other.label == "sph (taichi)" == other.name.partition(", ")[2] and other.target.threads == 2
