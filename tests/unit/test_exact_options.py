"""Options of the command line: what is accepted, and what is refused just beyond."""

import importlib
import math
import os

import pytest

from fluidbench.errors import UserError
from fluidbench.solver import solver_names
from fluidbench.target import Target

app = importlib.import_module("fluidbench.cli.app")  # the package has the application under this name
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
    ],
)
def test_shares(text, value):
    assert app.fraction(text) == pytest.approx(value)


@pytest.mark.parametrize("text", ["1000%", "9.9e-7", "0", "-5%", "nan", "inf", "five", "", "%", "10"])
def test_what_is_no_share(text):
    with pytest.raises(UserError, match=r"takes a share such as 5% or 0\.05"):
        app.fraction(text)


def test_a_share_above_one_needs_its_sign():
    with pytest.raises(UserError, match=r"--tolerance 5 would be 500 %; write 5% or a share below 1"):
        app.fraction("5")
    with pytest.raises(UserError, match=r"would be 101 %"):
        app.fraction("1.01")


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
    assert app.budget_of(text) == budget


@pytest.mark.parametrize("text", ["0.0009", "3.21e7", "0", "-1s", "soon", "s", "nan", "inf"])
def test_what_is_no_budget(text):
    with pytest.raises(UserError, match="takes a time such as 60s"):
        app.budget_of(text)


def test_positive_numbers_and_seconds():
    for value in (1e-9, 1.0, 1e9):
        assert app.positive(value, "--x") == value
    for value in (0.0, -1.0, 9e-10, 1.01e9, math.inf, math.nan):
        with pytest.raises(UserError, match="--x takes a positive number; got"):
            app.positive(value, "--x")
    assert app.positive(0.0, "--x", zero=True) == 0.0
    for value in (-1.0, 9e-10):
        with pytest.raises(UserError, match="--x takes a number of 0 or more; got"):
            app.positive(value, "--x", zero=True)
    for value in (1e-3, YEAR):
        assert app.seconds(value, "--x") == value
    assert app.seconds(0.0, "--x", zero=True) == 0.0
    for value in (0.99e-3, 1.01 * YEAR):
        with pytest.raises(UserError, match=r"--x takes seconds, from 0\.001 up to a year"):
            app.seconds(value, "--x")
    with pytest.raises(UserError, match="positive"):
        app.seconds(0.0, "--x")


def test_counts_and_repeats():
    assert app.count_of("298000", "--x") == 298000 and app.count_of("9" * 30, "--x") == int("9" * 30)
    for text in ("0", "00", "-1", "1.5", "²", "9" * 31, ""):
        with pytest.raises(UserError, match="--x takes whole numbers such as 298000"):
            app.count_of(text, "--x")
    assert app.repeats_of(1000) == 1000
    with pytest.raises(UserError, match="--repeats takes up to 1000; got 1001"):
        app.repeats_of(1001)


def test_names_in_a_list():
    assert app.names_in(" a, b ,c", "--x", "thing") == ["a", "b", "c"]
    for text, words in (("", "names no thing"), (" , ", "names no thing"), ("a,,b", "takes each thing once"),
                        ("a,b,a", "names a twice")):  # fmt: skip
        with pytest.raises(UserError, match=words):
            app.names_in(text, "--x", "thing")
    assert app.methods_of(None) == solver_names() == ["mpm", "sph", "pbd"] and app.methods_of("pbd,mpm") == [
        "pbd",
        "mpm",
    ]


def test_targets_threads_and_jobs(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    assert app.target_of("cpu", "taichi", 8) == Target(backend="taichi", threads=8)
    for words, call in (
        ("--threads 9 are more than this machine's 2 cores", lambda: app.target_of("cpu", "taichi", 9)),
        ("--threads 2 is for taichi", lambda: app.one_target("cpu", "warp", 2)),
        ("takes one language here", lambda: app.one_target("cpu", "warp,taichi", 1)),
        ("--jobs 17 at a time are too many", lambda: app.workers_for(17, Target())),
        ("no 'wrap'; did you mean 'warp'", lambda: app.target_of("cpu", "wrap", 1)),
    ):  # fmt: skip
        with pytest.raises(UserError, match=words):
            call()
    assert app.one_target("cpu", "taichi", 2).threads == 2
    assert [
        app.workers_for(j, t)
        for j, t in (
            (None, Target()),
            (None, Target(backend="taichi", threads=2)),
            (16, Target()),
            (None, Target(backend="taichi", threads=3)),
            (None, Target("cuda:0")),
            (3, Target("cuda:0")),
        )
    ] == [2, 1, 16, 1, 1, 3]
    assert app.targets_of("cpu", "warp", 1) == [Target()]
    assert app.targets_of("cpu", "warp,taichi", 2) == [Target(), Target(backend="taichi", threads=2)]
    with pytest.raises(UserError, match="--threads 2 is for taichi"):
        app.targets_of("cpu", "warp", 2)


def test_the_spacing_option_comes_last():
    assert app.load_scenario("line_bead", ["spacing=0.002", "seed=3"], 0.001).spacing == 0.001
    assert app.load_scenario("line_bead", None, None, quick=True).spacing == pytest.approx(2e-3)
    for value in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(UserError, match="--spacing takes a positive number of metres"):
            app.load_scenario("line_bead", None, value)
