"""A finished study whose files are broken is mended; a disk that fails gives one line and leaves no litter."""

import errno
import os
import random
import re
import shutil
import stat
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from .faults import (
    RESULTS,
    SHAPES,
    TINY,
    Child,
    Fault,
    children_in_process,
    failing_writes,
    faults,
    litter,
    small_disk,
    small_files,
    unwhole,
)
from .harness import SEED, Outcome, fluidbench, told

SAYS = r"(?i)again|redo|damaged|broken|unreadable|not readable|cannot be read|incomplete"
CODES = (errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EIO, errno.EDQUOT)
SIZES = (0, 100, 1000, 3000, 4200, 10_000, 16_000, 40_000, 1_000_000, 4_900_000)


@pytest.fixture(scope="module", autouse=True)
def _in_process():
    with children_in_process():
        yield


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    """The output folder of one tiny finished run."""
    out = tmp_path_factory.mktemp("pristine") / "out"
    done = run(out)
    assert done.code == 0 and not unwhole(out), (done.crash, done.err, unwhole(out))
    return out


def run(out: Path) -> Outcome:
    return fluidbench(["run", "line_bead", *TINY, "--out", str(out)])


def broken(fault: Fault, pristine: Path, out: Path, rng: random.Random) -> list[str]:
    """Break, call again, and say what is not as it should be."""
    shutil.copytree(pristine, out, symlinks=True)
    fault.apply(out, rng)
    before = Child.started
    done = run(out)
    runs, wrong = Child.started - before, []
    mine = fault.way == "full folder"  # holds a user's file: to mend it is right, to say that it is in the way too
    if done.crash:
        return [f"{fault}: crash: {done.crash}"]
    if mine and done.code in (1, 2) and (out / next(out.rglob("mine.txt"), Path("no"))).exists():
        return [] if len(done.err.strip().splitlines()) == 1 else [f"{fault}: not one line: {done.err[:200]}"]
    if done.code != 0:
        return [f"{fault}: exit code {done.code}: {(done.err + done.out).strip()[-200:]}"]
    wrong += [f"not mended: {text}" for text in unwhole(out)] + [f"litter: {name}" for name in litter(out)]
    if fault.redone and runs != 1:
        wrong.append(f"{runs} runs were made")
    if fault.redone and not fault.silent and not said(fault, done):
        wrong.append(f"does not say so: {done.err.strip()[:200]!r}")
    if len(done.err.strip().splitlines()) > 3:
        wrong.append(f"{len(done.err.splitlines())} lines of message")
    shutil.rmtree(out)
    return [f"{fault}: {'; '.join(wrong)}"] if wrong else []


def said(fault: Fault, done: Outcome) -> bool:
    text = done.err + done.out
    return fault.file in text or re.search(SAYS, text) is not None


def failed(kind: str, done: Outcome, out: Path, codes: tuple[int, ...] = (0, 1)) -> list[str]:
    """What is not as it should be after a write has failed; 0 where all that matters was written all the same."""
    if done.crash:
        return [f"{kind}: crash: {done.crash}"]
    wrong = [f"litter: {name}" for name in litter(out)]
    if done.code not in codes:
        wrong.append(f"exit code {done.code}")
    if done.code == 0 and unwhole(out):
        wrong.append(f"exit code 0, but {unwhole(out)}")
    if done.code and not 1 <= len((done.err.strip() or done.out.strip()[-80:]).splitlines()) <= 2:
        wrong.append(f"not one line: {done.err.strip()[:200]!r}")
    if "Traceback" in done.err + done.out:
        wrong.append("traceback")
    return [f"{kind}: {'; '.join(wrong)}"] if wrong else []


def mended(kind: str, out: Path) -> list[str]:
    """The same call once the disk is sound again."""
    again = run(out)
    if again.code != 0 or unwhole(out):
        return [f"{kind}: afterwards exit code {again.code}, {again.crash or again.err[:200]} {unwhole(out)}"]
    return []


def denied(first: int, code: int, fresh: bool, pristine: Path, out: Path) -> list[str]:
    """The `first` and every later write fails, on a new folder or on one that holds the run."""
    if not fresh:
        shutil.copytree(pristine, out)
    kind = f"{errno.errorcode[code]} from write {first} on{'' if fresh else ', run finished'}"
    with failing_writes(out, first, code):
        done = run(out)
    codes = (0, 1, 2) if first <= 3 else (0, 1)  # 2: the folder itself is no place to write
    wrong = failed(kind, done, out, codes) if out.exists() else [f"{kind}: crash: {done.crash}"] * bool(done.crash)
    if not fresh and not wrong:
        lost = [name for name in RESULTS if not next((out / "runs").rglob(name), out / "no").is_file()]
        wrong += [f"{kind}: lost {lost}"] if lost else []
    return wrong or mended(kind, out)


