"""Cells of the judged table on hand-made evidence: what was measured, as it is written, and the verdict."""

import pytest

from fluidbench.paper import judged as module
from fluidbench.paper.definitions import CONFIRMED, METHODS, OPEN, REFUTED
from fluidbench.paper.evidence import SHIPPED
from fluidbench.paper.judged import best_for, bound_dt, cells, cost, equal_cost, fidelity, limits, stability
from solvers.lattice import stiffest_drag

from .made import BEAD, case, evidence, finished, known, repeated, trial

SOFT = ("viscous", "yield stress", "elastic", "viscoelastic")


@pytest.mark.parametrize(
    ("method", "physics", "good", "bad", "verdict"),
    [
        ("mpm", "elastic", 3, 1, CONFIRMED),
        ("mpm", "elastic", 2, 1, REFUTED),
        ("mpm", "elastic", 1, 0, OPEN),
        ("mpm", "elastic", 2, 0, CONFIRMED),
        ("sph", "liquid", 3, 1, CONFIRMED),
        ("sph", "liquid", 5, 2, REFUTED),
        ("pbd", "liquid", 1, 1, CONFIRMED),
        ("pbd", "liquid", 2, 1, REFUTED),
        ("pbd", "liquid", 0, 1, OPEN),
        ("pbd", "viscous", 0, 2, CONFIRMED),
    ],
)
def test_fidelity_is_the_share_of_known_answers(method, physics, good, bad, verdict):
    cells = fidelity(evidence(known(method, good, bad, physics)))
    kind = "liquids" if physics == "liquid" else "deformables and viscous"
    assert len(cells) == 4  # what the paper says nothing of is no cell
    for cell in cells:
        here = (cell.method, cell.aspect) == (method, kind)
        assert cell.verdict == (verdict if here else OPEN)
        own = f"{good} of {good + bad}" if here else "0 of 0"
        assert cell.measured == f"{own} known answers within tolerance" and len(cell.runs) == (good + bad) * here


def test_beside_fidelity_stands_the_error_at_equal_cost():
    """At the 1 s that both were run at, 0.3 and 0.3 x 2."""
    rows = [
        trial(case("dam_break"), m, f * e, wall=w, spacing=0.01 / w)
        for m, f in (("mpm", 1.0), ("sph", 2.0))
        for e, w in ((0.3, 1.0), (0.1, 9.0))
    ]
    assert equal_cost(rows, "sph", ["liquid"]) == "dam_break x 2 (0.6)"
    assert equal_cost(rows, "sph", ["elastic"]) == "" == equal_cost(rows, "pbd", ["liquid"])
    cell = next(c for c in fidelity(evidence(rows)) if (c.method, c.aspect) == ("sph", "liquids"))
    assert cell.measured.endswith("error over the best at equal cost: dam_break x 2 (0.6)")


def test_fidelity_takes_all_four_classes_of_what_deforms_and_says_what_is_shipped_or_lost():
    rows = [t for physics in SOFT for t in known("mpm", 1, 0, physics)]
    rows[0].note = rows[1].note = SHIPPED
    cell = fidelity(evidence(rows))[0]
    assert (cell.method, cell.verdict, cell.paper) == ("mpm", CONFIRMED, "high")
    assert cell.measured == f"4 of 4 known answers within tolerance (2 {SHIPPED})"
    lost = fidelity(evidence([*rows, trial(case("x", "elastic"), "mpm", verdict="timeout")]))[0]
    assert lost.verdict == OPEN and lost.measured.endswith(f"(2 {SHIPPED}); 1 could not be run")
    assert len(lost.runs) == 5


def limit(method, *steps, verdict="held", found=True):
    """Rows of `stability`: at half a spacing and one, dt is so many times d / c."""
    return [
        {
            "method": method,
            "axis": "spacing",
            "value": v,
            "verdict": verdict,
            "lump_limit_found": found,
            "dt_lump_s": step * v * BEAD.spacing / BEAD.wave_speed,
        }
        for v, step in zip((0.5, 1.0), steps, strict=False)
    ]


