"""Ablation by hand: what can be left out, what each change moves and saves, and the leanest mix."""

import math

import pytest

from fluidbench.errors import UserError
from fluidbench.study import ablate_report as page
from fluidbench.study import ablation as module
from fluidbench.study.ablate import ablate
from fluidbench.study.ablation import Ablation, Change, Effect, ablation, changes, command, economies, effect, features

from ..conftest import scenario
from .made import BEAD, change, finished, working, workplace_in

PASTE = {"density": 1.0, "youngs_modulus": 100.0, "yield_stress": 1.0, "plastic_viscosity": 0.5}
CURE = {"youngs_modulus": 200.0, "delay": 1.0}
WALLS = {"lower": [0, 0, 0], "upper": [0.2] * 3}


def settings(found):
    return {c.name: c.settings for c in found}


def test_features_of_a_paste_can_be_left_out():
    found = settings(features(scenario(material={**PASTE, "viscosity": 0.25})))
    assert found == {
        "no elasticity, no yield: a Newtonian liquid": {
            "material.youngs_modulus": None,
            "material.yield_stress": None,
            "material.plastic_viscosity": None,
            "material.relaxation_time": None,
            "material.viscosity": 0.5,
        },
        "no yield stress": {"material.yield_stress": 0.0},
        "no plastic viscosity": {"material.plastic_viscosity": 0.0},
        "no viscosity": {"material.viscosity": 0.0},
        "slip floor": {"domain.walls.z_lower": "slip"},
    }
    thick = settings(features(scenario(material={**PASTE, "viscosity": 0.75})))
    assert thick["no elasticity, no yield: a Newtonian liquid"]["material.viscosity"] == 0.75


def test_features_are_those_that_are_there():
    assert settings(features(scenario())) == {"slip floor": {"domain.walls.z_lower": "slip"}}
    solid = scenario(material={"density": 1.0, "youngs_modulus": 100.0}, domain={**WALLS, "walls": {"z_lower": "slip"}})
    assert features(solid) == []
    maxwell = scenario(material={"density": 1.0, "youngs_modulus": 100.0, "yield_stress": 0.0})
    assert "no yield stress" not in settings(features(maxwell))
    rough = scenario(domain={**WALLS, "walls": {"z_lower": {"friction": 0.5}, "x_upper": {"friction": 0.1}}})
    assert settings(features(rough)) == {
        "no friction": {"domain.walls.z_lower": "slip", "domain.walls.x_upper": "slip"}
    }
    processed = scenario(material={**PASTE, "cure": CURE, "expansion": {"ratio": 2.0}})
    found = settings(features(processed))
    assert found["no curing"] == {"material.cure": None} and found["no expansion"] == {"material.expansion": None}
    assert "no collider" not in found


def test_economies_of_every_method():
    found = [(c.name, c.settings, c.method) for c in economies(BEAD, ["mpm", "sph", "pbd"])]
    assert found == [
        ("coarser spacing", {"spacing": pytest.approx(1.25 * 1.5e-3)}, None),
        ("softer elasticity", {"material.youngs_modulus": 1500.0}, None),
        ("coarser grid", {"numerics.mpm.grid_ratio": 1.995}, "mpm"),
        ("larger dt", {"numerics.mpm.safety": 1.0}, "mpm"),
        ("no shifting", {"numerics.mpm.shifting": 0.0, "numerics.mpm.separation": 0.0}, "mpm"),
        ("fewer neighbours", {"numerics.sph.smoothing_ratio_solid": 1.2}, "sph"),
        ("larger dt", {"numerics.sph.cfl": 0.8, "numerics.sph.viscous_number": 0.1}, "sph"),
        ("no shifting", {"numerics.sph.shifting": 0.0}, "sph"),
        ("fewer iterations", {"numerics.pbd.iterations": 1}, "pbd"),
        ("larger dt", {"numerics.pbd.advance": 0.25}, "pbd"),
        ("fewer neighbours", {"numerics.pbd.support_ratio": 2.0}, "pbd"),
    ]


