"""What names a run, what seals it, what makes it stale, what it cost, and what a dead child leaves."""

import hashlib
import json
import math
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

from fluidbench.errors import Interrupted, Obstacle, UserError
from fluidbench.files import digest, make_way, write_atomically
from fluidbench.measure.reference import Answer
from fluidbench.measure.tower import Criterion, Print
from fluidbench.method.target import HERE, Target
from fluidbench.method.verdict import FINAL, Verdict
from fluidbench.runs import execute as execution
from fluidbench.runs import job as job_module
from fluidbench.runs import provenance, store
from fluidbench.runs.execute import Hooks, as_executor, execute
from fluidbench.runs.job import Job
from fluidbench.runs.process import GRACE
from fluidbench.runs.record import Cost, Record, Run, keep, recall
from fluidbench.runs.store import Store, read_record, seal, write_record
from fluidbench.runs.work import key_of

from .made import BEAD, COST, HEADING, SILENT, change, finished

TABLE = BEAD.model_dump(mode="json")


def test_a_key_is_the_hash_of_the_sorted_inputs():
    inputs = {"b": [1, 2.5], "a": "x"}
    text = '{"a": "x", "b": [1, 2.5]}'
    assert key_of(inputs) == hashlib.sha256(text.encode()).hexdigest()[:10] == key_of({"a": "x", "b": [1, 2.5]})
    assert key_of({"a": Path("p")}) == hashlib.sha256(b'{"a": "p"}').hexdigest()[:10]


def test_a_run_is_its_scenario_method_target_repeat_and_variant():
    first = Job(TABLE, "mpm")
    same = [
        Job(TABLE, "mpm", wall_limit=5.0),
        Job(TABLE, "mpm", keep_frames=True),
        Job(TABLE, "mpm", film_every=0.1),
        Job(TABLE, "mpm", checkpoint_every=1.0),
    ]
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
        "scenario": "line_bead",
        "method": "mpm",
        "device": "cpu",
        "backend": "warp",
        "threads": 1,
        "repeat": 0,
        "key": first.key,
        "seed": 0,
        "spacing_m": 1.5e-3,
        "code": provenance.code("mpm", "warp"),
    }
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
        (whole | {"a": 2}, "record.json is not as it was written"),
        (whole | {"seal": "0"}, "not as it was written"),
        ({k: v for k, v in whole.items() if k != "seal"}, "not as it was written"),
        ([whole], "not as it was written"),
    ):
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
    fresh = Store(tmp_path, fresh=True)
    assert kept.may_reuse(folder) and not fresh.may_reuse(folder)
    fresh.made.add(folder)
    assert fresh.may_reuse(folder) and not fresh.may_reuse(kept.folder("a-mpm", {"x": 2}))
    write_record(folder, {"a": 1})
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
    monkeypatch.setattr("fluidbench.runs.job.code", lambda method, backend: {"sources": f"{method} {backend}"})
    monkeypatch.setattr(job_module, "hardware", lambda target: dict.fromkeys(provenance.HARDWARE, "here"))
    job = Job(TABLE, "mpm")
    machine = dict.fromkeys(provenance.HARDWARE, "here") | {"load": "9"}
    return job, Record(**job.heading(), verdict="completed", machine=machine)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, ""),
        *[({"verdict": v}, "") for v in ("diverged", "out_of_capacity")],
        *[({"verdict": v}, f"it ended as {v}") for v in ("timeout", "error")],
        ({"key": "x"}, "it is of other inputs"),
        ({"code": {"sources": "other"}}, "the code, or Warp or Taichi, has changed since"),
        *[
            ({"machine": {k: "here" for k in ("arch", "cores", "processor", "device") if k != gone}}, "another machine")
            for gone in ("arch", "cores", "processor", "device")
        ],
        ({"film_every": 0.1}, "its cost includes pictures"),
        ({"verdict": "refused", "machine": {}}, ""),
        ({"verdict": "refused", "code": {}}, "the code"),
    ],
)
def test_a_stored_run_serves_for_the_same_inputs_code_and_machine(stored, change, words):
    job, record = stored
    why = job.misfit(Record.model_validate(record.model_dump() | change))
    assert (words in why) if words else why == ""