def writes(fresh: bool, pristine: Path, out: Path) -> int:
    """How many writes a call makes."""
    if not fresh:
        shutil.copytree(pristine, out)
    with failing_writes(out, 10**9, 0) as tried:
        assert run(out).code == 0
    shutil.rmtree(out)
    return len(tried)


def cut(size: int, out: Path) -> list[str]:
    """No file may grow beyond `size`."""
    kind = f"files of at most {size} bytes"
    with small_files(size):
        done = run(out)
    return (failed(kind, done, out) if out.exists() else [done.crash] * bool(done.crash)) or mended(kind, out)


def full_disk(kilobytes: int, out: Path) -> list[str]:
    """A disk of this size, then a larger one."""
    out.mkdir(parents=True)
    try:
        with small_disk(out, kilobytes) as remount:
            done = run(out)
            wrong = failed(f"a disk of {kilobytes} KiB", done, out)
            remount("size=100m")
            return wrong or mended(f"a disk of {kilobytes} KiB", out)
    except OSError as error:
        pytest.skip(f"needs root: {error}")


def sample() -> list[Fault]:
    """Three faults of each file of a run that matters, one of each other file."""
    rng, found = random.Random(SEED), []
    for file in dict.fromkeys(fault.file for fault in faults()):
        own = [fault for fault in faults() if fault.file == file and fault.way != "shape"]
        found += rng.sample(own, 3 if file in RESULTS else 1)
    return found


@pytest.mark.parametrize("fault", sample(), ids=str)
def test_a_broken_file_is_mended(fault, pristine, tmp_path):
    assert not broken(fault, pristine, tmp_path / "out", random.Random(SEED))


@pytest.mark.parametrize("shape", random.Random(SEED).sample(SHAPES, 3), ids=lambda s: s[:30])
def test_a_record_of_another_shape_is_run_again(shape, pristine, tmp_path):
    assert not broken(Fault("record.json", "shape", shape), pristine, tmp_path / "out", random.Random(SEED))


@pytest.mark.parametrize("first", [1, 4, 9, 15])
def test_a_write_that_fails_is_one_line(first, pristine, tmp_path):
    assert not denied(first, CODES[first % len(CODES)], first % 2 == 0, pristine, tmp_path / "out")


@pytest.mark.parametrize("size", [1000, 16_000])
def test_a_file_that_cannot_grow_is_one_line(size, tmp_path):
    assert not cut(size, tmp_path / "out")


def test_a_full_disk_is_one_line(tmp_path):
    assert not full_disk(64, tmp_path / "out")


def test_a_read_only_disk_is_one_line(pristine, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    try:
        with small_disk(out, 100_000) as remount:
            shutil.copytree(pristine, out, dirs_exist_ok=True)
            remount("ro")
            done = run(out)
            assert not failed("read-only", done, out, (1, 2)) and done.code in (1, 2), (done.crash, done.err)
            assert not unwhole(out)
    except OSError as error:
        pytest.skip(f"needs root: {error}")


@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002], ids=oct)
def test_files_follow_the_umask(umask, tmp_path):
    before = os.umask(umask)
    try:
        assert run(tmp_path / "out").code == 0
    finally:
        os.umask(before)
    modes = {p.name: stat.S_IMODE(p.stat().st_mode) for p in (tmp_path / "out").rglob("*") if p.is_file()}
    assert not {name: oct(mode) for name, mode in modes.items() if mode != 0o666 & ~umask}


@pytest.mark.parametrize("junk", [b"", b"[]", b"5", b"{", b"\xff\x00", None], ids=repr)
def test_a_broken_result_of_an_experiment_is_measured_again(junk, tmp_path):
    """`stability` keeps its points in result.json."""
    from fluidbench.runs.execute import Hooks, execute
    from fluidbench.runs.experiment import Experiment
    from fluidbench.runs.store import Store

    notes: list[str] = []
    hooks = Hooks(*[lambda *_: None] * 3, notes.append)
    work, before = Experiment("copy:copy", "point", "mpm", {"x": 2}), Child.started
    assert execute([work], Store(tmp_path), hooks) == [{"x": 2}] and Child.started == before + 1
    path = next(tmp_path.rglob("result.json"))
    path.unlink()
    path.mkdir() if junk is None else path.write_bytes(junk)
    assert execute([work], Store(tmp_path), hooks) == [{"x": 2}] and Child.started == before + 2
    assert next(tmp_path.rglob("result.json")).is_file() and len(notes) == 1 and "result.json" in notes[0]
    assert execute([work], Store(tmp_path), hooks) == [{"x": 2}] and Child.started == before + 2