def test_economies_follow_the_settings_and_the_material():
    numerics = {
        "mpm": {"grid_ratio": 3.5},
        "sph": {"smoothing_ratio": 2.0, "cfl": 0.3},
        "pbd": {"iterations": 1, "advance": 0.75},
    }
    found = {
        (c.name, c.method): c.settings
        for c in economies(
            scenario(material={"density": 1.0, "viscosity": 0.1}, numerics=numerics), ["mpm", "sph", "pbd"]
        )
    }
    assert found["slower sound", None] == {"sound_speed_ratio": 5.0}
    assert found["coarser grid", "mpm"] == {"numerics.mpm.grid_ratio": 4.0}
    assert found["fewer neighbours", "sph"] == {"numerics.sph.smoothing_ratio": 1.6}
    assert found["larger dt", "sph"]["numerics.sph.cfl"] == 0.6
    assert found["fewer iterations", "pbd"] == {"numerics.pbd.iterations": 1}
    assert found["larger dt", "pbd"] == {"numerics.pbd.advance": 1.0}
    stiff = scenario(material={"density": 1.0, "sound_speed": 3.0})
    assert list(settings(economies(stiff, []))) == ["coarser spacing"]
    fixed = scenario(material={"density": 1.0, "bulk_modulus": 3.0})
    assert list(settings(economies(fixed, []))) == ["coarser spacing"]
    assert len(changes(BEAD, ["mpm"])) == len(features(BEAD)) + 5


def test_an_effect_is_the_largest_shift_and_the_share_of_time():
    base = finished(measures={"bead_width_m": 0.010, "height_m": 0.005, "slump": 0.0}, cpu_s=8.0, wall_s=2.0)
    run = finished(measures={"bead_width_m": 0.009, "height_m": 0.006, "slump": 3.0}, cpu_s=6.0, wall_s=1.9)
    seen = effect(Change("x", {}), "mpm", run, base)
    assert (seen.length, seen.moved, seen.saved) == ("height_m", pytest.approx(0.2), pytest.approx(0.25))
    change(base, device="cuda:0")
    assert effect(Change("x", {}), "mpm", run, base).saved == pytest.approx(0.05)
    gone = effect(Change("x", {}), "mpm", finished(measures={"height_m": 0.005}), base)
    assert (gone.length, gone.moved) == ("bead_width_m", 1.0)
    for after, before in ((finished(verdict="diverged"), base), (run, finished(verdict="error"))):
        none = effect(Change("x", {}), "mpm", after, before)
        assert none.length == "" and math.isnan(none.moved) and math.isnan(none.saved)
    bare = effect(Change("x", {}), "mpm", finished(), finished())
    assert bare.length == "" and math.isnan(bare.moved) and bare.saved == 0.0


def seen(name, moved, saved, keys=None, method="mpm", verdict="completed"):
    run = finished(method, verdict)
    return Effect(Change(name, dict.fromkeys(keys or [name], 1)), method, run, moved, "height_m", saved)


def leanest(effects, moved, tolerance=0.05):
    """(what was chosen, all that was tried); `moved` says how far a joined run moves its height."""
    tried = []

    def run(settings, method):
        tried.append("+".join(sorted(settings)))
        shift = moved[len(tried) - 1]
        return finished(method, measures={"height_m": 1.0 + shift}, cpu_s=0.5)

    done = Ablation({"mpm": finished(measures={"height_m": 1.0})}, effects)
    found = module._leanest(done, "mpm", tolerance, run)
    return found and found.change.name, tried


def test_the_leanest_mix_joins_what_saves_most_while_the_shifts_add_up_to_less():
    """Shifts in sixteenths, with four allowed: 2 and 1 and 1 fit, another 2 would not."""
    effects = [seen("a", 0.0625, 0.3), seen("b", 0.125, 0.5), seen("c", 0.125, 0.2), seen("d", 0.0625, 0.1)]
    assert leanest(effects, [0.25], 0.25) == ("b + a + d", ["a+b+d"])
    assert leanest(effects, [0.3, 0.25], 0.25) == ("a + d", ["a+b+d", "a+d"])  # what moves most goes first
    assert leanest(effects, [0.3, 0.3, 0.3], 0.25) == (None, ["a+b+d", "a+d", "d"])