def test_a_stored_run_serves_with_the_frames_and_pictures_that_are_wanted(stored):
    _, record = stored
    framed, filmed = Job(TABLE, "mpm", keep_frames=True), Job(TABLE, "mpm", film_every=0.1)

    def but(**change):
        return record.model_copy(update=change)

    assert framed.misfit(record) == "its snapshots are wanted" and filmed.misfit(record) == "pictures are wanted"
    assert framed.misfit(but(files={"frame_0000.npz": ""})) == ""
    assert framed.misfit(but(files={"final.npz": ""})) != ""
    assert filmed.misfit(but(film_every=0.1)) == "" and filmed.misfit(but(film_every=0.2)) != ""
    assert {Verdict.COMPLETED, Verdict.DIVERGED, Verdict.OUT_OF_CAPACITY, Verdict.REFUSED} == FINAL


def test_a_refusal_is_recorded_without_a_child(tmp_path, monkeypatch):
    monkeypatch.setattr(execution, "launch", lambda *_: pytest.fail("it was launched"))
    ticks = []
    hooks = Hooks(
        lambda i, j, reused: ticks.append(reused), lambda *_: None, lambda i, r: ticks.append(r.verdict), ticks.append
    )
    explicit = {"numerics": {"mpm": {"viscosity": "explicit"}}}
    thick = Job(TABLE | {"material": TABLE["material"] | {"viscosity": 1e6}} | explicit, "mpm")
    (made,) = execute([thick], Store(tmp_path), hooks)
    assert (made.verdict, made.reused, made.ok) == ("refused", False, False) and "single precision" in made.reason
    (again,) = execute([thick], Store(tmp_path), hooks)
    assert again.reused and ticks == [False, "refused", True, "refused"]
    monkeypatch.setattr(job_module, "shortage", lambda *_: "too little")
    (short,) = execute([Job(TABLE, "mpm")], Store(tmp_path), hooks)
    assert short.reason == "too little" and short.folder.parent == tmp_path / "runs"


@pytest.mark.parametrize("workers", [1, 2])
def test_runs_are_made_once_and_an_interruption_counts_what_is_done(tmp_path, monkeypatch, workers):
    def launch(job, folder, progress=None, gpu=""):
        if job.repeat == 2:
            raise KeyboardInterrupt
        return keep(folder, Record(**job.heading(), verdict="completed"))

    monkeypatch.setattr(execution, "launch", launch)
    made = execute([Job(TABLE, "mpm", repeat=r) for r in (0, 1)], Store(tmp_path), SILENT, workers)
    assert [r.record.repeat for r in made] == [0, 1]
    with pytest.raises(Interrupted, match=r"of 3 runs are finished"):
        execute([Job(TABLE, "mpm", repeat=r) for r in (0, 2, 1)], Store(tmp_path), SILENT, workers)
    if workers == 1:
        with pytest.raises(Interrupted, match=r"^1 of 2 runs are finished"):
            execute([Job(TABLE, "mpm", repeat=r) for r in (0, 2)], Store(tmp_path), SILENT)


def test_runs_of_one_worker_are_made_one_by_one_and_each_once(tmp_path, monkeypatch):
    threads, stopped = [], []

    def launch(job, folder, progress=None, gpu=""):
        threads.append(threading.current_thread())
        if job.repeat == 9:
            raise KeyboardInterrupt
        return keep(folder, Record(**job.heading(), verdict="timeout"))

    monkeypatch.setattr(execution, "launch", launch)
    monkeypatch.setattr(execution, "stop_children", lambda: stopped.append(1))
    execute([Job(TABLE, "mpm")], Store(tmp_path), SILENT)
    assert threads == [threading.main_thread()]
    execute([Job(TABLE, "mpm", repeat=1)], Store(tmp_path), SILENT, 2)
    assert threads[1] != threading.main_thread() and not stopped
    with pytest.raises(Interrupted):
        execute([Job(TABLE, "mpm", repeat=9)], Store(tmp_path), SILENT, 2)
    assert stopped == [1]


def test_a_fresh_store_makes_each_run_once(tmp_path, monkeypatch):
    made = []

    def launch(job, folder, progress=None, gpu=""):
        made.append(job)
        return keep(folder, Record(**job.heading(), verdict="completed", machine=provenance.hardware(job.target)))

    monkeypatch.setattr(execution, "launch", launch)
    store = Store(tmp_path, fresh=True)
    results = execute([Job(TABLE, "mpm")] * 3, store, SILENT)
    assert len(made) == 1 and [r.reused for r in results] == [False] * 3 and store.made == {results[0].folder}


