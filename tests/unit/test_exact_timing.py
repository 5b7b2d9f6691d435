"""What the timing of the printed tower runs, and what it says of the paper's claims."""

import pytest

from fluidbench.errors import UserError
from fluidbench.method.target import Target
from fluidbench.paper import table2_report as page
from fluidbench.paper.rows import (
    ALL,
    VARIANTS,
    Printed,
    Row,
    check_pools,
    claims,
    printed,
    rows_of,
    spread,
    variants_of,
)
from fluidbench.paper.table2 import NAME, keep, published, table2
from fluidbench.paper.verdicts import CONFIRMED, OPEN, REFUTED
from fluidbench.scenario.library import load

from .made import change, finished, working

TAICHI = Target(backend="taichi")


def row(variant, bare, filmed=(), pool=None):
    return Row(
        variant,
        pool,
        "mpm",
        [finished(steps_per_s=s, wall_per_simulated_s=s / 100) for s in bare],
        [finished(steps_per_s=s, wall_per_simulated_s=s / 100) for s in filmed],
        "CPU",
    )


def said(rows):
    return {claim: (measured, verdict) for _, claim, measured, verdict in claims(rows)}


ORDER, MODEST = "both with the drone the most", "curing a modest overhead, expansion a stronger one"
RENDER, POOL = "rendering the bottleneck", "cost insensitive to the pool's size"


@pytest.mark.parametrize(
    ("curing", "expansion", "verdict"),
    [
        (166.0, 204.0, CONFIRMED),
        (166.0, 199.0, REFUTED),
        (200.0, 900.0, REFUTED),
        (199.0, 900.0, CONFIRMED),
        (150.0, 179.0, REFUTED),
    ],
)
def test_curing_costs_less_than_twice_and_expansion_a_fifth_more(curing, expansion, verdict):
    """By seconds a simulated second, whatever the steps a second."""
    rows = [row("plain", [90.0, 110.0]), row("curing", [curing, curing]), row("expansion", [expansion] * 2)]
    assert said(rows)[MODEST] == (
        f"{curing / 100:.2f} times the cost with curing, {expansion / 100:.2f} times with expansion",
        verdict,
    )
    assert MODEST not in said(rows[:2]) and ORDER not in said(rows)


def test_the_drone_costs_the_most_and_pictures_halve():
    names = ["plain", "curing", "expansion", "expansion + curing", ALL]
    rows = [row(n, [s, s]) for n, s in zip(names, (50.0, 60.0, 70.0, 80.0, 90.0), strict=True)]
    text = (
        "s a simulated s: plain 0.5, curing 0.6, expansion 0.7, expansion + curing 0.8, expansion + curing + drone 0.9"
    )
    assert said(rows)[ORDER] == (text, CONFIRMED)
    assert said([row("plain", [95.0, 95.0]), *rows[1:]])[ORDER][1] == REFUTED
    assert said([*rows[:4], row(ALL, [80.0, 100.0])])[ORDER] == (f"{text}: within the spread", OPEN)
    assert said([row("plain", [80.0, 110.0]), *rows[1:]])[ORDER][1] == OPEN  # dearer, but by no more than its spread
    assert RENDER not in said(rows)
    for share, verdict in ((0.49, CONFIRMED), (0.5, REFUTED), (0.9, REFUTED)):
        filmed = [*rows[:4], row(ALL, [100.0, 100.0], [100 / share] * 2)]
        assert said(filmed)[RENDER] == (f"with pictures {share:.0%} of the speed without", verdict)
    assert RENDER not in said([row(ALL, [100.0] * 2, [50.0])]) and RENDER not in said([row(ALL, [100.0], [50.0] * 2)])


@pytest.mark.parametrize(
    ("large", "verdict"), [(119.0, CONFIRMED), (120.0, REFUTED), (84.0, CONFIRMED), (83.0, REFUTED)]
)
def test_a_pool_matters_from_a_fifth_on(large, verdict):
    rows = [
        row("plain", [100.0] * 2, pool=1000),
        row("plain", [7.0] * 2, pool=2000),
        row("plain", [large] * 2, pool=9000),
    ]
    assert said(rows)[POOL] == (f"{large / 100:.2f} times the cost in the large pool", verdict)


