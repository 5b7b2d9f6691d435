"""Hostile input is refused in one line, with exit code 2, before anything is written; what is right is taken."""

import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from . import hostile, options
from .harness import REFUSED, SEED, Case, attempt, nothing_runs, told

ROOT = Path(__file__).parents[2]
SHORT = hostile.cases(SEED, short=True)


@pytest.fixture(scope="module", autouse=True)
def _stubbed():
    with nothing_runs():
        yield


def tried(cases: list[Case], base: Path) -> tuple[Counter, list[str]]:
    """(counts of what became of the cases, violations with their command lines)."""
    counts, found = Counter(), []
    for i, case in enumerate(cases):
        done, wrong = attempt(case, base / str(i))
        counts["accepted" if done.accepted else "refused"] += 1
        counts["violations"] += bool(wrong)
        found += [f"{case}\n      {'; '.join(wrong)}"] if wrong else []
    return counts, found


@pytest.mark.parametrize("sort", SHORT)
def test_hostile_input_is_one_line(sort, tmp_path):
    _, found = tried(SHORT[sort], tmp_path)
    assert not found, told(found)


def test_the_short_fuzz_has_its_cases():
    """With the faults of test_faults, 150 in the default suite."""
    assert sum(map(len, SHORT.values())) >= 130 and len(SHORT) >= 15


@pytest.mark.slow
def test_a_thousand_hostile_inputs(tmp_path, capsys):
    """All classes at length; prints the count by class. FUZZ_SEED draws others."""
    every, total, wrong = hostile.cases(SEED, short=False), Counter(), []
    rows = [f"{'class (seed ' + str(SEED) + ')':<30}{'cases':>8}{'refused':>9}{'accepted':>10}{'violations':>12}"]
    for sort, cases in every.items():
        counts, found = tried(cases, tmp_path / "sort")
        total += counts + Counter(cases=len(cases))
        wrong += found
        values = (len(cases), counts["refused"], counts["accepted"], counts["violations"])
        rows.append(f"{sort:<30}{values[0]:>8}{values[1]:>9}{values[2]:>10}{values[3]:>12}")
    rows.append(f"{'all':<30}{total['cases']:>8}{total['refused']:>9}{total['accepted']:>10}{total['violations']:>12}")
    with capsys.disabled():
        print("\n" + "\n".join(rows), flush=True)
    if path := os.environ.get("FUZZ_REPORT"):
        Path(path).write_text("\n".join([*rows, "", *wrong]))
    assert total["cases"] >= 1000
    assert not wrong, told(wrong)


def test_every_option_of_every_verb_is_under_fuzz():
    """A new option belongs into options.HAS, with hostile values."""
    import typer

    from fluidbench.cli import app

    group: object = typer.main.get_command(app)
    known = {(verb, option) for option, has in options.HAS.items() for verb in has}
    there = set()
    verbs = {name: made for name, made in vars(group)["commands"].items() if name != "engines"}  # see ENGINES
    for verb, made in verbs.items():
        for parameter in made.params:
            if parameter.opts[0].startswith("--") and not parameter.is_flag:
                there.add((verb, parameter.opts[0]))
    assert there == known and set(verbs) == set(options.BARE)


ENGINES = ("", " ", ".", "..", "../splishsplash", "/tmp", "splishsplash/..", "SPLISHSPLASH", "a" * 300, "x\ny", "-")


@pytest.mark.parametrize("verb", ["add", "remove"])
@pytest.mark.parametrize("name", ENGINES)
def test_what_is_no_engine_is_refused_before_anything_is_made(verb, name, tmp_path, monkeypatch):
    monkeypatch.setenv("FLUIDBENCH_DATA", str(tmp_path / "data"))
    done, _ = attempt(Case("engines", ("engines", verb, name)), tmp_path / "here")
    assert done.code == 2 and len(done.err.strip().splitlines()) == 1 and not (tmp_path / "data").exists()


TRUTH = [
    Case("truth", words)
    for words in (
        ("show", "line_bead", "--set", "material.density=-3"),
        ("compare", "no_such_scenario"),
        ("table2", "--pools", "298k"),
    )
] + [Case("truth", ("show", "line_bead"), "accepted")]


@pytest.mark.parametrize("case", TRUTH, ids=lambda c: c.arguments[-1])
def test_the_helper_tells_the_truth(case, tmp_path):
    """A process of its own ends with the same code and the same words."""
    env = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "80"}
    real = subprocess.run(
        [sys.executable, "-m", "fluidbench", *case.arguments],
        capture_output=True,
        text=True,
        env=env,
        cwd=tmp_path,
        check=False,
    )
    done, _ = attempt(case, tmp_path / "here")
    assert real.returncode == (2 if case.expect == REFUSED else 0) == done.code
    assert real.stderr.split() == done.err.split()
