"""Hostile options of every verb, hostile --set texts, wishes that no machine can grant, and input that is right."""

import itertools
import random
from collections.abc import Iterator

from .harness import ACCEPTED, EITHER, REFUSED, Case
from .leaves import OWN, SHIPPED
from .toml import dump

BARE: dict[str, tuple[str, ...]] = {
    "compare": ("compare", "line_bead"),
    "run": ("run", "line_bead"),
    "sweep": ("sweep", "line_bead", "--over", "material.yield_stress=20,50"),
    "validate": ("validate", "free_fall"),
    "stability": ("stability",),
    "bench": ("bench", "--quick", "--solvers", "mpm"),
    "ablate": ("ablate", "line_bead"),
    "select": ("select", "line_bead"),
    "guide": ("guide", "line_bead"),
    "table1": ("table1", "--quick"),
    "table2": ("table2", "--quick"),
    "show": ("show", "line_bead"),
    "render": ("render", "missing"),
    "list": ("list",),
    "doctor": ("doctor",),
    "init": ("init", "--defaults"),
}
WITHOUT_OUT = ("show", "render", "list", "doctor", "init")
STUDIES = tuple(verb for verb in BARE if verb not in WITHOUT_OUT)
HAS = {
    "--solvers": ("compare", "sweep", "validate", "stability", "bench", "ablate", "select", "guide", "table2"),
    "--over": ("sweep",),
    "--worlds": ("sweep",),
    "--from": ("table1", "table2", "guide"),
    "--seed": ("validate", "table1"),
    "--particles": ("bench",),
    "--axis": ("stability",),
    "--levels": ("validate",),
    "--pools": ("table2",),
    "--variants": ("table2",),
    "--backend": STUDIES,
    "--device": STUDIES,
    "--threads": STUDIES,
    "--spacing": ("compare", "run", "sweep", "stability", "ablate", "select", "table1", "show"),
    "--out": STUDIES,
    "--wall-limit": STUDIES,
    "--render-every": ("compare", "run"),
    "--repeats": ("compare", "table1", "table2"),
    "--jobs": STUDIES,
    "--executor": STUDIES,
    "--tolerance": ("ablate", "select", "guide"),
    "--budget": ("select",),
    "--within": ("select", "guide"),
    "--colour": ("render",),
    "--pace": ("render",),
    "--solver": ("run",),
    "--checkpoint-every": ("compare", "run"),
    "--measured": ("compare", "run", "select"),
    "--set": ("compare", "run", "sweep", "stability", "ablate", "select", "table1", "show"),
}
"""Option with a value -> verbs; a test holds it against the application."""
LISTS = {
    "--solvers": (
        ",",
        " , ",
        ",,,",
        "mpm,mpm",
        "mpm,sph,mpm",
        "mpn",
        "mpm;sph",
        "MPM",
        "mpm sph",
        "x" * 5000,
        "\x00",
        "mpm,\x1b[31m",
        "nan",
        "1e300",
    ),
    "--over": (
        "",
        "=",
        "=1,2",
        "material.yield_stress",
        "material.yield_stress=",
        "material.yield_stress=,",
        "material.yield_stress=20:200",
        "material.yield_stress=20:200:5:log:7",
        "material.yield_stress=20:200:1",
        "material.yield_stress=20:200:-5",
        "material.yield_stress=20:200:1.5",
        "material.yield_stress=20:200:1e3",
        "material.yield_stress=20:200:" + "9" * 5000,
        "material.yield_stress=0:200:5:log",
        "material.yield_stress=nan:200:5",
        "material.yield_stress=20:inf:5",
        "material.yield_stress=20,nan",
        "material.yield_stress=20,1e300",
        "material.yield_stress=20,20",
        "material.yield_stress=20,20.0",
        "material.yield_stress=50,80",
        "material.yeild_stress=20,50",
        "material.youngs_modulus=20:1e300:3:log",
        "nozzle.exit_speed=1e-300:1e300:5:log",
        "spacing=1e-12,1e-9",
        "spacing=1:2:10000",
        "material=1,2",
        "\x00=1,2",
        "\x1b[31m=1,2",
        "x" * 5000 + "=1,2",
        "numerics.mpm=1,2",
        "domain.lower=1,2",
    ),
    "--from": ("missing", "", ".", "/dev/null", "file", "x" * 5000, "a\x00b", "\udcff", "名前"),
    "--axis": (",", " ,, ", "density,density", "viscocity", "density;spacing", "x" * 5000, "nan", "Density"),
    "--levels": (",", "", " ", "coarse,coarse", "corse", "coarse;fine", "1.5", "nan", "x" * 5000),
    "--variants": (",", "", " ", "plain,plain", "plian", "plain;curing", "nan", "Plain", "1", "x" * 5000),
    "--pools": (
        ",",
        "",
        " ",
        "fit,fit",
        "298000,298000",
        "fit,298000,fit",
        "298k",
        "0",
        "-1",
        "1.5",
        "nan",
        "inf",
        "1e5",
        "true",
        "x" * 5000,
        "fitt",
        "9" * 5000,
        "²",
        "0x10",
    ),
    "--particles": (
        ",",
        "",
        " ",
        "216,216",
        "298k",
        "0",
        "-1",
        "1.5",
        "nan",
        "inf",
        "1e5",
        "true",
        "x" * 5000,
        "fit",
        "9" * 5000,
        "²",
        "0x10",
    ),
    "--backend": (
        ",",
        "",
        " ",
        "warp,warp",
        "wrap",
        "WARP",
        "taichi,taichi",
        "cuda",
        "x" * 5000,
        "warp;taichi",
        "\x00",
    ),
    "--device": ("", "gpu", "cuda:99", "cuda:-1", "cuda:nan", "cpu:1e300", "x" * 5000, "cpu,cpu", "\x1b[31m"),
    "--solver": (",", "mpm,mpm", "mpn", "x" * 5000, "MPM", " "),
    "--colour": ("layers", "", "x" * 5000, "nan"),
    "--executor": (
        "there",
        "Slurm",
        " slurm",
        "x" * 5000,
        "nan",
        ":",
        ":a=1",
        "local:nonsense",
        "local:a",
        "local:timeout_min=1,a",
        "local:,,x",
        "\x1b[31m",
        "\x00",
        "slurm,local",
    ),
}
"""Lists and names that are empty, repeated or misspelt."""
REALS = (
    "nan",
    "-nan",
    "inf",
    "-inf",
    "-1",
    "1e300",
    "-1e300",
    "1e-300",
    "text",
    "",
    "1,5",
    "5s",
    "true",
    "0x10",
    "1e999",
)
WHOLES = ("0", "-1", "1.5", "nan", "inf", "1e300", "text", "", "true", "9" * 30, "9" * 5000, "-" + "9" * 30)
TIMES = (
    "nan",
    "inf",
    "-5",
    "-5s",
    "0",
    "0s",
    "soon",
    "s",
    "nans",
    "infs",
    "infm",
    "1e300h",
    "1e300",
    "1e-300s",
    "5d",
    "1e999",
    "5,5s",
    "h",
    "x" * 5000,
)
VALUES = {
    "--within": (*TIMES, "", "none", "1s"),
    "--wall-limit": REALS,
    "--pace": (*REALS, "0"),
    "--checkpoint-every": REALS,
    "--render-every": (*REALS, "0", "1e-12"),
    "--spacing": (*REALS, "0", "1e-12"),
    "--repeats": WHOLES,
    "--threads": WHOLES,
    "--jobs": WHOLES,
    "--worlds": WHOLES,
    "--seed": [v for v in WHOLES if v != "0"],
    "--tolerance": (
        "5",
        "1.5",
        "nan",
        "inf",
        "-1",
        "0",
        "0%",
        "-5%",
        "nan%",
        "inf%",
        "much",
        "",
        "%",
        "5%%",
        "1e300",
        "1e300%",
        "1e-300",
        "1e-300%",
        "5,0%",
        "2",
    ),
    "--budget": TIMES,
}
"""Numbers that are none, have no sense, or are beyond any physics."""
MAY = {
    "--wall-limit": ("0", "1_000", "１"),
    "--threads": ("1",),
    "--jobs": ("1_0",),
    "--worlds": ("1", "1_0"),
    "--seed": ("0", "1_0"),
    "--tolerance": ("500%", "1", "٥%"),
    "--budget": ("", "none", " 60s ", "٥s"),
    "--pools": ("٣٠٠٠٠٠", "5"),
    "--solvers": ("", "mpm,", ",mpm"),
    "--axis": ("",),
    "--solver": ("", "mpm,sph"),
    "--backend": ("warp,",),
    "--out": (".", "a\x1b[31mb", "\udcff", "名前", "-x"),
}
OUTS = ("", " ", "/proc/nowhere", "/dev/null/x", "file", "file/below", "x" * 5000, "a\x00b", "/sys/x", "x/" * 3000)
AMOUNT = r"(?i)\d[^\n]{0,40}(particle|step|tick|byte|[kmgtpezy]i?b\b|output|snapshot|picture|slot|run|core|thread)"


