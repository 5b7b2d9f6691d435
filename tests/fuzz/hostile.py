"""Seeded cases of hostile input by class: every key of the scenario model by every hostile value and every way in."""

import itertools
import random
from collections.abc import Callable, Iterator
from typing import Any

from . import files, options
from .harness import EITHER, REFUSED, Case
from .leaves import CHOICE, FLAG, NUMBER, OWN, TEXT, VECTOR, Leaf, changed, leaves, table
from .toml import Raw, dump

NUMBERS = (
    "nan",
    "-nan",
    "inf",
    "-inf",
    '"text"',
    '""',
    "[]",
    "{}",
    "[1.0]",
    '"nan"',
    '"inf"',
    "1979-05-27",
    "text",
    "1.2.3",
    '"' + "x" * 20_000 + '"',
    '"\\u0000\\u001b[31m"',
    '"ﬂüssig"',
    "9" * 400,
    "9" * 5000,
    "[" * 1200 + "]" * 1200,
    "{a.b.c = 1}",
    "0x",
    "1e",
    "NaN",
    "Infinity",
    "∞",
)
BOOLEANS = ("true", "false")
BEYOND = ("1e300", "-1e300", "1e-300", "1e308", "-1e-300", "5e-324")
PERHAPS = ("1e30", "-1e30", "1e15", "1e-15", "-1", "0", "none", '"1e3"', "1_000.0", "0b1", "1e3", "-0.0")
CHOICES = ('"text"', "nan", "5", "true", "[]", "{}", '""', '"' + "x" * 20_000 + '"', '"LINE"', '"\\u0000"')
FLAGS = ('"text"', "nan", "[]", "{}", "5", "1e300")
TEXTS = ("5", "nan", "true", "[]", "{}", "1979-05-27")
TITLES = (
    '"\\u0000\\u001b[31m"',
    '"' + "x" * 20_000 + '"',
    '"名前 \\U0001F600"',
    '"{{ 7 * 7 }}<script>"',
    "\udcff",
    '"a\\nb"',
)
VERBS = ("compare", "compare", "compare", "run", "show", "stability", "ablate", "select", "table1")
NO_EFFECT = (
    ("line_bead", "numerics.MPM", "{grid_ratio = 2.0}", "mpm"),
    ("line_bead", "numerics.mmp", "{grid_ratio = 2.0}", "mpm"),
    ("line_bead", "numerics.SPH.cfl", "0.3", "sph"),
    ("line_bead", "numerics.pbdd.iterations", "4", "pbd"),
    ("line_bead", "numerics.mpm.Grid_ratio", "2.0", "grid_ratio"),
    ("line_bead", "toolpath.center", "[0.0, 0.0]", ""),
    ("line_bead", "toolpath.radius", "0.1", ""),
    ("line_bead", "toolpath.points", "[[0.0, 0.0], [0.01, 0.0]]", ""),
    ("line_bead", "toolpath.dwell", "1.0", ""),
    ("ring_tower", "toolpath.start", "[0.0, 0.0]", ""),
    ("ring_tower", "toolpath.end", "[0.1, 0.0]", ""),
    ("ring_tower", "toolpath.points", "[[0.0, 0.0], [0.01, 0.0]]", ""),
    ("ring_tower", "toolpath.dwell", "1.0", ""),
    ("wall", "toolpath.radius", "0.1", ""),
    ("wall", "toolpath.center", "[0.0, 0.0]", ""),
    ("polyline", "toolpath.start", "[0.0, 0.0]", ""),
    ("polyline", "toolpath.radius", "0.1", ""),
    ("dam_break", "bodies.0.radius", "0.01", ""),
    ("dam_break", "bodies.0.height", "0.01", ""),
    ("bodies", "bodies.1.size", "[0.1, 0.1, 0.1]", ""),
    ("bodies", "bodies.2.size", "[0.1, 0.1, 0.1]", ""),
    ("bodies", "bodies.2.height", "0.1", ""),
    ("ring_tower_drone", "collider.parts.1.size", "[0.1, 0.1, 0.1]", ""),
    ("ring_tower_drone", "collider.parts.0.radius", "0.1", ""),
    ("ring_tower_drone", "material.expansion.passes", "3", ""),
    ("ring_tower_drone", "material.expansion.impulse", "0.5", ""),
    ("ring_tower_drone", "material.expansion.interval", "0.5", ""),
    ("ring_tower_drone", "material.expansion.radius", "2.0", ""),
    ("ring_tower_drone", "material.expansion.noise", "0.5", ""),
    ("ring_tower_drone", "material.expansion.margin", "1.0", ""),
    ("spawn", "material.expansion.time", "2.0", ""),
    ("spawn", "material.expansion.split", "false", ""),
)
"""(base, key, value, word of the nearest key that has an effect)."""
CURES = {
    "jump": ("time", "rate", "stages", "rate_autocatalytic", "exponent"),
    "stages": ("rate", "rate_autocatalytic", "exponent"),
    "linear": ("rate", "stages", "rate_autocatalytic", "exponent"),
    "first_order": ("time", "stages", "rate_autocatalytic", "exponent"),
    "kamal_sourour": ("time", "stages", "exponent"),
    "avrami": ("time", "stages", "rate_autocatalytic"),
}
"""Of each law of curing the keys that only others use."""
NAMES = (
    "../../climbed",
    "..",
    ".",
    "",
    "{base}/absolute",
    "../../../climbed",
    "a/b",
    "a/../b",
    "/",
    "./here",
    "a\nb",
    "a\tb",
    "\x00",
    "a\x1b[31mb",
    "\x7f",
    "x" * 300,
    "x" * 5000,
    "é" * 200,
    "runs/../../up",
)
ODD_NAMES = ("-x", " ", "a b", "名前", "CON", "a\\b", "~", "a.b", "$HOME", "a;b", "x" * 60, "{{name}}", "%s", "x" * 250)