def test_stable_steps_are_compared_over_d_by_c():
    rows = {"mpm": limit("mpm", 0.5, 0.5), "sph": limit("sph", 0.2, 0.2), "pbd": limit("pbd", 2.0, 2.0, found=False)}
    cells = stability(evidence(limits=rows))
    assert [(c.method, c.paper, c.verdict) for c in cells] == [
        ("mpm", "medium, medium dt", CONFIRMED),
        ("sph", "low, smaller dt", CONFIRMED),
        ("pbd", "high, larger dt", CONFIRMED),
    ]
    assert cells[0].measured == "largest stable dt 0.50 and 0.50 d/c; mean default dt 0.0001 s"
    assert cells[2].measured == "largest stable dt >= 2.00 and 2.00 d/c; mean default dt 0.0001 s"
    assert all(len(c.runs) == 2 for c in cells)
    turned = stability(evidence(limits=rows | {"sph": limit("sph", 0.9, 0.9)}))
    assert [c.verdict for c in turned] == [REFUTED, REFUTED, CONFIRMED]


def test_stable_steps_that_were_not_found_place_nobody():
    rows = {"mpm": limit("mpm", 0.5, 0.5), "sph": limit("sph", 0.2, 0.2), "pbd": limit("pbd", 2.0, 2.0)}
    failed = [limit("pbd", 2.0)[0], limit("pbd", 2.0, verdict="failed")[0]]
    for broken in (rows | {"pbd": failed}, rows | {"pbd": limit("pbd", 2.0)}, {}):
        cells = stability(evidence(limits=broken))
        assert {c.verdict for c in cells} == {OPEN}
    assert cells[0].measured.startswith("largest stable dt not found")
    silent = stability(evidence(limits=rows, repeats={m: [finished(m, "error")] for m in METHODS}))
    assert silent[0].measured == "largest stable dt 0.50 and 0.50 d/c"
    capped = rows | {"sph": limit("sph", 3.0, 3.0)}  # PBD's may lie above or below that
    assert {c.verdict for c in stability(evidence(limits=capped | {"pbd": limit("pbd", 2.0, 2.0, found=False)}))} == {
        OPEN
    }
    untold = {m: [{k: v for k, v in r.items() if k != "lump_limit_found"} for r in rs] for m, rs in rows.items()}
    assert not any(">=" in c.measured for c in stability(evidence(limits=untold)))
    extra = stability(evidence(limits=rows | {"pbd": [*rows["pbd"], failed[1]]}))
    assert {c.verdict for c in extra} == {OPEN}


def test_cost_at_equal_spacing_and_at_equal_error():
    cells = cost(evidence(repeats=repeated(mpm=4.0, sph=8.0, pbd=2.0)))
    spacing, error = cells[:3], cells[3:]
    assert [(c.method, c.paper, c.verdict, c.measured) for c in spacing] == [
        ("mpm", "mid-high", CONFIRMED, "4 ± 0 s for a simulated second"),
        ("sph", "high", CONFIRMED, "8 ± 0 s for a simulated second"),
        ("pbd", "low", CONFIRMED, "2 ± 0 s for a simulated second"),
    ]
    assert {(c.row, c.aspect) for c in spacing} == {("cost", "at equal spacing")} and {
        len(c.runs) for c in spacing
    } == {2}
    assert [c.verdict for c in cost(evidence(repeats=repeated(mpm=9.0, sph=8.0, pbd=8.0)))[:3]] == [REFUTED] * 3
    assert [c.verdict for c in cost(evidence(repeats=repeated(1, mpm=4.0, sph=8.0, pbd=2.0)))[:3]] == [OPEN] * 3
    two = repeated(mpm=4.0, sph=8.0) | {"pbd": [finished("pbd", "error")]}
    assert [(c.method, c.verdict) for c in cost(evidence(repeats=two))[:3]] == [(m, OPEN) for m in METHODS]
    assert [(c.aspect, c.verdict) for c in error] == [("at equal error", OPEN)] * 3
    assert error[0].measured == "no case that all three can run at several spacings"
    wide = {"mpm": [finished(cpu_s=w) for w in (3.0, 5.0)]}
    assert cost(evidence(repeats=wide))[0].measured == "4 ± 1 s for a simulated second"
    rows = [
        trial(case(name), m, e, wall=f * w, spacing=0.01 * w)
        for name in ("dam_break", "bead_area")
        for m, f in (("mpm", 2.0), ("sph", 3.0), ("pbd", 1.0))
        for e, w in ((0.4, 1.0), (0.1, 9.0))
    ]
    cells = cost(evidence([*rows, trial(case("other"), "mpm")]))[3:]
    assert [c.verdict for c in cells] == [CONFIRMED] * 3 and {len(c.runs) for c in cells} == {4}
    assert cells[0].measured == "over the cheapest: dam_break: x 2, bead_area: x 2"