def command(verb: str, *rest: str) -> tuple[str, ...]:
    """A verb's shortest command line with more words, and an output folder where it has one."""
    given = verb in WITHOUT_OUT or any(word.startswith("--out") for word in rest)
    out = () if given else ("--out", "out")
    return (*BARE[verb], *rest, *out)


def lists(rng: random.Random) -> Iterator[Case]:
    for option, values in LISTS.items():
        for verb, value in itertools.product(HAS[option], values):
            told = (
                option,
                option.strip("-"),
                "over",
                "one folder down",
                "xxx",
                "solver",
                "axis",
                "level",
                "backend",
                "device",
                "colour",
                "no run here",
                "--executor",
            )
            yield Case("lists and names of options", command(verb, f"{option}={value}"), names=told)
    for verb in HAS["--spacing"]:
        twice = command(verb, "--spacing", "2mm", "--set", "spacing=3e-3")
        yield Case("lists and names of options", twice, names=("--spacing and --set spacing",))
    for verb in HAS["--backend"]:
        if verb != "compare":
            one = command(verb, "--backend", "warp,taichi")
            yield Case("lists and names of options", one, names=("--backend", "backend"))
    for twice in (
        ("free_fall", "free_fall"),
        ("free_fall", "free_fal"),
        ("",),
        ("x" * 5000,),
        ("free_fall,dam_break",),
    ):
        yield Case("lists and names of options", ("validate", *twice, "--out", "out"), names=("case",))