def words(verb: str, reference: str, *rest: str, out: bool = True) -> tuple[str, ...]:
    """A command line of a verb that takes a scenario."""
    return (verb, reference, *rest, *(("--out", "out") if out and verb != "show" else ()))


def ways(sort: str, leaf: Leaf, literal: str, expect: str, names: tuple[str, ...], rng: random.Random) -> Case:
    """A case that gives a key a value: by --set, in a file of its own, over `extends`, or in [quick]."""
    verb, out = rng.choice(VERBS), rng.random() < 0.5
    whole = ".".join(p for p in leaf.path.split(".") if not p.isdigit()) == leaf.path
    way = rng.choice(("set", "set", "file", "extends", "quick") if whole else ("set", "set", "file"))
    given = table(leaf.base)
    name, base = (leaf.base, {}) if leaf.base not in OWN else ("base.toml", {"base.toml": dump(given)})
    if way == "set" or literal == "none":
        return Case(sort, words(verb, name, "--set", f"{leaf.path}={literal}", out=out), expect, names, files=base)
    if way == "file":
        made = dump(changed(leaf.base, leaf.path, Raw(literal)))
        return Case(sort, words(verb, "case.toml", out=out), expect, names, files={"case.toml": made})
    parts = f"[quick]\n{leaf.path} = {literal}\n" if way == "quick" else f"{leaf.path} = {literal}\n"
    text = f'extends = "{name}"\n{parts}'.encode("utf-8", "surrogateescape")
    if way == "quick":
        verb = "compare"
    rest = ("--quick",) if way == "quick" else ()
    return Case(sort, words(verb, "case.toml", *rest, out=out), expect, names, files={"case.toml": text} | base)


def _named(leaf: Leaf, literal: str = "") -> tuple[str, ...]:
    """What a refusal names: the key; for what is no value in TOML the file's name will do."""
    readable = (
        literal[:1] in '"[{-0123456789tfni' and literal not in ("1.2.3", "text", "0x", "1e") and len(literal) < 2000
    )
    return (leaf.key,) if readable else (leaf.key, "case.toml")


def numbers(rng: random.Random) -> Iterator[Case]:
    for leaf, literal in itertools.product(_of(NUMBER), NUMBERS):
        yield ways("numbers that are none", leaf, literal, REFUSED, _named(leaf, literal), rng)


def booleans(rng: random.Random) -> Iterator[Case]:
    for leaf, literal in itertools.product(_of(NUMBER), BOOLEANS):
        yield ways("booleans as numbers", leaf, literal, REFUSED, _named(leaf), rng)


def magnitudes(rng: random.Random) -> Iterator[Case]:
    """A message may speak of the table that no longer fits together, as in 'the toolpath leaves the domain'."""
    for leaf, literal in itertools.product(_of(NUMBER), BEYOND):
        yield ways("beyond any physics", leaf, literal, REFUSED, (leaf.key, leaf.path.split(".")[0]), rng)


def limits(rng: random.Random) -> Iterator[Case]:
    """Numbers that a key's own limits exclude, and numbers that may or may not pass."""
    for leaf, literal in itertools.product(_of(NUMBER), PERHAPS):
        try:
            expect = REFUSED if leaf.forbids(float(literal)) else EITHER
        except ValueError:
            expect = EITHER
        if expect == REFUSED and literal.startswith(('"', "none")):
            expect = EITHER
        yield ways("outside a key's limits", leaf, literal, expect, (leaf.key,) if expect == REFUSED else (), rng)


