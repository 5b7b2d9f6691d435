"""Hostile scenario files: what is no TOML, no table, no scenario; what they extend; how they are called."""

import random
from collections.abc import Iterator
from functools import partial

from .harness import EITHER, REFUSED, Case

GOOD = b'extends = "line_bead"\n'
DEPTH = 1200


def _unknown(count: int) -> bytes:
    return GOOD + b"".join(b"unknown_key_%08d = %d\n" % (i, i) for i in range(count))


def scenario_files(rng: random.Random) -> Iterator[Case]:
    """Contents of a file that is read as a scenario."""
    sort = "scenario files"
    broken = {
        "no TOML": b"= 3",
        "empty": b"",
        "a comment": b"# nothing\n",
        "binary": rng.randbytes(4096),
        "NUL": b"\0" * 100,
        "utf-16": 'extends = "line_bead"\n'.encode("utf-16"),
        "latin-1": GOOD + b'title = "caf\xe9"\n',
        "twice": GOOD + b"duration = 1.0\nduration = 2.0\n",
        "open string": GOOD + b'title = "open\n',
        "deep list": GOOD + b"gravity = " + b"[" * 3000 + b"]" * 3000 + b"\n",
        "deep table": GOOD + b"gravity = " + b"{a = " * 1500 + b"1" + b"}" * 1500 + b"\n",
        "deep key": GOOD + b".".join([b"a"] * 5000) + b" = 1\n",
        "long number": GOOD + b"seed = " + b"9" * 5000 + b"\n",
        "long hexadecimal": GOOD + b"seed = 0x" + b"f" * 5000 + b"\n",
        "open list": GOOD + b"gravity = [1.0, 2.0",
        "json": b'{"name": "x"}',
        "xml": b"<?xml version='1.0'?><a/>",
        "a date": GOOD + b"duration = 1979-13-99\n",
        "deep header": GOOD + b"[" + b".".join([b"a"] * 3000) + b"]\nb = 1\n",
    }
    for data in broken.values():
        for verb in ("compare", "show"):
            yield Case(sort, (verb, "case.toml"), files={"case.toml": data}, names=("case.toml",))
    shapes = {
        "material": (b"material = 5", b"material = []", b'material = "x"', b"[[material]]\ndensity = 1.0"),
        "domain": (b"domain = []", b"domain = true", b"domain = {lower = 5, upper = 6}"),
        "bodies": (
            b"bodies = 7",
            b"bodies = [5]",
            b"bodies = {}",
            b"bodies = [[]]",
            b"bodies = [{}]",
            b"bodies = [{kind = 5}]",
            b"[bodies]\na = 1",
        ),
        "numerics": (b"numerics = []", b"numerics = 5", b"numerics.mpm = 5", b"numerics.mpm = [1]"),
        "nozzle": (b"nozzle = 5", b"nozzle = [[]]"),
        "toolpath": (b"toolpath = 5", b"toolpath = []", b"toolpath.points = [[]]", b'toolpath.points = "text"'),
        "collider": (
            b"collider = 5",
            b"collider = {}",
            b"collider = {parts = 5}",
            b"collider = {parts = [{}]}",
            b"collider = {parts = []}",
        ),
        "cure": (b"material.cure = 5", b"material.cure = {}", b"material.cure = []"),
        "expansion": (b"material.expansion = 5", b"material.expansion = {}", b"material.expansion = {ratio = []}"),
        "name": (b"name = 5", b"name = []", b"name = {}"),
    }
    for key, texts in shapes.items():
        for text in texts:
            yield Case(sort, ("compare", "case.toml"), files={"case.toml": GOOD + text + b"\n"}, names=(key,))
    for text in (b"quick = 5", b"quick = []", b'quick = "x"', b"quick = true", b"[[quick]]\nduration = 0.5"):
        file = {"case.toml": GOOD + text + b"\n"}
        yield Case(sort, ("compare", "case.toml", "--quick"), files=file, names=("quick",))
        yield Case(sort, ("compare", "case.toml"), EITHER, files=file)
    for text in (b'spacing = "x"', b"spacing = []", b"spacing = {}", b"spacing = nan", b"spacing = true"):
        yield Case(sort, ("run", "case.toml", "--quick"), files={"case.toml": GOOD + text}, names=("spacing",))
    for count in (10, 1000, 20_000):
        file = {"case.toml": _unknown(count)}
        yield Case(sort, ("compare", "case.toml"), files=file, names=("unknown_key_",))
    yield Case(
        sort, ("compare", "case.toml"), files={"case.toml": GOOD + b"u" * 10**6 + b" = 1\n"}, names=("case.toml",)
    )
    big = {"case.toml": partial(_unknown, 770_000)}  # 20 MB
    yield Case(sort, ("compare", "case.toml"), files=big, names=("case.toml",), limit=180)
    many = b"bodies = [" + b"{kind = 5}, " * 3000 + b"]\n"
    yield Case(sort, ("compare", "case.toml"), files={"case.toml": GOOD + many}, names=("bodies",))


