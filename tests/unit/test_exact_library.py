"""Scenario files and overrides: what is found, merged and assigned, and which mistakes are told."""

import re

import pytest

from fluidbench.errors import UserError, quoted, suggestion
from fluidbench.scenario import library
from fluidbench.scenario.library import assign, find, load, parse_override
from fluidbench.scenario.mistakes import short


def test_a_file_is_found_by_name_or_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find("line_bead").name == "line_bead.toml"
    (tmp_path / "line_bead").write_text("")
    assert find("line_bead").parent.name == "extrusion"  # the shipped one, unless it is called by its file's name
    (tmp_path / "mine.toml").write_text("")
    assert find("mine.toml").name == "mine.toml" and find(tmp_path / "mine.toml") == tmp_path / "mine.toml"
    (tmp_path / "folder.toml").mkdir()
    for wrong, words in (
        ("none.toml", "no such scenario file: 'none.toml'"),
        ("folder.toml", "'folder.toml' is a folder"),
        (".", "'.' is a folder; a shipped scenario's name or a TOML file is wanted"),
        ("/dev/null", "'/dev/null' is no regular file"),
    ):
        with pytest.raises(UserError, match=words):
            find(wrong)
    with pytest.raises(UserError, match="is no file name"):
        find("x" * 5000)


def test_a_file_extends_a_bounded_number_of_others(tmp_path):
    def chain(depth):
        for i in range(depth - 1):
            (tmp_path / f"f{i}.toml").write_text(f'extends = "f{i + 1}.toml"\n')
        (tmp_path / f"f{depth - 1}.toml").write_text(library.find("line_bead").read_text())
        return load(tmp_path / "f0.toml")

    assert chain(32).spacing == 1.5e-3 and chain(3).name == "f0"
    with pytest.raises(UserError, match="extends more than 32 files deep"):
        chain(33)


def test_a_file_is_of_bounded_size(tmp_path):
    text = library.find("line_bead").read_text()
    path = tmp_path / "big.toml"
    path.write_text(text + "#" * (2**20 - len(text.encode())))
    assert path.stat().st_size == 2**20 and load(path).spacing == 1.5e-3
    path.write_text(path.read_text() + "#")
    with pytest.raises(UserError, match="1048577 bytes are no scenario; 1048576 at most"):
        load(path)


def test_a_file_may_begin_with_the_mark_of_an_editor(tmp_path):
    """The byte order mark that editors on Windows write before UTF-8; in a scenario, and in what it extends."""
    (tmp_path / "base.toml").write_text(library.find("line_bead").read_text(), encoding="utf-8-sig")
    (tmp_path / "mine.toml").write_text('extends = "base.toml"\nspacing = "1 mm"\n', encoding="utf-8-sig")
    assert load(tmp_path / "mine.toml").spacing == 1e-3


def test_quick_takes_the_files_own_table_or_a_third_more_spacing(tmp_path):
    text = library.find("line_bead").read_text()
    (tmp_path / "own.toml").write_text(text + "\n[quick]\nduration = 1.5\n[quick.material]\ndensity = 7.0\n")
    own = load(tmp_path / "own.toml", quick=True)
    assert (own.duration, own.material.density, own.material.yield_stress, own.spacing) == (1.5, 7.0, 60.0, 1.5e-3)
    assert load(tmp_path / "own.toml").duration == 1.05
    assert load("line_bead", {"spacing": 1e-3}, quick=True).spacing == 1e-3
    (tmp_path / "bad.toml").write_text("quick = 3\n" + text)
    with pytest.raises(UserError, match="quick: a table is wanted"):
        load(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("[quick]\nduratoin = 1.5", "quick: unknown key 'duratoin'; did you mean 'duration'?"),
        ("[quick]\nextends = 'wall'", "quick: unknown key 'extends'"),
        ("[quick.toolpath]\nlayrs = 2", "quick: unknown key 'toolpath.layrs'; did you mean 'layers'?"),
        ("[quick.domain.walls]\nz_lower = { frction = 1 }", "quick: unknown key 'domain.walls.z_lower.frction'"),
        ("[[quick.bodies]]\nkind = 'box'\n[[quick.bodies]]\nsiz = 3", "quick: unknown key 'bodies.1.siz'"),
        ("[quick.numerics.mpn]\ngrid_ratio = 2", "quick: numerics.mpn: no method of that name"),
        ("[quick.numerics.mpm]\ngrid_rato = 2", "quick: numerics.mpm: unknown key 'grid_rato'; did you mean"),
    ],
)
def test_a_key_of_quick_that_is_none_is_refused_whether_it_is_asked_for_or_not(tmp_path, table, words):
    (tmp_path / "mine.toml").write_text('extends = "line_bead"\n' + table)
    for quick in (False, True):
        with pytest.raises(UserError, match=re.escape(f"mine.toml: {words}")):
            load(tmp_path / "mine.toml", quick=quick)


def test_overrides_are_toml_or_words():
    given = {
        "a=1": ("a", 1),
        "a.b = 2.5": ("a.b", 2.5),
        "a=true": ("a", True),
        "a=[1, 2]": ("a", [1, 2]),
        "a=x y": ("a", "x y"),
        "a='x'": ("a", "x"),
        "a=none": ("a", None),
        "a= none ": ("a", None),
        "a=b=c": ("a", "b=c"),
    }
    assert {text: parse_override(text) for text in given} == given
    for text in ("a", "=3", " =3"):
        with pytest.raises(UserError, match="--set takes key=value"):
            parse_override(text)
    with pytest.raises(UserError, match="one key=value"):
        parse_override("a=1\nb=2")


