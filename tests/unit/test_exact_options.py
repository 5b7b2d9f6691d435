"""Options of the command line: what is accepted, and what is refused just beyond."""

import math
from pathlib import Path

import pytest

import fluidbench as fb
from fluidbench.cli import options
from fluidbench.errors import UserError
from fluidbench.method.target import Target
from fluidbench.registry import method_names
from fluidbench.scenario.layout import capacity_of
from fluidbench.study import workplace

from ..conftest import bead

YEAR = 3.2e7


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5%", 0.05),
        (" 5 % ", 0.05),
        ("0.05", 0.05),
        ("1", 1.0),
        ("999%", 9.99),
        ("1e-6", 1e-6),
        ("1e-4%", 1e-6),
        ("150%", 1.5),
        (0.05, 0.05),
        (1, 1.0),
    ],
)
def test_shares(text, value):
    assert workplace.share_of(text, "tolerance") == pytest.approx(value)


@pytest.mark.parametrize(
    "given",
    ["1000%", "9.9e-7", "0", "-5%", "nan", "inf", "five", "", "%", "10", 0, -0.1, 10.0, math.nan, True, None, [5]],
)
def test_what_is_no_share(given):
    with pytest.raises(UserError, match=r"tolerance: a share such as 5% or 0\.05 is wanted"):
        workplace.share_of(given, "tolerance")


@pytest.mark.parametrize("given", [5, 5.0, "5", " 5.0 "])
def test_a_share_above_one_needs_its_sign(given, tmp_path):
    """On the command line and in Python alike."""
    words = "5 would be 500 %; write '5%' or a share of at most 1"
    for call in (
        lambda: workplace.share_of(given, "tolerance"),
        lambda: fb.select(bead(), tolerance=given, out=tmp_path),
        lambda: fb.ablate(bead(), tolerance=given, out=tmp_path),
        lambda: fb.guide([bead()], tolerances=[0.1, given], out=tmp_path),
    ):
        with pytest.raises(UserError, match=words):
            call()
    with pytest.raises(UserError, match=r"would be 101 %"):
        workplace.share_of(1.01, "tolerance")


@pytest.mark.parametrize(
    ("text", "budget"),
    [
        (None, (math.inf, math.inf)),
        ("", (math.inf, math.inf)),
        ("None", (math.inf, math.inf)),
        ("realtime", (math.inf, 1.0)),
        (" RealTime ", (math.inf, 1.0)),
        ("60s", (60.0, math.inf)),
        ("60", (60.0, math.inf)),
        ("5m", (300.0, math.inf)),
        ("1.5H", (5400.0, math.inf)),
        ("0.001", (1e-3, math.inf)),
        ("3.2e7", (YEAR, math.inf)),
    ],
)
def test_budgets(text, budget):
    assert options.budget_of(text) == budget


@pytest.mark.parametrize("text", ["0.0009", "3.21e7", "0", "-1s", "soon", "s", "nan", "inf"])
def test_what_is_no_budget(text):
    with pytest.raises(UserError, match="takes a time such as 60s"):
        options.budget_of(text)


def test_positive_numbers_and_seconds():
    for value in (1e-9, 1.0, 1e9):
        assert options.positive(value, "--x") == value
    for value in (0.0, -1.0, 9e-10, 1.01e9, math.inf, math.nan):
        with pytest.raises(UserError, match="--x takes a positive number; got"):
            options.positive(value, "--x")
    assert options.positive(0.0, "--x", zero=True) == 0.0
    for value in (-1.0, 9e-10):
        with pytest.raises(UserError, match="--x takes a number of 0 or more; got"):
            options.positive(value, "--x", zero=True)
    for value in (1e-3, YEAR):
        assert options.seconds(value, "--x") == value
    assert options.seconds(0.0, "--x", zero=True) == 0.0
    for value in (0.99e-3, 1.01 * YEAR):
        with pytest.raises(UserError, match=r"--x takes seconds, from 0\.001 up to a year"):
            options.seconds(value, "--x")
    with pytest.raises(UserError, match="positive"):
        options.seconds(0.0, "--x")


def test_counts_and_repeats():
    assert options.count_of("298000", "--x") == 298000 and options.count_of("9" * 30, "--x") == int("9" * 30)
    for text in ("0", "00", "-1", "1.5", "²", "9" * 31, ""):
        with pytest.raises(UserError, match="--x takes whole numbers such as 298000"):
            options.count_of(text, "--x")
    assert options.repeats_of(1000) == 1000
    with pytest.raises(UserError, match="--repeats takes up to 1000; got 1001"):
        options.repeats_of(1001)