def test_a_pools_size_needs_two_pools_and_two_repeats():
    assert POOL not in said([row("plain", [1.0, 1.0])])
    for a, b in (([1.0], [1.0, 1.0]), ([1.0, 1.0], [1.0])):
        assert said([row("plain", a, pool=1), row("plain", b, pool=2)])[POOL][1] == OPEN
    assert said([row("curing", [1.0, 1.0], pool=1), row("curing", [1.0, 1.0], pool=2)])[POOL][1] == OPEN


def test_claims_are_of_the_last_pool():
    rows = [
        row(n, [s] * 2, pool=p)
        for p, last in ((1, 10.0), (2, 60.0))
        for n, s in (("plain", 100.0), ("curing", 90.0), ("expansion", last))
    ]
    assert said(rows)[MODEST][0].endswith("0.60 times with expansion")


def test_rows_of_the_tower_are_run_bare_and_filmed(tmp_path, monkeypatch):
    calls = working(monkeypatch)
    more = {"quick": True, "out": tmp_path, "wall_limit": 9.0, "progress": False}
    made = table2(["mpm"], pools=[None], repeats=3, **more)
    rows = made.rows
    assert len(rows) == 5 and {r.method for r in rows} == {"mpm"} and {r.pool for r in rows} == {None}
    (call,) = calls
    assert len(call) == 30 and call.workers == 1 and {j.wall_limit for j in call} == {9.0}
    assert [j.repeat for j in call] == [0, 1, 2] * 10
    assert [j.film_every for j in call[::3]] == [None, 0.033] * 5
    assert [j.variant for j in call[::3]] == ["", "pictures"] * 5  # a filmed run is another run
    names = [j.scenario["name"] for j in call[::3]]
    assert (
        names[::2]
        == names[1::2]
        == [
            "ring_tower",
            "ring_tower_curing",
            "ring_tower_expansion",
            "ring_tower_expansion_curing",
            "ring_tower_drone",
        ]
    )
    assert [len(r.bare) for r in rows] == [len(r.filmed) for r in rows] == [3] * 5
    assert made.runs == [run for r in rows for run in (*r.bare, *r.filmed)] and (made.ok, made.missing) == (True, [])
    assert call[0].scenario == load("ring_tower", quick=True).model_dump(mode="json")
    sized = table2(["mpm", "sph"], pools=[None, 400_000], repeats=1, **more).rows
    assert [(r.variant, r.pool) for r in sized] == 2 * [("plain", None), *((v, 400_000) for v in VARIANTS)]
    assert [r.method for r in sized] == ["mpm"] * 6 + ["sph"] * 6
    assert calls[-1][-1].scenario["pool"] == 400_000 and calls[-1][-1].method == "sph"


def test_each_row_gets_the_runs_that_it_asked_for(tmp_path, monkeypatch):
    """Of several pools and repeats: bare ones without pictures, and all of its own variant and repeat."""
    working(
        monkeypatch,
        lambda job: finished(job.method, scenario=job.scenario["name"], repeat=job.repeat, film_every=job.film_every),
    )
    rows = table2(["mpm"], pools=[None, 400_000], repeats=2, quick=True, out=tmp_path, progress=False).rows
    for r in rows:
        for runs, every in ((r.bare, None), (r.filmed, 0.033)):
            seen = [(run.record.scenario, run.record.repeat, run.record.film_every) for run in runs]
            assert seen == [(VARIANTS[r.variant], 0, every), (VARIANTS[r.variant], 1, every)]


def test_speeds_of_a_row_and_their_spread():
    made = row("plain", [90.0, 110.0], [40.0])
    assert made.speed() == [90.0, 110.0] and made.speed(True) == [40.0] and made.pace() == [0.9, 1.1]
    assert made.pace(filmed=True) == [0.4]
    assert spread([23_310.2, 23_431.0]) == "23,371 ± 85" and spread([0.0428, 0.0432]) == "0.04300 ± 0.00028"
    assert spread(made.speed()) == "100.0 ± 14.1" and spread([1.23456]) == "1.235" and spread([]) == "-"
    lacks = Row("plain", None, "mpm", [finished(verdict="error")], [finished("sph", "timeout")])
    assert lacks.speed() == [] and len(lacks.missing()) == 2