def test_what_a_method_is_best_for_is_what_it_wins():
    def wins(method, n, physics):
        return [trial(case(f"{physics}{method}{i}", physics), method) for i in range(n)]

    def cells(*groups):
        return {c.method: c for c in best_for(evidence([t for g in groups for t in g]))}

    soft = cells(wins("mpm", 2, "viscoelastic"), wins("sph", 1, "yield stress"), wins("pbd", 9, "elastic"))
    assert soft["mpm"].verdict == CONFIRMED and soft["mpm"].measured == "cheapest within tolerance on: mpm 2, sph 1"
    assert soft["mpm"].brief == "cheapest on 2 of 3" and soft["mpm"].sensitivity.startswith("refuted without")
    assert len(soft["mpm"].runs) == 3 and soft["sph"].measured.endswith("on: no case") and soft["sph"].verdict == OPEN
    assert cells(wins("mpm", 1, "viscoelastic"), wins("sph", 1, "yield stress"))["mpm"].verdict == REFUTED
    assert cells(wins("mpm", 1, "yield stress"))["mpm"].verdict == OPEN
    assert cells(wins("pbd", 2, "yield stress"))["mpm"].verdict == REFUTED
    liquid = cells(wins("sph", 1, "liquid"), wins("mpm", 2, "liquid"))["sph"]
    assert liquid.verdict == REFUTED and liquid.measured.endswith("on: mpm 2, sph 1")


def test_a_preview_is_as_many_particles_as_keep_pace():
    """Time as the square of particles: a second at 1000 takes 0.25, 1 and 0.04 s, so 2000, 1000 and 5000 keep pace."""

    def runs(m, at_1000):
        return [finished(m, peak_particles=n, cpu_s=at_1000 * (n / 1000) ** 2) for n in (1000, 500, 250, 125)]

    def cell(**paces):
        made = {m: runs(m, p) for m, p in paces.items()}
        parts = {"repeats": slice(0, 1), "second": slice(1, 2), "previews": slice(2, 4)}
        return best_for(evidence(**{name: {m: r[part] for m, r in made.items()} for name, part in parts.items()}))[-1]

    found = cell(mpm=0.25, sph=1.0, pbd=0.04)
    assert (found.method, found.paper, found.verdict) == ("pbd", "real-time previews", CONFIRMED)
    assert found.brief == "particles in real time: mpm 2e+03, sph 1e+03, pbd 5e+03" and len(found.runs) == 12
    assert cell(mpm=0.25, sph=1.0, pbd=0.2).verdict == REFUTED
    assert cell(mpm=0.25, pbd=0.04).verdict == OPEN


def test_memory_is_compared_by_particle_and_told_by_volume():
    """400 bytes in (1.5 mm)^3 are 118.5 GB a cubic metre."""
    cell = limits(evidence(repeats=repeated(mpm=4.0, sph=2.0, pbd=1.0)))[0]
    assert (cell.aspect, cell.method, cell.verdict, len(cell.runs)) == ("memory", "mpm", CONFIRMED, 6)
    assert cell.measured == "mpm 400 B (119 GB/m^3), sph 200 B (59.3 GB/m^3), pbd 100 B (29.6 GB/m^3)"
    assert limits(evidence(repeats=repeated(mpm=2.0, sph=2.0, pbd=1.0)))[0].verdict == REFUTED
    assert limits(evidence(repeats=repeated(mpm=4.0, sph=2.0)))[0].verdict == OPEN