def test_keys_reach_into_tables_and_lists():
    table = {"a": {"b": 1}, "l": [{"x": 1}, 2]}
    for key, value in (("a.b", 3), ("a.c.d", 4), ("l.0.x", 5), ("l.1", 6), ("e", 7)):
        assign(table, key, value)
    assert table == {"a": {"b": 3, "c": {"d": 4}}, "l": [{"x": 5}, 6], "e": 7}
    assign(table, "a.b", None)
    assign(table, "gone", None)
    assert table == {"a": {"c": {"d": 4}}, "l": [{"x": 5}, 6], "e": 7}
    for key, words in (
        ("l.2", "must be a number below 2"),
        ("l.x.y", "must be a number below 2"),
        ("l.-1", "a number below 2"),
        ("e.x", "is a value, not a table"),
        ("a..b", "names joined by dots"),
        ("", "names joined by dots"),
        ("l." + "0" * 10, "a number below 2"),
        (".".join("k" * 34), "names joined by dots"),
    ):
        with pytest.raises(UserError, match=words):
            assign(table, key, 1)
    assign(table, "l." + "0" * 9, 8)
    assert table["l"][0] == 8
    assign({}, ".".join("k" * 33), 1)


def test_a_key_of_a_list_that_is_not_there_begins_it():
    table = {"a": 1}
    assign(table, "bodies.0.kind", "box")
    assign(table, "bodies.0.size", [1, 1, 1])
    assert table["bodies"] == [{"kind": "box", "size": [1, 1, 1]}]
    with pytest.raises(UserError, match="must be a number below 1"):
        assign(table, "bodies.1.kind", "box")
    added = ["bodies.0.kind=box", "bodies.0.size=[0.01, 0.01, 0.01]", "bodies.0.center=[0, 0, 0.02]"]
    assert load("line_bead", added).bodies[0].size == (0.01, 0.01, 0.01)


WALL = "input should be 'slip', 'stick' or 'periodic', or a table with friction"


@pytest.mark.parametrize(
    ("override", "lines"),
    [
        ("material=3", ["material: a table [material] is wanted (got 3)"]),
        ("material.cure=3", ["material.cure: a table [material.cure] is wanted (got 3)"]),
        ("numerics.mpm=3", ["numerics.mpm: a table [numerics.mpm] is wanted (got 3)"]),
        ("bodies={x = 1}", ["bodies: a list of tables [[bodies]] is wanted (got {'x': 1})"]),
        ("measured=[3]", ["measured.0: a table is wanted (got 3)"]),
        ("gravity=3", ["gravity: a list of 3 numbers is wanted (got 3)"]),
        ("gravity=[1, 2]", ["gravity: a list of 3 numbers is wanted (got [1, 2])"]),
        ("toolpath.start=[1, 2, 3]", ["toolpath.start: a list of 2 numbers is wanted (got [1, 2, 3])"]),
        ("toolpath.points=3", ["toolpath.points: a list is wanted (got 3)"]),
        ("body_force_gradient=3", ["body_force_gradient: a list of 3 values is wanted (got 3)"]),
        ("domain.walls.z_lower=3", [f"domain.walls.z_lower: {WALL} (got 3)"]),
        (
            "domain.walls.z_lower={frction = 1}",
            [
                "'domain.walls.z_lower.friction' is missing",
                "unknown key 'domain.walls.z_lower.frction'; did you mean 'friction'?",
            ],
        ),
        (
            "domain.walls.z_lower={Friction = 1, friction = 1}",
            ["unknown key 'domain.walls.z_lower.Friction'; did you mean 'friction'?"],
        ),
        ("until=3", ["until: input should be 'duration' or 'rest' (got 3)"]),
    ],
)
def test_mistakes_are_told_in_keys_and_tables(override, lines):
    with pytest.raises(UserError) as error:
        load("line_bead", [override])
    assert [line.split(" with --set: ")[1] for line in str(error.value).splitlines()] == lines


def test_mistakes_are_told_five_at_a_time():
    with pytest.raises(UserError) as error:
        library.validate({f"wrong{i}": 1 for i in range(4)}, "here")
    assert len(str(error.value).splitlines()) == 6 and str(error.value).endswith("here: and 3 more mistakes")
    with pytest.raises(UserError) as error:
        library.validate({"wrong": 1, "spacing": 1.0, "duration": 1.0, "material": {"density": 1.0}}, "here")
    assert str(error.value).splitlines() == [
        "here: 'domain' is missing",
        "here: unknown key 'wrong'; known: " + ", ".join(sorted(library.Scenario.model_fields)),
    ]
    assert short("x" * 450) == "x" * 450 and short("x" * 451) == "x" * 450 + "..."


def test_words_are_quoted_and_suggested():
    assert quoted("x" * 58) == repr("x" * 58) and quoted("x" * 59) == "'" + "x" * 59 + "..."
    assert suggestion("Viscocity", ["viscosity", "density"]) == "; did you mean 'viscosity'?"
    assert suggestion("qqq", ["b", "a"]) == "; known: a, b" and suggestion("q", []) == ""