def test_only_the_broken_run_is_made_again(tmp_path):
    command = ["compare", "line_bead", *TINY, "--solvers", "mpm,pbd", "--out", str(tmp_path / "out")]
    assert fluidbench(command).code == 0
    next(tmp_path.rglob("runs/*-pbd-*/record.json")).write_bytes(b'{"verdict": "comp')
    before, again = Child.started, fluidbench(command)
    assert again.code == 0 and Child.started - before == 1, again.crash


@pytest.mark.parametrize("name", ["record.json", "final.npz"])
@pytest.mark.parametrize("junk", [b"", b"[]", b"\xff\x00\x01", b'{"verdict": "completed"}'], ids=repr)
def test_rendering_a_broken_run_says_which_file(name, junk, pristine, tmp_path):
    shutil.copytree(pristine, tmp_path / "out")
    path = next((tmp_path / "out").rglob(name))
    path.write_bytes(junk)
    done = fluidbench(["render", str(path.parent), "--no-turntable"])
    told_which = name in done.err or "no particles" in done.err  # a record that speaks of no particles is whole
    assert done.code == 2 and len(done.err.strip().splitlines()) == 1 and told_which, (done.crash, done.err)


@pytest.mark.slow
def test_a_process_of_its_own_mends_a_broken_run(pristine, tmp_path):
    shutil.copytree(pristine, tmp_path / "out")
    next((tmp_path / "out").rglob("record.json")).write_bytes(b'{"verdict": "comp')
    command = [sys.executable, "-m", "fluidbench", "run", "line_bead", *TINY, "--out", str(tmp_path / "out")]
    env = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(command, capture_output=True, text=True, env=env, check=False)
    assert done.returncode == 0 and not unwhole(tmp_path / "out"), done.stderr[-500:]


@pytest.mark.slow
def test_every_fault(pristine, tmp_path, capsys):
    """Every file broken in every way, alone and in pairs; every write failing; prints the count by class."""
    rng, found, counts = random.Random(SEED), [], Counter()

    def add(kind: str, wrong: list[str]) -> None:
        counts[kind, "cases"] += 1
        counts[kind, "violations"] += bool(wrong)
        found.extend(f"[{kind}] {text}" for text in wrong)
        shutil.rmtree(tmp_path / "out", ignore_errors=True)

    for fault in faults():
        add("broken files", broken(fault, pristine, tmp_path / "out", rng))
    for _ in range(30):
        one, two = (rng.choice([f for f in faults() if f.way not in ("full folder", "edited")]) for _ in range(2))
        if one.file != two.file:
            shutil.copytree(pristine, tmp_path / "both")
            one.apply(tmp_path / "both", rng)
            wrong = broken(two, tmp_path / "both", tmp_path / "out", rng)
            add("two broken files", [f"{one} and {text}" for text in wrong if "does not say" not in text])
            shutil.rmtree(tmp_path / "both")
    for fresh in (True, False):
        for first in range(1, writes(fresh, pristine, tmp_path / "out") + 1):
            add("failing writes", denied(first, CODES[first % len(CODES)], fresh, pristine, tmp_path / "out"))
    for size in SIZES:
        add("files that cannot grow", cut(size, tmp_path / "out"))
    for kilobytes in (8, 24, 64, 200, 1000, 5200):
        add("full disks", full_disk(kilobytes, tmp_path / "out"))
    kinds = dict.fromkeys(kind for kind, _ in counts)
    rows = [f"{kind:<30}{counts[kind, 'cases']:>8}{counts[kind, 'violations']:>12}" for kind in kinds]
    with capsys.disabled():
        print(
            "\n" + "\n".join([f"{'class (seed ' + str(SEED) + ')':<30}{'cases':>8}{'violations':>12}", *rows]),
            flush=True,
        )
    if path := os.environ.get("FUZZ_REPORT"):
        Path(path + ".faults").write_text("\n".join(found))
    assert not found, told(found)