def vectors(rng: random.Random) -> Iterator[Case]:
    """Vectors with one hostile component, of the wrong length, or no vectors at all."""
    for leaf in _of(VECTOR):
        matrix = leaf.key in ("body_force_gradient", "velocity_gradient") and not leaf.path[-1].isdigit()
        good = ["[0.0, 0.0, 0.0]"] * 3 if matrix else ["0.01"] * leaf.size
        for bad in ("nan", "inf", "-inf", "true", '"a"', "[]", "{}", "1e300", '"nan"', "1e-300"):
            i = rng.randrange(leaf.size)
            row = f"[{bad}, 0.0, 0.0]" if matrix else bad
            text = f"[{', '.join([*good[:i], row, *good[i + 1 :]])}]"
            told = (leaf.key, leaf.path.split(".")[0]) if bad.startswith("1e") else (leaf.key,)  # see `magnitudes`
            yield ways("vectors", leaf, text, REFUSED, told, rng)
        for text in (
            "[]",
            f"[{', '.join([*good, good[0]])}]",
            good[0] if not matrix else "1.0",
            '"text"',
            "{}",
            "nan",
            f"[[{', '.join(good)}]]",
            f"[{', '.join(['0.0'] * 100_000)}]",
            "true",
        ):
            yield ways("vectors", leaf, text, REFUSED, (leaf.key,), rng)


def other_values(rng: random.Random) -> Iterator[Case]:
    """Words, flags and texts."""
    for leaf, literal in itertools.product(_of(CHOICE), CHOICES):
        yield ways("words and flags", leaf, literal, REFUSED, _named(leaf, literal), rng)
    for leaf, literal in itertools.product(_of(FLAG), FLAGS):
        yield ways("words and flags", leaf, literal, REFUSED, _named(leaf), rng)
    for leaf, literal in itertools.product(_of(TEXT), TEXTS):
        yield ways("words and flags", leaf, literal, REFUSED, _named(leaf), rng)
    title = next(leaf for leaf in _of(TEXT) if leaf.path == "title")
    for literal in TITLES:
        yield ways("words and flags", title, literal, EITHER, (), rng)


def no_effect(rng: random.Random) -> Iterator[Case]:
    for base, key, value, near in NO_EFFECT:
        yield ways("keys without effect", Leaf(key, NUMBER, base), value, REFUSED, _last_two(key), rng)
        if near:
            yield Case("keys without effect", words("compare", base, "--set", f"{key}={value}"), says=near)
    values = {"time": "0.5", "rate": "2.0", "stages": "7", "rate_autocatalytic": "1.0", "exponent": "3.0"}
    for kind, keys in CURES.items():
        needs = {"stages": "time = 1.0", "linear": "time = 1.0", "jump": ""}.get(kind, "rate = 1.0")
        for key in keys:
            own = f'kind = "{kind}"\ndelay = 0.3\nyield_stress = 500.0\n{needs}\n{key} = {values[key]}\n'
            text = f'extends = "line_bead"\n[material.cure]\n{own}'.encode()
            yield Case("keys without effect", words("compare", "cure.toml"), names=(key,), files={"cure.toml": text})


def _last_two(key: str) -> tuple[str, ...]:
    parts = [part for part in key.split(".") if not part.isdigit()]
    return tuple(parts[1:]) if parts[0] == "numerics" else (parts[-1],)


def names(rng: random.Random) -> Iterator[Case]:
    """Names that are no names of folders, by --set and in files, with and without --out."""
    for name, expect in [*((n, REFUSED) for n in NAMES), *((n, EITHER) for n in ODD_NAMES)]:
        literal = dump({"name": name}).decode().partition("=")[2].strip()
        for out in (True, False):
            told = ("name",) if expect == REFUSED else ()
            if "\\" not in literal:
                yield Case("names", words("run", "line_bead", "--set", f"name={name}", out=out), expect, told)
            yield Case("names", words("select", "line_bead", "--set", f"name={literal}", out=out), expect, told)
            file = f'extends = "line_bead"\nname = {literal}\n'.encode()
            yield Case("names", words("compare", "n.toml", out=out), expect, told, files={"n.toml": file})


def _of(kind: str) -> list[Leaf]:
    return [leaf for leaf in leaves() if leaf.kind == kind]


GENERATORS: tuple[tuple[Callable[[random.Random], Iterator[Case]], int, int], ...] = (
    (numbers, 240, 18),
    (booleans, 80, 6),
    (magnitudes, 160, 12),
    (limits, 140, 10),
    (vectors, 150, 12),
    (other_values, 60, 6),
    (no_effect, 200, 10),
    (names, 110, 10),
    (options.too_much, 80, 10),
    (options.lists, 90, 10),
    (options.numbers, 160, 14),
    (options.verbs, 60, 6),
    (options.settings, 90, 8),
    (files.scenario_files, 200, 10),
    (files.references, 50, 6),
    (files.extends, 50, 6),
    (options.legitimate, 400, 14),
)
"""(class, at most so many in the long fuzz, in the default suite)."""


def cases(seed: int, short: bool) -> dict[str, list[Case]]:
    """Class -> cases; the short list is another draw from the same classes."""
    found: dict[str, list[Case]] = {}
    for make, many, few in GENERATORS:
        rng = random.Random(f"{seed} {make.__name__}")
        drawn: list[Any] = [case for case in make(rng) if not (short and case.limit > 10)]
        rng.shuffle(drawn)
        chosen = drawn[: few if short else many]
        found.setdefault(chosen[0].sort, []).extend(chosen)
    return found
