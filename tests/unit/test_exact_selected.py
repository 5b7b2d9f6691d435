"""What select says: the recommendation in words, the tables and the plot."""

import math

import pytest

from fluidbench.report.plot import colour
from fluidbench.scenario.library import load, shipped
from fluidbench.study import select_report as page
from fluidbench.study.selection import Candidate, Selection, Trust

from .made import BEAD, change, finished

ALWAYS = (math.inf, math.inf)


def made(*rows, method="mpm", bias=0.0):
    """A selection of candidates (spacing, wall, discretisation)."""
    found = [Candidate(method, d, 1e-4, w, 10 * w, e, bias, e, finished(method)) for d, w, e in rows]
    return Selection(found, {method: Trust(1, 1)}, {method: {"height_m": 1.0}}, [])


def words(found, tolerance=0.2, budget=math.inf, pace=math.inf):
    for c in found.candidates:
        change(c.run, machine={"cores": "2"})
    return page._findings(BEAD, "line_bead", found, tolerance, budget, pace)


def test_findings_name_the_best_and_what_twice_would_take():
    found = made((1.0, 8.0, 0.1), (2.0, 4.0, 0.2), (4.0, 2.0, 0.4))
    lines = words(found)
    assert lines[0] == "Tolerance 20 %; budget of a run: none."
    assert lines[1] == (
        "Recommended: mpm at spacing 2000 mm (mean dt 0.0001 s): error 20.0% (discretisation 20.0%, bias 0.0%), 4 s, "
        "40 s per simulated s."
    )
    assert lines[2] == "Run it: fluidbench.run(scenario.replace(spacing=2), 'mpm') of the scenario given"
    assert lines[3].startswith("Twice as accurate: mpm at spacing 1000 mm") and lines[4].startswith(
        "Twice as fast: mpm at spacing 4000 mm"
    )
    assert lines[5].endswith("(judged by known answers on emission, yield stress).")
    finest = words(found, 0.1, 60.0, 1.5)
    assert finest[0] == "Tolerance 10 %; budget of a run: 60 s and 1.5 s per simulated s."
    assert finest[1].startswith("Nothing within the tolerance meets the budget; this is the fastest: ")
    assert finest[3] == (
        "Twice as accurate: nothing tried; at its observed order of 1 it takes 0.5 of the spacing, 16 times the work."
    )
    assert finest[4].startswith("Twice as fast: mpm at spacing 2000 mm")
    assert words(found, 0.4)[4] == "Twice as fast: nothing tried."
    assert words(Selection([], {}, {}, [], ["note"])) == [
        "No recommendation: no method completed at three spacings.",
        "note",
    ]


def test_twice_as_accurate_is_the_cheapest_and_twice_as_fast_the_most_accurate():
    found = made((1.0, 9.0, 0.1), (2.0, 8.0, 0.1), (3.0, 4.0, 0.2), (4.0, 2.0, 0.5), (5.0, 1.5, 0.6), (6.0, 8.5, 0.05))
    lines = words(found)
    assert "spacing 3000 mm" in lines[1] and "spacing 2000 mm" in lines[3] and "spacing 4000 mm" in lines[4]


def test_what_half_the_error_takes():
    second = made((1.0, 8.0, 0.01), (2.0, 4.0, 0.04), (4.0, 2.0, 0.16))
    assert page._further(second, second.candidates[0]) == (
        "at its observed order of 2 it takes 0.71 of the spacing, 4 times the work"
    )
    nothing = made((1.0, 8.0, 0.0), (2.0, 4.0, 0.0), (4.0, 2.0, 0.0))
    assert page._further(nothing, nothing.candidates[0]).endswith("nothing but what cannot be measured")


def test_what_half_the_error_takes_is_not_known_of_what_scatters():
    """Its errors fall, since the scatter from a spacing down cannot rise: that it does not fall would be false."""
    falling = made((1.0, 8.0, 0.017), (1.5, 4.0, 0.047), (2.0, 2.0, 0.094))
    falling.erratic["mpm"] = "its height scatters"
    words = page._further(falling, falling.candidates[0])
    assert words == "a length of mpm scatters (see below): what a finer spacing gains is not known"
    rising = made((1.0, 8.0, 0.04), (2.0, 4.0, 0.03), (4.0, 2.0, 0.02))
    assert page._further(rising, rising.candidates[0]) == (
        "the error of mpm does not fall with the spacing; a finer one promises little"
    )


