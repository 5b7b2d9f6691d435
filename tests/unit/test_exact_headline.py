"""What a comparison comes to in sentences, and the command that asks for a run again."""

import pytest

from fluidbench.scenario.library import load
from fluidbench.study.again import settings_of
from fluidbench.study.headline import agreement, cheapest, headline

from .made import finished


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"mpm": 0.0100, "sph": 0.0104, "pbd": 0.0102}, "mpm, pbd and sph agree on bead width within 3.9% (10.2 mm)."),
        (
            {"mpm": 0.010, "sph": 0.0102, "pbd": 0.0140},
            "mpm and sph agree on bead width within 2.0% (10.1 mm); pbd is 39% above.",
        ),
        (
            {"mpm": 0.010, "sph": 0.0102, "pbd": 0.0050},
            "mpm and sph agree on bead width within 2.0% (10.1 mm); pbd is 50% below.",
        ),
        (
            {"mpm": 0.010, "sph": 0.012, "pbd": 0.016},
            "No two agree on bead width within 5%: mpm 10, sph 12, pbd 16 mm.",
        ),
        ({"mpm": 0.010, "sph": 0.0101}, "mpm and sph agree on bead width within 1.0% (10.05 mm)."),
    ],
)
def test_the_most_that_agree_are_told_first(values, said):
    assert agreement("bead_width_m", values) == said


def test_a_length_without_a_unit_has_none():
    assert agreement("slump", {"mpm": 0.3, "sph": 0.3}) == "mpm and sph agree on slump within 0.0% (0.3)."
    assert agreement("slump", {"mpm": 0.3, "sph": 0.4}) == "No two agree on slump within 5%: mpm 0.3, sph 0.4."


def test_who_has_no_result_and_whose_print_fell_come_first():
    runs = [
        finished("mpm", measures={"bead_width_m": 0.01}, wall_per_simulated_s=2.0, print="sound"),
        finished("mpm", measures={"bead_width_m": 0.5}, wall_per_simulated_s=4.0, repeat=1),
        finished("sph", measures={"bead_width_m": 0.01, "top_m": 1.0}, wall_per_simulated_s=9.0, print="collapsed"),
        finished("pbd", "diverged"),
    ]
    assert headline(runs) == [
        "pbd has no result: diverged.",
        "sph's print: collapsed.",
        "mpm and sph agree on bead width within 0.0% (10 mm).",
        "mpm took least time, 3 s for a simulated second; sph 3 times as long.",
    ]
    assert headline(runs[:1]) == [] == cheapest([runs[3]])


def test_a_run_is_asked_for_by_what_it_has_otherwise():
    def settings(**changes):
        table = load("line_bead").replace(**changes).model_dump(mode="json")
        return settings_of(finished(input=table).record)

    assert settings() == "" and settings(spacing=2e-3) == " --set spacing=0.002"
    assert settings(numerics={"mpm": {"grid_ratio": 3.0}}) == " --set numerics.mpm.grid_ratio=3.0"
    assert settings(gravity=[0.0, 1.0, 0.0]) == " --set gravity='[0.0, 1.0, 0.0]'"
    assert settings_of(finished(scenario="mine", input={}).record) is None