def references(rng: random.Random) -> Iterator[Case]:
    """What is given for a scenario: neither a shipped name nor a file."""
    given = (
        "",
        ".",
        "..",
        "/",
        "/dev/null",
        "/dev/zero",
        "x" * 255,
        "x" * 5000,
        "x" * 5000 + ".toml",
        "a/" * 2000 + "b.toml",
        "../../../../../../etc/passwd",
        "\x1b[31mred",
        "a\x00b",
        "a\x00b.toml",
        "line_bead\n",
        "*.toml",
        "LINE_BEAD",
        "line-bead",
        "folder",
        "folder.toml",
        "nothing.toml",
        "\udcff",
        "\udcff.toml",
        "名前",
        "~",
        "$HOME",
        "file:///x.toml",
        "https://example.org/x.toml",
        "con",
        "line_bead.toml",
        "line_bead/",
        "./line_bead",
        " ",
        "0",
        "nan",
        "None",
    )
    for text in given:
        verb = rng.choice(("compare", "run", "show", "stability", "ablate", "select", "table1"))
        words = (verb, "--", text) if text.startswith("-") else (verb, text)
        told = ("scenario", "file", "not valid toml", "extends")
        yield Case("scenario references", words, names=told, folders=("folder", "folder.toml"))


def extends(rng: random.Random) -> Iterator[Case]:
    """What a file extends."""
    sort, verbs = "extends", ("compare", "run", "show", "select")
    wrong = (
        "5",
        "5.0",
        "true",
        "false",
        "[]",
        '["line_bead"]',
        "{}",
        '{file = "line_bead"}',
        "nan",
        "1979-05-27",
        '[["x"]]',
        "inf",
        "[1, 2]",
        "-1",
        "{a = {b = 1}}",
    )
    for text in wrong:
        yield Case(sort, (rng.choice(verbs), "case.toml"), files=_extending(text), names=("extends",))
    missing = (
        "missing.toml",
        "missing",
        "",
        ".",
        "..",
        "/",
        "folder",
        "x" * 5000,
        "x" * 5000 + ".toml",
        "a\\u0000b.toml",
        "\\u001b[31m",
        "line_beed",
        "/dev/null",
        "a\\nb",
        "../case",
        "a\\u0000b",
    )
    for text in missing:
        told = ("extends", "case.toml", "no such scenario", "no scenario named")
        yield Case(
            sort, (rng.choice(verbs), "case.toml"), files=_extending(f'"{text}"'), names=told, folders=("folder",)
        )
    yield Case(sort, ("compare", "case.toml"), files=_extending('"case.toml"'), names=("extends",))
    circle = {
        "case.toml": b'extends = "b.toml"\n',
        "b.toml": b'extends = "c.toml"\n',
        "c.toml": b'extends = "case.toml"\n',
    }
    yield Case(sort, ("compare", "case.toml"), files=circle, names=("extends",))
    for verb in ("compare", "show"):
        yield Case(sort, (verb, "0.toml"), REFUSED, ("extends",), files=_chain(DEPTH))
        yield Case(sort, (verb, "0.toml"), EITHER, files=_chain(40))


def _extending(text: str) -> dict[str, bytes]:
    return {"case.toml": f"extends = {text}\n".encode()}


def _chain(depth: int) -> dict[str, bytes]:
    chain = {f"{i}.toml": f'extends = "{i + 1}.toml"\n'.encode() for i in range(depth)}
    return chain | {f"{depth}.toml": GOOD}