@pytest.mark.parametrize("errors", [(0.0056, 0.0057, 0.0058, 0.006), (0.006, 0.0058, 0.0057, 0.0056), (0.005,) * 4])
def test_an_error_that_is_noise_at_all_spacings_has_no_order(errors):
    small = made(*((2.0**i, 1.0, e) for i, e in enumerate(errors)))
    assert small.converges("mpm")
    assert page._further(small, small.candidates[0]).endswith("nothing but what cannot be measured")


def test_the_command_is_of_the_scenario_that_was_asked_for(tmp_path):
    """With what was set on the command line, be it the quick version; and in Python where a command cannot say it."""
    file = tmp_path / "a b.toml"
    file.write_text(shipped()["line_bead"].read_text())
    one = made((1.0, 8.0, 0.1)).candidates[0]

    def command(scenario, name):
        change(one.run, input=scenario.replace(spacing=2e-3).model_dump(mode="json"), machine={"cores": "2"})
        return page._command(name, one)

    start = "fluidbench run line_bead --solver mpm --spacing 1000mm"
    assert command(load("line_bead"), "line_bead") == f"{start} --threads 1"
    varied = load("line_bead", {"material.yield_stress": 50})
    assert command(varied, "line_bead") == f"{start} --set material.yield_stress=50.0 --threads 1"
    quick = command(load("foam_tower", quick=True), "foam_tower")
    assert " --set duration=6.6 " in quick and " --set material.expansion.ratio=3.5 " in quick
    assert command(load(file), str(file)).startswith(f"fluidbench run '{file}' --solver mpm")
    assert (
        command(load("line_bead"), "of_mine")
        == "fluidbench.run(scenario.replace(spacing=1), 'mpm') of the scenario given"
    )


def test_without_candidates_there_is_no_empty_picture(tmp_path):
    nothing = Selection([], {"mpm": Trust(1, 1)}, {}, [], ["mpm: refused: why"])
    made = page.report(BEAD, "line_bead", nothing, 0.2, *ALWAYS, tmp_path)
    assert made.plots == [] and made.findings[-1] == "mpm: refused: why"


def test_tables_and_plot_of_the_candidates(tmp_path):
    found = made((1.0, 8.0, 0.1), (2.0, 4.0, 0.2), (4.0, 5.0, 0.4), bias=0.01)
    front = found.front()
    rows = page._candidates(found, front).rows
    assert rows[0] == ["mpm", "2000", "0.0001", "4", "40", "21.0%", "20.0%", "1.0%", "yes"]
    assert [row[1] for row in rows] == ["2000", "4000", "1000"] and [row[-1] for row in rows] == ["yes", "-", "yes"]
    found.trust["sph"] = Trust(1, 4)
    assert page._evidence(found).rows == [["mpm", "1", "1 of 1", "yes"], ["sph", "nan", "1 of 4", "no"]]
    best, dominated = page._plot(found, front).traces
    assert (list(dominated.x), list(dominated.y)) == ([5.0], [pytest.approx(41.0)])
    assert (best.label, best.faded, dominated.label, dominated.faded) == ("mpm", False, "", True)  # told once
    assert dominated.colour == best.colour == colour("mpm")
    sph = made((1.0, 9.0, 0.9), method="sph").candidates
    never = page._plot(Selection([*found.candidates, *sph], {}, {}, []), front).traces[-1]
    assert (never.label, never.colour, never.faded, never.style) == ("sph", colour("sph"), True, "points")
    assert (list(best.x), list(best.y)) == ([4.0, 8.0], pytest.approx([21.0, 11.0]))
    for c in found.candidates:
        change(c.run, machine={"cores": "2"})
        object.__setattr__(c.run, "folder", tmp_path / "runs" / "x")
    data = page.report(BEAD, "line_bead", found, 0.2, *[math.inf] * 2, tmp_path).data
    assert data["on_front"].tolist() == [True, True, False] and data["time_s"].tolist() == [8.0, 4.0, 5.0]
    assert page._row(found.candidates[0], True) == {
        "method": "mpm",
        "spacing_m": 1.0,
        "mean_dt_s": 1e-4,
        "time_s": 8.0,
        "time_per_simulated_s": 80.0,
        "error": pytest.approx(0.11),
        "discretisation": 0.1,
        "bias": 0.01,
        "on_front": True,
    }
