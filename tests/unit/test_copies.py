"""Copies of a scenario: what is derived follows what was changed, and `replace` validates."""

import pytest

from fluidbench.errors import UserError
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import load

CHANGES = [
    {"duration": 3.0},
    {"spacing": 3e-3},
    {"tick": 1e-3},
    {"output_interval": 0.05},
    {"gravity": (0.0, 0.0, -1.6)},
    {"body_force": (3.0, 0.0, 0.0)},
]
DERIVED = ("schedule", "reference_speed", "peak_acceleration", "aged", "liquid_sound_speed", "wave_speed")


def derived(s):
    return {name: getattr(s, name) for name in DERIVED} | {"end": s.track.end, "knots": s.track.position.tolist()}


def same(a, b):
    a, b = derived(a), derived(b)
    (ages, materials), (other_ages, other_materials) = a.pop("aged"), b.pop("aged")
    return a == b and (ages == other_ages).all() and materials == other_materials


def changed_nested(s):
    """Tables changed as a whole: another path, another nozzle, another material."""
    path = s.toolpath.model_copy(update={"speed": 0.03, "end": (0.05, 0.0)})
    nozzle = s.nozzle.model_copy(update={"exit_speed": 0.7, "standoff": 0.012})
    material = s.material.model_copy(update={"density": 500.0, "youngs_modulus": 9e4})
    return [{"toolpath": path}, {"nozzle": nozzle}, {"material": material}]


@pytest.mark.parametrize("how", ["model_copy", "replace"])
def test_what_is_derived_follows_the_copy(how):
    s = load("line_bead")
    derived(s)  # everything cached
    for change in [*CHANGES, *changed_nested(s)]:
        copy = s.model_copy(update=change) if how == "model_copy" else s.replace(**change)
        afresh = Scenario.model_validate(s.model_dump() | {k: getattr(copy, k) for k in change})
        assert same(copy, afresh), change
        assert not same(copy, s), change
    assert same(s, load("line_bead"))


def test_a_copy_with_another_duration_runs_that_long():
    s = load("dam_break")
    tick, ticks, _ = s.schedule
    longer = s.model_copy(update={"duration": 2 * s.duration})
    assert longer.schedule[0] * longer.schedule[1] == pytest.approx(2 * tick * ticks)


def test_replace_refuses_what_a_file_may_not_say():
    s = load("line_bead")
    for change, words in (
        ({"duration": -3}, "^line_bead: duration: input should be greater than 0 .got -3.$"),
        ({"durations": 3}, "^line_bead: unknown key 'durations'; did you mean 'duration'.$"),
        ({"spacing": 1.0}, "^line_bead: "),
        ({"gravity": (0.0, 0.0, float("nan"))}, "^line_bead: gravity.2: "),
        (
            {"no_such_key": 1, "duration": "3 kg"},
            "^line_bead: duration: .3 kg. is of another.*\n.*no_such_key",
        ),
        ({"numerics": {"mpm": {"grid_rato": 2}}}, "^line_bead: numerics.mpm: unknown key 'grid_rato'"),
    ):
        with pytest.raises(UserError, match=words) as told:
            s.replace(**change)
        assert "https" not in str(told.value)
    with pytest.raises(UserError, match=r"^material: density: input should be greater than 0"):
        s.material.replace(density=-1.0)
    assert s.replace(duration="2 s").duration == 2.0
    assert s.replace().model_dump() == s.model_dump()


def test_the_same_made_of_another_material_has_that_materials_numbers():
    s = load("ring_tower_expansion_curing")
    derived(s)
    fourfold = {"youngs_modulus": 4 * s.material.youngs_modulus, "cure": None, "expansion": None}
    stiff = s.material.model_copy(update=fourfold)
    made = s.made_of(stiff)
    assert made.aged[1] == [stiff] and made.wave_speed == pytest.approx(2 * s.wave_speed)
    assert made.track is s.track and same(made, s.replace(material=stiff))