def numbers(rng: random.Random) -> Iterator[Case]:
    sort = "numbers of options"
    for option, values in VALUES.items():
        for verb, value in itertools.product(HAS[option], values):
            many = option == "--jobs" and value == "9" * 30  # no more of them start than there are runs
            expect = EITHER if many else REFUSED
            told = (option, option.strip("-"), *(["runs at a time"] if option == "--jobs" else []))
            yield Case(sort, command(verb, f"{option}={value}"), expect, names=told)
    for option, values in MAY.items():
        for verb, value in itertools.product(HAS[option], values):
            yield Case(sort, command(verb, f"{option}={value}"), EITHER)
    for verb, value in itertools.product(HAS["--out"], OUTS):
        yield Case(sort, command(verb, f"--out={value}"), names=("output folder", "--out"), files={"file": b"mine"})


def verbs(rng: random.Random) -> Iterator[Case]:
    """Options and arguments that no verb has, flags with values, folders that hold no run."""
    sort = "verbs and flags"
    yield Case(sort, ("nosuchverb",), names=("nosuchverb",))
    yield Case(sort, ("--nosuch",), names=("--nosuch",))
    yield Case(sort, ("x" * 5000,))
    for verb in BARE:
        yield Case(sort, command(verb, "--no-such-option"), names=("--no-such-option",))
        yield Case(sort, command(verb, "--no-such-option=nan"), names=("--no-such-option",))
        if verb != "validate":
            yield Case(sort, command(verb, "extra", "more", "words"))
        yield Case(sort, (verb, "--help"), ACCEPTED)
    for verb in ("compare", "run", "validate", "stability", "table1", "table2"):
        yield Case(sort, command(verb, "--quick=5"), names=("--quick",))
    for verb in ("compare", "run", "ablate", "select", "show", "render"):
        yield Case(sort, (verb,), names=("scenario", "run"))
    for verb, option in ((v, o) for o, has in HAS.items() for v in has):
        yield Case(sort, (*BARE[verb], option), names=(option,))
    for where in ("missing", "", ".", "/dev/null", "file", "empty", "x" * 5000, "a\x00b", "\udcff"):
        told = ("no run", "record.json", "run")
        yield Case(sort, ("render", where), names=told, files={"file": b"x"}, folders=("empty",))
    for verb, where in itertools.product(
        HAS["--measured"], ("missing", "", ".", "/dev/null", "file", "x" * 5000, "a\x00b")
    ):
        told = ("missing", "file", "x" * 9, "null", "'.'", "a")
        yield Case(sort, command(verb, f"--measured={where}"), names=told, files={"file": b"\xff\x00,"})
    for junk in (
        "quantity,value\nwidth,nan",
        "quantity,value\nwidth,1e99",
        "value,value\n1,2",
        '"',
        "quantity,value\n,",
    ):
        more = command("compare", "--measured=m.csv")
        yield Case(sort, more, names=("m.csv",), files={"m.csv": junk.encode()})
    for junk in (b"", b"\x00\xff" * 50, b"[]", b"5", b"{}", b"null", b'{"verdict": "completed"}', b'{"input": 5}'):
        files = {"run/record.json": junk, "run/final.npz": junk}
        yield Case(sort, ("render", "run"), names=("record.json", "no run", "no particles"), files=files)