def test_a_pool_that_a_variant_overfills_is_refused():
    check_pools([None], True)
    with pytest.raises(UserError, match="pool = 1000 is too small"):
        check_pools([None, 1000], True)


def test_the_papers_figures_stand_beside_ours():
    assert printed("plain", None) == Printed(17_000, (11.7, 0.2), (15.7, 0.1))
    assert printed("plain", 298_000) == Printed(298_000, (11.9, 0.1), (34.2, 0.1))
    assert printed(ALL, 400_000) == Printed(298_000, (16.7, 0.1), (59.3, 0.2))
    assert {printed(v, None).particles for v in VARIANTS if v != "plain"} == {298_000}
    (shown,) = page._timing([row("curing", [90.0, 110.0], [40.0])]).rows
    assert shown == [
        "curing",
        "mpm",
        "as needed",
        "1.000 ± 0.141",
        "12.6 ± 0.2",
        "0.4000",
        "34.2 ± 0.3",
        "10",
        "0.1",
        "100.0 ± 14.1",
    ]


def test_some_variants_are_run_in_the_papers_order_and_no_others():
    assert variants_of(None) == list(VARIANTS)
    assert variants_of(["expansion + curing", "plain"]) == ["plain", "expansion + curing"]
    rows = rows_of(["sph"], (None, 298_000), variants_of(["curing", "plain"]))
    assert [(r.variant, r.pool) for r in rows] == [("plain", None), ("plain", 298_000), ("curing", 298_000)]
    with pytest.raises(UserError, match="variants: no 'expansoin'; did you mean 'expansion'"):
        variants_of(["expansoin"])


def test_methods_on_one_machine_may_be_timed_in_studies_of_their_own(tmp_path):
    other = row("plain", [9.0, 11.0], [4.0, 4.1])
    made = [row("plain", [90.0, 110.0], [40.0, 41.0]), other]
    other.method = "sph"
    for i, run in enumerate(run for r in made for run in (*r.bare, *r.filmed)):
        object.__setattr__(run, "folder", tmp_path / "runs" / str(i))
    keep(made[:1], tmp_path / "one")
    keep(made[1:], tmp_path / "other")
    assert [r.method for r in published(tmp_path, tmp_path / "out").rows] == ["mpm", "sph"]


def test_a_timing_is_told_again_from_what_it_keeps(tmp_path):
    made = [row("plain", [90.0, 110.0], [40.0, 41.0]), row("curing", [50.0, 51.0], [9.0, 9.5], pool=298_000)]
    for i, run in enumerate(run for r in made for run in (*r.bare, *r.filmed)):
        object.__setattr__(run, "folder", tmp_path / "runs" / str(i))
    keep(made, tmp_path / "cpu")
    again = published(tmp_path, tmp_path / "out")
    assert again.report.files["table2.md"] == page.report(made, tmp_path).files["table2.md"]
    assert again.ok and [r.speed() for r in again.rows] == [r.speed() for r in made] and again.save().exists()
    keep(made, tmp_path / "other")
    with pytest.raises(UserError, match="a second study of mpm on CPU"):
        published(tmp_path)
    for run in made[0].bare:
        change(run, machine={"device": "GPU"}, input={"duration": 9.0})
    keep(made[:1], tmp_path / "other")
    with pytest.raises(UserError, match="its towers are not those of the other studies"):
        published(tmp_path)
    made[1].variant = "of another edition"
    keep(made, tmp_path / "other")
    with pytest.raises(UserError, match="of another edition"):
        published(tmp_path)
    (tmp_path / "cpu" / f"{NAME}.json").write_text("{}")
    with pytest.raises(UserError, match="is not as it was written"):
        published(tmp_path)
