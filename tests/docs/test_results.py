"""The published table follows from the published records, by the published rules."""

import json
from pathlib import Path

import pytest

from fluidbench.errors import UserError
from fluidbench.paper import table2
from fluidbench.paper.archive import NAME, archives, keep, restore
from fluidbench.paper.definitions import OPEN
from fluidbench.paper.table1 import published
from fluidbench.study import guide

INDEX = f"{NAME}.json"
RESULTS = Path(__file__).parents[2] / "docs" / "results"


@pytest.fixture(scope="module")
def found():
    return published(RESULTS)


@pytest.mark.parametrize("name", ["table1.md", "table1.tex"])
def test_the_published_table_is_what_the_rules_make_of_the_records(found, name):
    assert (RESULTS / name).read_text() == found.report.files[name]


def test_no_more_than_three_statements_are_open(found):
    table = found.table
    assert len(set(table.study)) == len(list(RESULTS.glob(f"*/{INDEX}"))) >= 1
    assert (table.groupby(["row", "aspect", "method"]).verdict.agg(lambda v: OPEN in set(v)).sum()) <= 3


def test_records_say_where_and_by_what_they_were_made(found):
    for e in found.studies.values():
        records = [run.record for run in e.runs() if run.record.cost is not None]
        assert len(records) > 100
        assert all(r.machine["processor"] and r.machine["warp"] and r.code["sources"] for r in records)
        assert not any(run.folder.exists() for run in e.runs())  # no particles


def test_a_verdict_that_does_not_follow_is_seen(tmp_path):
    """Evidence that was changed is refused; evidence that was made anew with another figure gives another table."""
    place = next(path.parent for path in RESULTS.glob(f"*/{INDEX}"))
    for name in (INDEX, f"{NAME}.parquet"):
        (tmp_path / name).write_bytes((place / name).read_bytes())
    index = json.loads((tmp_path / INDEX).read_text())
    for trial in index["trials"]:
        if trial["finding"]:
            trial["finding"]["error"] = 0.0
    (tmp_path / INDEX).write_text(json.dumps(index))
    with pytest.raises(UserError, match="is not as it was written"):
        restore(tmp_path)
    e = restore(place)
    for trial in e.trials:
        if trial.finding is not None:
            object.__setattr__(trial.finding, "error", 0.0)
    keep(e, tmp_path)
    assert published(tmp_path).report.files["table1.md"] != published(place).report.files["table1.md"]


def test_the_published_guide_is_what_the_rules_make_of_the_records():
    made = guide.published(RESULTS)
    assert (RESULTS / "guide.md").read_text() == made.report.files["guide.md"]
    assert set(made.table.job) == set(guide.JOBS) and (RESULTS / "guide.png").read_bytes()[:4] == b"\x89PNG"
    assert not any(run.folder.exists() for run in made.runs)  # no particles


def test_the_published_timing_is_what_the_rules_make_of_the_records():
    made = table2.published(RESULTS)
    assert (RESULTS / "table2.md").read_text() == made.report.files["table2.md"]
    mpm = [row for row in made.rows if row.method == "mpm"]
    assert len(mpm) == 6 and all(len(row.bare) >= 3 for row in mpm)
    assert not made.missing
    assert not any(run.folder.exists() for run in made.runs)  # no particles


def test_what_holds_no_study_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"no evidence\.json, here or one folder down"):
        archives(tmp_path)
    (tmp_path / INDEX).write_text("{}")
    with pytest.raises(UserError, match="is not as it was written"):
        archives(tmp_path)