def test_a_run_in_words():
    run = finished("sph", spacing=1.234e-3, threads=2)
    assert run.name == "line_bead, sph, d = 1.23 mm" and run.label == "sph" and run.ok
    assert run.target == Target(threads=2)
    other = Run(run.record.model_copy(update={"backend": "taichi"}), run.folder)
    assert other.label == "sph (taichi)" and other.name == "line_bead, sph (taichi), d = 1.23 mm"
    assert other.target.threads == 2


# --- what a record is


def test_a_record_is_read_as_it_was_written(tmp_path):
    """Numbers that JSON has no word for included: a diverged measure must not make a run unreadable."""
    odd = {"bead_width_m": math.nan, "height_m": math.inf, "slump": -math.inf, "top_m": 0.1}
    (tmp_path / "series.parquet").write_bytes(b"rows")
    written = Record(
        **HEADING | {"code": {"sources": "x"}},
        method="mpm",
        verdict="completed",
        measures=odd,
        answers=(Answer("q", math.nan, 2.0, math.inf, "relative", "s"),),
        not_compared=("why",),
        success=(Criterion("height", 0.5, ">= 1", False, Print.COLLAPSED),),
        print=Print.COLLAPSED,
        cost=Cost(**COST | {"wall_per_simulated_s": math.inf}),
        bounds_s={"acoustic": math.inf},
        config={"safety": 0.5},
        input=TABLE,
        machine={"device": "CPU"},
        film_every=0.1,
        resumed=2,
    )
    kept = keep(tmp_path, written, ["series.parquet"])
    found, why = recall(tmp_path)
    assert why == "" and kept.seal and repr(found) == repr(kept) and list(found.files) == ["series.parquet"]
    assert repr(found.model_copy(update={"files": {}, "seal": ""})) == repr(written)
    assert isinstance(found.success[0], Criterion) and isinstance(found.answers[0], Answer)
    assert (found.print, found.verdict) == (Print.COLLAPSED, Verdict.COMPLETED)
    assert math.isnan(found.measures["bead_width_m"]) and found.measures["slump"] == -math.inf
    assert json.loads((tmp_path / "record.json").read_text())["cost"]["wall_per_simulated_s"] == math.inf
    run = Run(found, tmp_path)
    assert run.scenario.model_dump(mode="json") == TABLE and run.cost.peak_device_MiB is None
    assert run.record.row().items() >= {"print": "collapsed", "error: q": math.inf, "machine_device": "CPU"}.items()


@pytest.mark.parametrize(
    "change", [{"tilt": 1.0}, {"verdict": "undecided"}, {"cost": {"wall_s": 1.0}}, {"key": None}, {"answers": [{}]}]
)
def test_a_record_of_another_edition_is_run_again(tmp_path, change):
    whole = keep(tmp_path, Record(**HEADING, method="mpm", verdict="completed"))
    table = whole.model_dump(mode="json") | change
    write_record(tmp_path, table)
    assert recall(tmp_path) == (None, "record.json is of another edition of fluidbench")
    table.pop("scenario")
    write_record(tmp_path, table)
    assert recall(tmp_path)[1] == "record.json is of another edition of fluidbench"
    assert Job(TABLE, "mpm").recall(tmp_path) == (None, "record.json is of another edition of fluidbench")
    assert Job(TABLE, "mpm").recall(tmp_path / "none") == (None, "")


def test_a_run_without_a_result_has_no_cost():
    with pytest.raises(ValueError, match="line_bead, mpm, d = 1 mm: timeout: it has no cost"):
        finished(verdict="timeout").cost  # noqa: B018
    assert finished(verdict="timeout").record.row()["verdict"] == "timeout"


@pytest.mark.parametrize("verdict", [v for v in Verdict if v is not Verdict.COMPLETED])
def test_what_a_run_without_a_result_took_is_kept_and_told_nowhere(verdict):
    whole = finished()
    taken = change(finished(), verdict=verdict).record
    assert taken.cost == whole.cost == whole.record.counted and taken.counted is None
    assert set(whole.record.row()) - set(taken.row()) == set(whole.cost.model_dump(exclude_none=True))


# --- where work is done


class Later:
    """A future of somebody else's: done at the second look."""

    def __init__(self, call):
        self.call, self.looks, self.cancelled = call, 0, False

    def done(self):
        self.looks += 1
        return self.looks > 1

    def result(self):
        return self.call()

    def cancel(self):
        self.cancelled = True