def settings(rng: random.Random) -> Iterator[Case]:
    """What is no key=value, or a key that cannot be."""
    wrong = (
        "nonsense",
        "=5",
        "",
        "=",
        " = 5",
        "a..b=1",
        ".=1",
        "material.=1",
        "..=1",
        "material.density.x=1",
        "domain.lower.7=0",
        "domain.lower.-1=0",
        "domain.lower.²=1",
        "domain.lower.1e3=0",
        "domain.lower.x=1",
        "domain.lower=none",
        "bodies.0.center=[0, 0, 0]",
        "title.x=1",
        "material=5",
        "material=none",
        "domain=none",
        "duration=none",
        "toolpath=none",
        "spacing=none",
        "a.b.c.d.e=1",
        ".".join(["a"] * 5000) + "=1",
        "x" * 20_000 + "=1",
        "material.densty=1",
        "Material.density=1",
        "material.Density=1",
        "material .density=1",
        "material.density =nan",
        "domain.walls.q_lower=slip",
        "domain.walls.z_lower=slippery",
        "domain.walls.z_lower={friction = -1}",
        "\x00=1",
        "\x1b[31m=1",
        "名前=1",
        "material[density]=1",
        "material/density=1",
        "--set=1",
        "quick.duration=1",
        "extends=5",
        "gravity=" + "[" * 3000,
        "gravity=" + "[" * 900 + "]" * 900,
        "material={}",
        "material={density = nan}",
        "domain.walls=5",
        "nozzle={}",
        "toolpath.points=[[]]",
        "seed=" + "9" * 5000,
        "pool=0.5",
        "layers=3",
        "numerics=5",
        "numerics.mpm=5",
        "numerics.mpm.grid_ratio={}",
        "numerics.mpm.=1",
        "numerics=none\n",
        "domain.lower.0=none",
        "material.density=1\nviscosity=2\n[",
        "toolpath.layers=1e18",
        "toolpath.layers=100000",
        "reference=nothing",
        "domain.lower.00000=nan",
        "domain.lower.٠=nan",
        "collider={parts = []}",
        "bodies=[]\x00",
        "bodies=[1]",
    )
    lenient = {"numerics=none\n", "domain.lower=none", "material.density=1\nviscosity=2\n["}
    for text, verb in itertools.product(wrong, ("compare", "show")):
        key = text.partition("=")[0].strip()
        told = tuple(part.strip() for part in key.split(".") if part.strip() and len(part) < 100)[-2:]
        expect = EITHER if text in lenient else REFUSED
        yield Case(
            "texts of --set", command(verb, "--set", text), expect, ("--set", *told) if expect == REFUSED else ()
        )
    for text in ("a=1", "title=5", "material.density=1000"):  # later words win, or are refused
        yield Case("texts of --set", command("run", "--set", text, "--set", text, "--spacing", "0.002"), EITHER)