@pytest.mark.parametrize(
    ("extra", "free"),
    [
        (seen("x", 0.01, 0.05), False),  # saves no more than the noise
        (seen("x", 0.01, 0.051), True),
        (seen("x", 0.0501, 0.5), False),
        (seen("x", 0.05, 0.5), True),
        (seen("x", 0.01, 0.5, method="sph"), False),
        (seen("x", 0.01, 0.5, verdict="diverged"), False),
        (seen("x", math.nan, 0.5), False),
    ],
)
def test_a_change_takes_part_when_it_saves_and_moves_little(extra, free):
    assert leanest([extra], [0.0]) == (("x", ["x"]) if free else (None, []))


def test_changes_of_the_same_key_clash():
    effects = [seen("a", 0.01, 0.5, ["k", "l"]), seen("b", 0.01, 0.4, ["k"]), seen("c", 0.01, 0.3)]
    assert leanest(effects, [0.0]) == ("a + c", ["c+k+l"])


def test_a_mix_must_save_itself():
    done = Ablation({"mpm": finished(measures={"height_m": 1.0})}, [seen("a", 0.01, 0.5)])
    for spent, found in ((0.949, True), (0.951, False)):
        lean = module._leanest(
            done, "mpm", 0.05, lambda s, m, c=spent: finished(m, measures={"height_m": 1.0}, cpu_s=c)
        )
        assert (lean is not None) is found
    broken = module._leanest(done, "mpm", 0.05, lambda s, m: finished(m, "diverged"))
    assert broken is None


def test_everything_is_run_once_and_what_is_impossible_is_said(tmp_path, monkeypatch):
    planned = working(
        monkeypatch,
        lambda job: finished(
            job.method, measures={"height_m": 1.0}, cpu_s=0.5 if job.scenario["spacing"] > 4e-3 else 1.0
        ),
    )
    place = workplace_in(tmp_path)
    coarse = BEAD.model_copy(update={"spacing": 5e-3})  # 1.25 times that does not fit twice into the nozzle
    done = ablation(coarse, ["mpm", "pbd"], 0.05, place)
    assert [line.partition(": not possible here")[0] for line in done.impossible] == [
        "mpm: coarser spacing",
        "pbd: coarser spacing",
    ]
    first = planned[0]
    assert [j.method for j in first[:2]] == ["mpm", "pbd"] and {j.wall_limit for j in first} == {7.0}
    assert first[0].scenario == coarse.model_dump(mode="json") and first.workers == 2
    count = len(changes(coarse, ["mpm", "pbd"]))
    assert len(done.effects) == len(first) - 2 == 2 * (count - 6 - 1) + 6
    assert all(e.change.method in (None, e.method) for e in done.effects) and done.lean == {} and len(planned) == 1
    fine = ablation(BEAD.model_copy(update={"spacing": 3.5e-3}), ["mpm"], 0.05, place)
    assert fine.lean["mpm"].change.name == "coarser spacing" and fine.lean["mpm"].saved == pytest.approx(0.5)
    assert planned[-1][0].scenario["spacing"] == pytest.approx(4.375e-3) and planned[-1].workers == 1  # to be timed


def test_no_mix_is_sought_of_a_method_that_does_not_run(tmp_path, monkeypatch):
    working(monkeypatch, lambda job: finished(job.method, "diverged"))
    assert ablation(BEAD, ["mpm"], 0.05, workplace_in(tmp_path)).lean == {}