def test_a_step_collapses_when_it_shrinks_tenfold(monkeypatch):
    seen = []

    def steps(scenario, method, settings):
        seen.append((method, *settings.items()))
        if settings.get("numerics.sph.viscosity") == "implicit":
            return 20.0
        return {1e-3: 20.0, 1e3: 2.0, 0.0: 19.98, 1e4: 2.0}[next(iter(settings.values()))]

    monkeypatch.setattr(module, "bound_dt", steps)
    cells = {c.aspect: c for c in limits(evidence())}
    assert cells["explicit viscosity"].verdict == CONFIRMED
    assert cells["implicit viscosity"].verdict == cells["yield stress"].verdict == REFUTED
    assert cells["explicit viscosity"].measured == "dt 20 s at 0.001 Pa s, 2 s at 1000: 10-fold"
    assert cells["yield stress"].measured == "dt 20 s at 0 Pa, 2 s at 10000: 9.99-fold"
    assert [c.paper for c in cells.values() if c.rule == "collapse"] == ["high viscosity"] * 2 + ["non-Newtonian"]
    assert seen == [
        *(
            ("sph", ("material.viscosity", value), ("numerics.sph.viscosity", scheme))
            for scheme in ("explicit", "implicit")
            for value in (1e-3, 1e3)
        ),
        ("sph", ("material.yield_stress", 0.0)),
        ("sph", ("material.yield_stress", 1e4)),
    ]


def test_a_bound_is_the_least_of_the_varied_scenario():
    """A thousand Pa s in paste of 6 kPa: the viscous limit of SPH, with nu = 1 m^2/s and a little of its own."""
    h, c = 1.3 * BEAD.spacing, BEAD.wave_speed
    wanted = 0.09 * h**2 / (1.3**2 * stiffest_drag(2.6, 0.25) / 18.0 + 1.0 * h * c / 10.0)
    thick = {"material.viscosity": 1e3, "numerics.sph.viscosity": "explicit"}
    assert bound_dt(BEAD, "sph", thick) == pytest.approx(wanted)
    assert bound_dt(BEAD, "sph", thick | {"numerics.sph.viscous_number": 0.045}) == pytest.approx(wanted / 2)


def test_the_table_has_every_cell_and_says_nothing_where_nothing_ran():
    rows = known("mpm", 4, 0, "elastic")
    found = cells(evidence(rows, repeats=repeated(mpm=4.0, sph=8.0, pbd=2.0)))
    assert list(dict.fromkeys(c.row for c in found)) == [
        "fidelity",
        "stability and dt",
        "cost",
        "best for",
        "limits",
        "claims",
    ]
    assert len({c.place for c in found}) == len(found) == 30
    assert CONFIRMED in {c.verdict for c in found}
    for t in rows:
        t.runs, t.note = {}, SHIPPED
    dead = evidence(rows, repeats={m: [finished(m, "error")] for m in METHODS})
    assert {c.verdict for c in cells(dead)} == {OPEN}
    half = evidence(rows, repeats={m: [finished(m, "error"), finished(m)] for m in METHODS})
    assert CONFIRMED in {c.verdict for c in cells(half)}
    blown = evidence(rows, repeats={m: [finished(m, "diverged")] for m in METHODS})
    assert CONFIRMED in {c.verdict for c in cells(blown)}


def test_a_class_is_won_by_most_of_its_cases_not_of_those_that_anybody_answers():
    won = [trial(case(f"w{i}", "liquid"), "sph") for i in range(2)]
    lost = [trial(case(f"l{i}", "liquid"), "sph", 0.9, verdict="MISS") for i in range(3)]
    found = best_for(evidence([*won, *lost]))[1]
    assert (found.verdict, found.brief) == (REFUTED, "cheapest on 2 of 5")
    crashed = trial(case("c", "liquid"), "mpm", verdict="timeout")
    assert best_for(evidence([*won, crashed]))[1].verdict == OPEN