def too_much(rng: random.Random) -> Iterator[Case]:
    """Particles, steps, outputs and bytes that no machine has: the refusal says how many."""
    sort, wishes = "more than a machine has", []
    for verb in HAS["--spacing"]:
        for value in ("1e-12", "1e-9", "1e-7"):
            wishes += [(verb, "spacing", ("--spacing", value)), (verb, "spacing", ("--set", f"spacing={value}"))]
        for value in ("1e-12", "1e-15"):
            wishes += [
                (verb, "tick", ("--set", f"tick={value}")),
                (verb, "output_interval", ("--set", f"output_interval={value}")),
            ]
        wishes += [(verb, "pool", ("--set", f"pool={n}")) for n in (10**18, 10**15, 10**30)]
    for verb, key, rest in wishes:
        yield Case(sort, command(verb, *rest), names=(key,), says=AMOUNT)
    for verb in ("compare", "show", "select"):
        for value in ("1e-12", "1e-8"):
            yield Case(sort, (verb, "dam_break", "--spacing", value), names=("spacing",), says=AMOUNT)
        for key, value in (("domain.upper", "[1e30, 1e30, 1e30]"), ("domain.lower", "[-1e30, -1e30, 0.0]")):
            yield Case(sort, command(verb, "--set", f"{key}={value}"), names=("domain",))
            huge = ("--set", "domain.upper=[1e30, 1e30, 1e30]", "--set", "bodies.0.size=[1e30, 1e30, 1e30]")
            yield Case(sort, (verb, "dam_break", *huge), names=("domain", "bodies"))
    for value in (10**18, 10**15):
        yield Case(sort, command("table2", "--pools", str(value)), names=("pool",), says=AMOUNT)
        yield Case(sort, command("table2", "--pools", f"fit,{value}"), names=("pool",), says=AMOUNT)
        for option in ("--repeats", "--jobs"):
            for verb in HAS[option]:
                expect = EITHER if option == "--jobs" else REFUSED
                told = (option, option.strip("-"), *(["runs at a time"] if option == "--jobs" else []))
                yield Case(sort, command(verb, option, str(value)), expect, names=told)
        for verb in HAS["--threads"]:
            yield Case(sort, command(verb, "--backend", "taichi", "--threads", str(value)), names=("thread",))
    for value in ("1e-12", "1e-10"):
        yield Case(sort, command("run", "--render-every", value), names=("render-every", "picture", "render_every"))