class Queue:
    """An executor that is none of concurrent.futures': it has `submit` and nothing else."""

    def __init__(self):
        self.futures = []

    def submit(self, call):
        self.futures.append(Later(call))
        return self.futures[-1]


@pytest.fixture
def launched(monkeypatch):
    """Jobs as they are launched, by a child that does nothing: repeat 9 is interrupted, 8 meets an obstacle, 7 takes
    its time."""
    made = []

    def launch(job, folder, progress=None, gpu=""):
        made.append(job)
        if job.repeat == 9:
            raise KeyboardInterrupt
        if job.repeat == 7:
            time.sleep(0.2)
        if job.repeat == 8:
            raise Obstacle("the disk is full")
        return keep(folder, Record(**job.heading(), verdict="completed", machine=provenance.hardware(job.target)))

    monkeypatch.setattr(execution, "launch", launch)
    monkeypatch.setattr(execution, "POLL", 0.001)
    return made


def repeats(*numbers):
    return [Job(TABLE, "mpm", repeat=r) for r in numbers]


def hearing():
    """Hooks, and what they hear."""
    told = []
    return told, Hooks(
        lambda i, work, reused: told.append((i, "reused" if reused else "starts")),
        lambda *_: None,
        lambda i, result: told.append((i, result.verdict)),
        told.append,
    )


@pytest.mark.parametrize("pool", [lambda: ThreadPoolExecutor(2), Queue])
def test_work_is_done_by_whatever_can_submit(tmp_path, launched, pool):
    told, hooks = hearing()
    made = execute(repeats(2, 0, 1), Store(tmp_path), hooks, executor=pool())
    assert [r.record.repeat for r in made] == [2, 0, 1] and len(launched) == 3
    assert [r.reused for r in made] == [False] * 3 and all(r.folder.parent == tmp_path / "runs" for r in made)
    assert sorted(told) == [(i, what) for i in range(3) for what in ("completed", "starts")]
    told.clear()
    again = execute(repeats(2, 0, 1), Store(tmp_path), hooks, executor=pool())
    assert [r.reused for r in again] == [True] * 3 and len(launched) == 3 and (0, "reused") in told


def test_a_dask_client_gives_its_executor(tmp_path, launched):
    asked, queue = [], Queue()
    client = SimpleNamespace(get_executor=lambda **words: asked.append(words) or queue, submit=None)
    (made,) = execute(repeats(0), Store(tmp_path), SILENT, executor=client)
    assert made.ok and asked == [{"pure": False}] and len(queue.futures) == 1
    for wrong in (5, "slurm", object()):
        with pytest.raises(UserError, match=r"interface of concurrent\.futures; got"):
            as_executor(wrong)


@pytest.mark.parametrize("pool", [lambda: ThreadPoolExecutor(1), Queue])
@pytest.mark.parametrize(
    ("bad", "error", "words"), [(9, Interrupted, "1 of 4 runs are finished"), (8, Obstacle, "the disk is full")]
)
def test_whatever_goes_wrong_elsewhere_nothing_more_is_begun(tmp_path, launched, pool, bad, error, words):
    given = pool()
    with pytest.raises(error, match=words):
        execute(repeats(0, bad, 7, 2), Store(tmp_path), SILENT, executor=given)
    if isinstance(given, ThreadPoolExecutor):
        given.shutdown()
        assert [j.repeat for j in launched] in ([0, bad], [0, bad, 7])  # what is under way goes on
    else:
        assert [f.cancelled for f in given.futures] == [True] * 4 and [j.repeat for j in launched] == [0, bad]


@pytest.mark.parametrize(("workers", "pool"), [(1, None), (2, None), (1, lambda: ThreadPoolExecutor(2)), (1, Queue)])
@pytest.mark.parametrize("fresh", [False, True])
def test_work_that_is_planned_twice_is_done_once(tmp_path, launched, workers, pool, fresh):
    told, hooks = hearing()
    planned = repeats(0, 1, 0, 0)
    made = execute(planned, Store(tmp_path, fresh), hooks, workers, pool and pool())
    assert sorted(j.repeat for j in launched) == [0, 1] and [r.record.repeat for r in made] == [0, 1, 0, 0]
    assert len({r.folder for r in made}) == 2 and [r.reused for r in made] == [False] * 4
    starts = {i: what for i, what in told if what in ("starts", "reused")}
    assert starts == {0: "starts", 1: "starts", 2: "reused", 3: "reused"}
    assert sorted(i for i, what in told if what == "completed") == [0, 1, 2, 3]