def test_the_spacing_is_given_once():
    assert options.load_scenario("line_bead", ["spacing=3e-3"], None).spacing == 3e-3
    assert options.load_scenario("line_bead", ["material.density=900", "nozzle.standoff=0.01"], 2e-3).spacing == 2e-3
    for text in ("spacing=3e-3", " spacing = 2 mm", "spacing=2e-3"):
        with pytest.raises(UserError, match=r"^--spacing and --set spacing=\.\.\. both give the spacing"):
            options.load_scenario("line_bead", [text], 2e-3)


@pytest.mark.parametrize("text", ["", " "])
def test_no_folder_is_not_the_current_one(text):
    with pytest.raises(UserError, match=r"^--out takes an output folder .*`--out \.` is the current one"):
        options.folder(text)
    assert options.folder(".") == Path() and options.folder("a/b") == Path("a/b")


def test_names_in_a_list():
    assert options.names_in(" a, b ,c", "--x", "thing") == ["a", "b", "c"]
    for text, words in (
        ("", "names no thing"),
        (" , ", "names no thing"),
        ("a,,b", "takes each thing once"),
        ("a,b,a", "names a twice"),
    ):
        with pytest.raises(UserError, match=words):
            options.names_in(text, "--x", "thing")
    assert options.methods_in(None) is None and options.methods_in("pbd,mpm") == ["pbd", "mpm"]
    with pytest.raises(UserError, match="--solvers names mpm twice"):
        options.methods_in("mpm,mpm")


def test_methods_are_those_named_or_all_that_are_here(monkeypatch, tmp_path):
    monkeypatch.setenv("FLUIDBENCH_DATA", str(tmp_path))  # no engines there
    assert workplace.methods_of(None) == method_names()[:3] == ["mpm", "sph", "pbd"]
    assert workplace.methods_of(["pbd", "mpm"]) == ["pbd", "mpm"] and workplace.methods_of("sph") == ["sph"]
    for given, words in (
        ([], "no method is named"),
        (["mpm", "sph", "mpm"], "mpm is named twice"),
        ("mpn", "no solver.* 'mpn'.*did you mean 'mpm'"),
    ):
        with pytest.raises(UserError, match=words):
            workplace.methods_of(given)


def test_targets_threads_and_jobs(monkeypatch):
    monkeypatch.setattr(workplace, "cores", lambda: 2)
    monkeypatch.setattr(workplace, "_check_device", lambda device: None)
    assert workplace.target_of("cpu", "taichi", 8) == Target(backend="taichi", threads=8)
    for words, call in (
        ("^9 threads are more than this machine's 2 cores", lambda: workplace.target_of("cpu", "taichi", 9)),
        ("2 threads are for the CPU; a GPU has its own", lambda: workplace.one_target("cuda:0", "warp", 2)),
        ("one backend is wanted here; got 'warp,taichi'", lambda: workplace.one_target("cpu", "warp,taichi", 1)),
        ("17 runs at a time are too many for this machine's 2 cores", lambda: workplace.workers_for(17, Target())),
        ("no 'wrap'; did you mean 'warp'", lambda: workplace.target_of("cpu", "wrap", 1)),
    ):
        with pytest.raises(UserError, match=words):
            call()
    assert workplace.one_target("cpu", "taichi", 2).threads == 2
    assert [
        workplace.workers_for(j, t)
        for j, t in (
            (None, Target()),
            (None, Target(backend="taichi", threads=2)),
            (16, Target()),
            (None, Target(backend="taichi", threads=3)),
            (None, Target("cuda:0")),
            (3, Target("cuda:0")),
        )
    ] == [2, 1, 16, 1, 1, 3]
    assert workplace.targets_of("cpu", ["warp"], 1) == [Target()]
    assert workplace.targets_of("cpu", ["warp", "taichi"], 2) == [
        Target(threads=2),
        Target(backend="taichi", threads=2),
    ]
    assert workplace.targets_of("cpu", ["warp"], 2) == [Target(threads=2)]


def test_a_run_that_is_alone_has_all_cores(monkeypatch):
    """But none for fewer than a thousand particles, and one where its method or its bits do not allow more."""
    monkeypatch.setattr(workplace, "cores", lambda: 16)
    s = bead()  # of a few hundred
    large = s.model_copy(update={"spacing": s.spacing / 4})
    room = capacity_of(large)
    assert workplace.threads_alone(s, "mpm", Target()) == 1 < room // 1000
    assert workplace.threads_alone(large, "sph", Target()) == min(16, room // 1000)
    for target in (Target("cuda:0"), Target(backend="taichi")):
        assert workplace.threads_alone(large, "sph", target) == 1
    assert workplace.threads_alone(large, "splishsplash-wcsph", Target()) == 1


def test_the_spacing_option_is_a_positive_length():
    assert options.load_scenario("line_bead", ["seed=3"], 0.001).spacing == 0.001
    assert options.load_scenario("line_bead", None, None, quick=True).spacing == pytest.approx(2e-3)
    for value in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(UserError, match="--spacing takes a positive number of metres"):
            options.load_scenario("line_bead", None, value)