@pytest.mark.parametrize(("verdict", "fine"), [("completed", True), ("diverged", False), ("error", False)])
def test_an_ablation_is_whole_when_nothing_is_lacking(tmp_path, monkeypatch, verdict, fine):
    working(monkeypatch, lambda job: finished(job.method, verdict, measures={"height_m": 1.0}, reason="x"))
    made = ablate(BEAD, "mpm", called="line_bead", out=tmp_path, progress=False)
    lacks = verdict == "error"  # a run that blew up is evidence, but nothing can be compared with it
    assert (made.ok, bool(made.missing), made.root) == (fine, lacks, tmp_path)
    assert len(made.table) == len(made.found.effects) == len(made.runs) - 1 == len(changes(BEAD, ["mpm"]))


def test_what_an_ablation_lacks():
    done = Ablation(
        {"mpm": finished(verdict="refused")},
        [seen("a", 0, 0, verdict="refused"), seen("b", 0, 0, verdict="error")],
        {"mpm": seen("c", 0, 0, verdict="timeout")},
    )
    assert [line.split(": ")[1] for line in done.missing()] == ["refused", "error", "timeout"]


def test_the_command_of_a_mix_replaces_what_was_given():
    mix = seen("x", 0.0, 0.5)
    mix.change.settings.clear()
    mix.change.settings.update({"spacing": 0.5, "material.cure": None})
    assert command("line_bead", ["spacing=0.1", "seed=3"], mix) == (
        "fluidbench run line_bead --solver mpm --threads 1 --set seed=3 --set spacing=0.5 --set material.cure=none"
    )


# --- what is shown


@pytest.mark.parametrize(
    ("moved", "saved", "word"),
    [
        (0.0501, 0.9, "needed"),
        (0.05, 0.9, "droppable"),
        (0.05, 0.05, "idle"),
        (0.05, 0.051, "droppable"),
        (0.0, -0.3, "idle"),
        (math.nan, 0.9, "needed"),
    ],
)
def test_a_change_is_needed_droppable_or_idle(moved, saved, word):
    assert page.verdict(seen("a", moved, saved), 0.05) == word
    assert page.verdict(seen("a", moved, saved, verdict="diverged"), 0.05) == "diverged"


def test_the_page_names_what_is_needed_and_the_leanest_mix(tmp_path):
    effects = [seen("a", 0.2, 0.1), seen("b", 0.01, 0.25), seen("c", 0.0, 0.0), seen("d", math.nan, 0, verdict="error")]
    for e in effects:
        object.__setattr__(e.run, "folder", tmp_path / "runs" / e.change.name)
    lean = seen("b", 0.0123, 0.256)
    object.__setattr__(lean.run, "folder", tmp_path / "runs" / "lean")
    done = Ablation({"mpm": finished(), "sph": finished("sph", "timeout")}, effects, {"mpm": lean}, ["no way"])
    made = page.report(BEAD, "line_bead", ["seed=3"], done, 0.05, tmp_path)
    assert made.tables[0].rows == [
        ["a", "mpm", "20.0 %", "height_m", "10.0 %", "needed"],
        ["b", "mpm", "1.0 %", "height_m", "25.0 %", "droppable"],
        ["c", "mpm", "0.0 %", "height_m", "0.0 %", "idle"],
        ["d", "mpm", "-", "height_m", "0.0 %", "error"],
    ]
    assert made.findings == [
        "sph: the scenario itself ended as timeout.",
        "no way",
        "mpm: needed: a; droppable: b.",
        "mpm: leanest within 5%: b: saves 26% of the time, moves height_m by 1.2%. Alone: "
        "fluidbench run line_bead --solver mpm --threads 1 --set seed=3 --set b=1",
    ]
    assert [t.label for t in made.plots[0].traces] == ["mpm"] and len(made.data) == 5
    assert list(made.plots[0].traces[0].x) == pytest.approx([10.0, 25.0, 0.0])
    assert list(made.plots[0].traces[0].y) == pytest.approx([20.0, 1.0, 0.0])
    assert made.plots[0].traces[0].names == ["a", "b", "c"]


def test_a_mistake_in_a_change_is_no_crash():
    with pytest.raises(UserError):
        module.varied(BEAD.model_dump(mode="json"), {"spacing": 1.0})
