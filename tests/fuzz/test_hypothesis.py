"""Hypothesis at every door: the scenario model, the TOML reader, --set and the options. An answer or a UserError."""

import copy
import json
import math
from datetime import date
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fluidbench.cli.options import budget_of, count_of, names_in
from fluidbench.errors import UserError
from fluidbench.registry import method_names
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import assign, load, parse_override, validate
from fluidbench.study.case import select
from fluidbench.study.points import choose
from fluidbench.study.workplace import share_of, targets_of

from .harness import fluidbench, nothing_runs
from .leaves import OWN, full, leaves, table
from .toml import dump

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # the program does not make errors of them
CALM = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
MANY = settings(CALM, max_examples=300)  # where an example takes a millisecond
KEYS = sorted({leaf.path for leaf in leaves()})
HOSTILE = st.one_of(
    st.floats(),
    st.integers(),
    st.booleans(),
    st.text(max_size=40),
    st.just([]),
    st.just({}),
    st.none(),
    st.sampled_from([math.nan, math.inf, -math.inf, 1e300, 1e-300, -1e300, 1e30, 0, -1, 10**400, date(1979, 5, 27)]),
)
JUNK = st.recursive(HOSTILE, lambda s: st.lists(s, max_size=4) | st.dictionaries(st.text(max_size=9), s, max_size=4))
WORDS = st.one_of(
    st.text(max_size=30),
    st.sampled_from(["mpm", "warp", "fit", "nan", "inf", "5", "5%", "60s", ",", "coarse", "density"]),
    st.lists(st.sampled_from(["mpm", "fit", "warp", "density", "", " ", "nan", "-1", "1e300"]), max_size=4).map(
        ",".join
    ),
    st.floats().map(str),
    st.integers().map(str),
)


def sound(scenario: Scenario) -> None:
    """A scenario that was accepted can be run: all that follows from it is finite, and it can be written down."""
    tick, ticks, per_output = scenario.schedule
    assert math.isfinite(tick) and tick > 0 and ticks >= 1 and per_output >= 1
    assert math.isfinite(scenario.reference_speed) and math.isfinite(scenario.top_wave_speed)
    assert math.isfinite(scenario.peak_acceleration) and all(isinstance(line, str) for line in scenario.warnings())
    written = json.loads(json.dumps(scenario.model_dump(mode="json"), allow_nan=False))
    assert Scenario.model_validate(written) == scenario


@CALM
@given(st.data())
def test_a_scenario_with_one_hostile_value(data):
    """Every key of the model, with whatever there is in its place."""
    base = data.draw(st.sampled_from(["line_bead", "ring_tower_drone", "dam_break", *OWN]))
    made = copy.deepcopy(full(base))
    key = data.draw(st.sampled_from(KEYS))
    try:
        assign(made, key, data.draw(JUNK))
        sound(validate(made, "hypothesis"))
    except UserError as error:
        assert 0 < len(str(error)) < 4000


@CALM
@given(st.sampled_from(KEYS), st.floats() | st.sampled_from([1e300, 1e-300, -1.0, 0.0, math.nan]))
def test_a_scenario_with_one_hostile_number(key, number):
    for base in ("polyline", "bodies", "spawn"):
        made = copy.deepcopy(full(base))
        try:
            assign(made, key, number)
            sound(validate(made, "hypothesis"))
        except UserError as error:
            assert len(str(error).splitlines()) <= 6


@MANY
@given(st.dictionaries(st.sampled_from(list(Scenario.model_fields)) | st.text(max_size=20), JUNK, max_size=6))
def test_a_table_of_junk_is_a_user_error(junk):
    with pytest.raises(UserError):
        validate({"domain": 5} | junk | {"spacing": "none at all"}, "hypothesis")


@MANY
@given(st.binary(max_size=300) | st.text(max_size=300).map(lambda t: t.encode("utf-8", "surrogatepass")))
def test_the_toml_reader_takes_any_bytes(tmp_path, data):
    (tmp_path / "case.toml").write_bytes(data)
    with pytest.raises(UserError):
        load(tmp_path / "case.toml")


@MANY
@given(
    st.dictionaries(st.sampled_from(KEYS), HOSTILE.filter(lambda v: v not in ([], {}, None)), max_size=3), st.booleans()
)
def test_the_toml_reader_takes_any_values(tmp_path, values, quick):
    """Over a shipped scenario, as its own [quick] table or at the top."""
    try:
        made: dict[str, Any] = {}
        for key, value in values.items():
            assign(made, key, value if not isinstance(value, date) else str(value))
    except UserError:
        return
    whole = {"extends": "line_bead", "quick": made} if quick else {"extends": "line_bead"} | made
    (tmp_path / "case.toml").write_bytes(dump(whole).replace(b"\r", b""))
    try:
        sound(load(tmp_path / "case.toml", quick=quick))
    except UserError as error:
        assert str(error)


@MANY
@given(st.text(max_size=60) | st.tuples(st.sampled_from(KEYS), st.text(max_size=30)).map("=".join))
def test_any_text_of_set_is_an_override_or_a_user_error(text):
    for base in ("line_bead", "dam_break"):
        try:
            key, value = parse_override(text)
            assign(copy.deepcopy(table(base)), key, value)
            sound(load(base, [text]))
        except UserError as error:
            assert str(error)


def share(text):
    return share_of(text, "tolerance")


@MANY
@given(WORDS)
def test_any_text_of_an_option_is_a_value_or_a_user_error(text):
    for read in (
        share,
        budget_of,
        lambda t: count_of(t, "--pools"),
        lambda t: choose(names_in(t, "--axis", "axis"), method_names()),
        lambda t: select(names_in(t, "CASES", "case")),
        lambda t: targets_of("cpu", names_in(t, "--backend", "backend"), 1),
    ):
        try:
            made = read(text)
        except UserError as error:
            assert str(error)
            continue
        if read is share:
            assert isinstance(made, float) and 0 < made < math.inf
        if read is budget_of:
            assert isinstance(made, tuple) and all(value > 0 for value in made)  # infinite: no budget


OPTIONS = {
    "compare": (
        "--solvers",
        "--backend",
        "--wall-limit",
        "--render-every",
        "--repeats",
        "--spacing",
        "--set",
        "--device",
    ),
    "run": ("--solver", "--wall-limit", "--render-every", "--threads"),
    "validate": ("--levels", "--jobs", "--wall-limit"),
    "stability": ("--axis", "--jobs", "--solvers"),
    "select": ("--tolerance", "--budget"),
    "ablate": ("--tolerance",),
    "table2": ("--pools", "--repeats"),
    "show": ("--set", "--spacing"),
}
NEEDS = {"validate": "free_fall", "stability": "line_bead", "table2": ""}


@CALM
@given(st.sampled_from(sorted(OPTIONS)), st.data())
def test_any_option_of_any_verb_ends_well(tmp_path, verb, data):
    """The command line itself: it would run, it answers, or it refuses; nothing else."""
    option, text = data.draw(st.sampled_from(OPTIONS[verb])), data.draw(WORDS)
    first = NEEDS.get(verb, "line_bead")
    out = [] if verb == "show" else ["--out", str(tmp_path / "out")]
    with nothing_runs():
        done = fluidbench([verb, *([first] if first else []), f"{option}={text}", *out])
    assert not done.crash, done.crash
    assert done.accepted or (done.code == 2 and done.err.strip()), (done.code, done.err)