def legitimate(rng: random.Random) -> Iterator[Case]:
    """What is extreme but physical, odd but right: refusing everything is no way to pass."""
    sort, right = "input that is right", []
    for name in (
        *SHIPPED,
        "ring_tower",
        "wall",
        "ring_tower_curing",
        "ring_tower_expansion",
        "ring_tower_expansion_curing",
    ):
        right += [("show", name), ("compare", name), ("run", name), ("run", name, "--quick"), ("select", name)]
    sets = (
        "material.viscosity=1e3",
        "spacing=1e-3",
        "material.density=1e4",
        "material.density=10",
        "material.youngs_modulus=1e9",
        "material.poisson_ratio=0.499",
        "material.poisson_ratio=-0.5",
        "material.yield_stress=0",
        "gravity=[0, 0, 0]",
        "gravity=[0.0, 0.0, -1.62]",
        "duration=10",
        "toolpath.speed=0.01",
        "nozzle.exit_speed=1",
        "output_interval=none",
        'title="Überschrift, 名前"',
        "name=my_line-1",
        "seed=4294967295",
        "domain.walls.z_lower={friction = 0.3}",
        "numerics.mpm.grid_ratio=1",
        "numerics.sph.cfl=0.2",
        "material.flow_index=0.5",
        "toolpath.layers=1",
        "tick=1e-4",
        "domain.upper=[1.2, 0.3, 0.3]",
        "material.sound_speed=10",
        "body_force=[0.1, 0, 0]",
        "pool=50000",
        "output_interval=5",
        "domain.lower.0=-0.05",
        "material.plastic_viscosity=0",
        "numerics.mpm={}",
        "spacing=3e-3",
        "material.density=1000",
    )
    right += [(verb, "line_bead", "--set", text) for text in sets for verb in ("compare", "run", "show")]
    right += [command("run", "--wall-limit", v) for v in ("5", "0.5", "1e5")]
    right += [command("ablate", "--tolerance", v) for v in ("5%", "5 %", "0.05", "0.9", "100%", "0.1%", " 5% ")]
    right += [command("select", "--within", v) for v in ("10m", "600", "1h")]
    right += [command("select", "--budget", v) for v in ("60s", "realtime", "5m", "1h", "0.5s", "90")]
    right += [command("compare", "--solvers", v) for v in ("mpm", "sph,mpm", " mpm , pbd ")]
    right += [command("sweep", "--worlds", "4"), command("validate", "--seed", "4294967295")]
    right += [command("validate", "--levels", v) for v in ("rough,coarse", "fine")]
    right += [command("stability", "--axis", v, "--quick") for v in ("density", "viscosity,spacing")]
    right += [command("table2", "--pools", v) for v in ("fit", "298000", "298000,fit")]
    right += [command("table2", "--variants", v) for v in ("plain", "curing, plain", "expansion + curing")]
    right += [command("compare", "--repeats", "3"), command("run", "--frames", "--render-every", "0.1")]
    right += [
        command("validate", "elliptic_drop", "--jobs", "1"),
        command("table1"),
        ("list",),
        ("doctor",),
        ("--version",),
    ]
    right += [command("compare", "--backend", "warp"), command("run", "--spacing", "2e-3", "--out", "deep/er")]
    for words in right:
        if "deep/er" not in words:
            yield Case(
                sort, words if "--out" in words or words[0] in WITHOUT_OUT else (*words, "--out", "out"), ACCEPTED
            )
    for name in OWN:
        for verb in ("compare", "show"):
            yield Case(sort, (verb, "case.toml"), ACCEPTED, files={"case.toml": dump(OWN[name])})
    five = {f"{i}.toml": f'extends = "{i + 1}.toml"\n'.encode() for i in range(5)} | {
        "5.toml": b'extends = "line_bead"\n'
    }
    yield Case(sort, ("compare", "0.toml"), ACCEPTED, files=five)
    yield Case(sort, ("run", "a b/ü.toml"), ACCEPTED, files={"a b/ü.toml": b'extends = "line_bead"\n'})
