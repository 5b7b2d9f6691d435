"""Engines: their catalogue, environments that are whole or not there, and what their methods refuse; none is needed."""

import json
import os
import struct
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fluidbench.engines import environment
from fluidbench.engines.bgeo import write_bgeo
from fluidbench.engines.catalogue import ENGINES, engine_named
from fluidbench.engines.guest import talking_aside
from fluidbench.engines.splishsplash import DFSPH, WCSPH
from fluidbench.errors import Obstacle, UserError
from fluidbench.method.contract import Method
from fluidbench.method.suitability import approximations, check_backend, refusal
from fluidbench.method.target import Target
from fluidbench.registry import get_method
from fluidbench.runs import interpreter, provenance
from fluidbench.runs.job import Job
from fluidbench.study.estimate import estimate
from fluidbench.study.limits import default_dt
from fluidbench.study.preview import preview
from fluidbench.study.workplace import methods_of

from ..conftest import bead, scenario

ENGINE = ENGINES["splishsplash"]
LACKING = "splishsplash-wcsph: SPlisHSPlasH is not installed: fluidbench engines add splishsplash"
WATER = scenario(domain={"lower": [0.0] * 3, "upper": [0.2] * 3, "walls": {"z_lower": "slip"}})


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The data folder, empty; the code of a run is not that of another test's."""
    monkeypatch.setenv(environment.DATA, str(tmp_path / "data"))
    provenance.code.cache_clear()
    yield environment.home(ENGINE)
    provenance.code.cache_clear()


def whole(folder, version="9.8.7", python=None):
    """An environment as `add` leaves it."""
    made = environment.python_of(folder)
    made.parent.mkdir(parents=True, exist_ok=True)
    made.touch()
    python = python or f"{sys.version_info.major}.{sys.version_info.minor}"
    (folder / environment.MARK).write_text(json.dumps({"version": version, "python": python}))


@pytest.mark.parametrize("engine", ENGINES.values(), ids=lambda engine: engine.name)
def test_what_an_engine_brings_is_registered_and_stands_after_ours(engine):
    for name in engine.methods:
        method = get_method(name)
        assert issubclass(method, Method) and method.name == name and method.rank >= 200
        assert (method.engine, method.devices) == (engine.name, ("cpu",))
        assert (method.__doc__ or "").strip()


def test_an_engine_is_named_as_it_is_written():
    assert engine_named("splishsplash") is ENGINE
    with pytest.raises(UserError, match=r"^no engine named 'splish'; did you mean 'splishsplash'\?$"):
        engine_named("splish")


def test_a_method_without_its_engine_is_left_out_and_says_how_to_get_it(folder):
    assert WCSPH.missing() == LACKING and methods_of(None) == ["mpm", "sph", "pbd"]
    with pytest.raises(UserError) as caught:
        methods_of(["sph", "splishsplash-wcsph"])
    assert str(caught.value) == LACKING
    whole(folder)
    assert WCSPH.missing() is None and methods_of(None)[3:] == ["splishsplash-wcsph", "splishsplash-dfsph"]
    assert (
        methods_of(None, {"device": "cuda:0"}) == methods_of(None, backends=["warp", "taichi"]) == ["mpm", "sph", "pbd"]
    )


def test_half_an_environment_is_none(folder):
    whole(folder)
    assert environment.installed(ENGINE) == environment.Installed("9.8.7", environment._series())
    for text in ("", "{", "[]", '{"version": "1"}'):
        (folder / environment.MARK).write_text(text)
        assert environment.installed(ENGINE) is None
    whole(folder)
    environment.python_of(folder).unlink()
    assert environment.installed(ENGINE) is None and WCSPH.missing() == LACKING


def test_an_environment_of_another_python_does_not_serve(folder):
    whole(folder, python="3.7")
    assert environment.missing(ENGINE) == (
        f"SPlisHSPlasH was added for Python 3.7, and this is {environment._series()}: "
        "fluidbench engines add splishsplash"
    )


def acted(monkeypatch, fails=None, says=""):
    """Play venv and pip: each makes what it would, or fails; returns the commands that were run."""
    run: list[list[str]] = []

    def call(command, **_):
        run.append(command)
        if command[1:3] == ["-m", "venv"]:
            python = environment.python_of(Path(command[3]))
            python.parent.mkdir(parents=True)
            python.touch()
        failed = fails is not None and fails in command
        return SimpleNamespace(
            returncode=int(failed), stdout="" if failed else "1.2.3\n", stderr=says if failed else ""
        )

    monkeypatch.setattr(environment.subprocess, "run", call)
    return run


def test_adding_makes_tries_and_swaps(folder, monkeypatch):
    run, told = acted(monkeypatch), []
    assert environment.add(ENGINE, told.append).version == "1.2.3" and environment.installed(ENGINE) is not None
    assert run[1][1:] == ["-m", "pip", "install", "--progress-bar", "off", "pysplishsplash>=2.19"]
    assert len(run) == 4 and len(told) == 3 and "MIT" in told[1]
    (folder / "left").touch()
    environment.add(ENGINE, told.append)
    assert not (folder / "left").exists() and sorted(p.name for p in folder.parent.iterdir() if p.is_dir()) == [
        ENGINE.name
    ]
    assert environment.remove(ENGINE) and not folder.exists() and not environment.remove(ENGINE)


@pytest.mark.parametrize(
    ("fails", "says", "words"),
    [
        ("install", "WARNING: Hm\nERROR: No matching distribution for x\n", "No matching distribution for x"),
        ("install", "NewConnectionError: it\nERROR: y", "no package index answers; is there a network?"),
        (
            "install",
            "ERROR: Could not find it (from versions: none)\n",
            f"no package index that answers has pysplishsplash>=2.19 for Python {environment._series()}",
        ),
        ("venv", "ensurepip is not available\n", "ensurepip is not available"),
        ("-c", "", "exit code 1"),
    ],
)
def test_what_cannot_be_added_says_so_in_one_line_and_keeps_what_was_there(folder, monkeypatch, fails, says, words):
    whole(folder)
    acted(monkeypatch, fails, says)
    with pytest.raises(Obstacle) as caught:
        environment.add(ENGINE, lambda _: None)
    assert str(caught.value) == f"SPlisHSPlasH was not added: {words}"
    assert environment.installed(ENGINE).version == "9.8.7"
    assert not folder.with_name(".splishsplash.part").exists()


def test_a_run_is_of_its_engines_version_and_python(folder):
    job = Job(WATER.model_dump(mode="json"), "splishsplash-wcsph")
    assert Job(WATER.model_dump(mode="json"), "sph").interpreter is None
    assert "pysplishsplash" not in job.heading()["code"]
    provenance.code.cache_clear()
    whole(folder)
    code = job.heading()["code"]
    assert code["pysplishsplash"] == "9.8.7" and code["sources"] != provenance.code("sph", "warp")["sources"]
    assert (
        provenance.changed("splishsplash-wcsph") == "the code, or Warp or Taichi or pysplishsplash, has changed since"
    )
    assert provenance.changed("sph") == "the code, or Warp or Taichi, has changed since"
    python = job.interpreter
    assert python == environment.python_of(folder)
    made = interpreter.command("a.b", "c", python=python)
    assert made[0] == str(python) and made[-2:] == ["a.b", "c"]
    own = interpreter.search_path()
    packages = folder / "lib" / f"python{environment._series()}" / "site-packages"
    assert made[-3].split(os.pathsep) == [*own, str(packages)]


SLIP = {f"{axis}_{end}": "slip" for axis in "xyz" for end in ("lower", "upper")}


@pytest.mark.parametrize("method", [WCSPH, DFSPH])
@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: WATER, None),
        (lambda: scenario(material={"density": 1e3, "viscosity": 1.0}), None),
        (bead, "it has no elastic shear stress and no material that comes from a nozzle and no yield stress"),
        (
            lambda: scenario(domain={"lower": [0.0] * 3, "upper": [0.2] * 3, "walls": {"z_lower": {"friction": 0.5}}}),
            "it has no Coulomb friction at walls",
        ),
        (
            lambda: scenario(
                domain={"lower": [0.0] * 3, "upper": [0.2] * 3, "walls": {"x_lower": "periodic", "x_upper": "periodic"}}
            ),
            "it has no periodic axes",
        ),
        (lambda: scenario(body_force_gradient=np.eye(3).tolist()), "it has no forces that change over space"),
        (
            lambda: scenario(bodies=[{"kind": "box", "center": [0.05] * 3, "size": [0.08] * 3, "clamped": True}]),
            "it has no bodies that keep their velocity",
        ),
        (
            lambda: scenario(
                material={"density": 1e3, "viscosity": 1.0},
                bodies=[{"kind": "box", "center": [0.04] * 3, "size": [0.08] * 3}],
            ),
            "its walls slip or stick together, and here a body lies at x_lower, which slips beside walls that stick",
        ),
        (
            lambda: scenario(
                bodies=[
                    {"kind": "box", "center": [0.05] * 3, "size": [0.08] * 3},
                    {"kind": "sphere", "center": [0.15] * 3, "radius": 0.03},
                ]
            ),
            "its particles are all alike, and the bodies ask for 8.316e-07 to 1e-06 m^3",
        ),
    ],
)
def test_what_is_not_honoured_is_refused_in_words(method, made, words):
    s = made()
    assert refusal(method, s, method.Config()) == words


def test_what_is_approximated_is_said():
    said = approximations(WCSPH, WATER, WCSPH.Config())
    assert len(said) == 2 and "Akinci et al. 2012" in said[0] and said[1].startswith("an artificial viscosity of 0.00")
    assert approximations(DFSPH, WATER, DFSPH.Config())[1:] == ["it is incompressible: no sound, no bulk modulus"]
    sticky = approximations(WCSPH, scenario(), WCSPH.Config(artificial_viscosity=0.0))
    assert sticky[1:] == ["walls that stick hold by their viscosity alone, those that slip, too"]


def test_it_picks_its_own_step_and_the_toolkit_copes(folder):
    whole(folder)
    found = estimate(WATER, WCSPH)
    assert (found.bounds, found.plan, found.substeps, found.wall_s) == ([], None, None, None)
    tables = {table.title: table.rows for table in preview(WATER)[1]}
    assert ["splishsplash-wcsph", "-", "-", "it picks its own step", "-"] in tables["Bounds at the reference speed"]
    needs = next(row for row in tables["Needs"] if row[0] == "splishsplash-dfsph")
    assert needs[1:4] == ["512", "-", "-"] and needs[-1] == "-"
    with pytest.raises(UserError, match="splishsplash-wcsph picks its own step"):
        default_dt(WATER, WCSPH, WCSPH.Config())


def test_caps_are_named_and_only_the_cpu_will_do():
    d, c = WATER.spacing, WATER.wave_speed
    assert min(WCSPH.caps(WATER, WCSPH.Config()).items(), key=lambda cap: cap[1]) == ("acoustic cap", 0.4 * d / c)
    assert DFSPH.caps(WATER, DFSPH.Config())["force cap"] == pytest.approx(0.1 * (d / 9.81) ** 0.5)
    thick = scenario(material={"density": 1e3, "viscosity": 1e3})
    assert DFSPH.caps(thick, DFSPH.Config())["viscous cap"] == pytest.approx(0.1 * d * d)
    assert "viscous cap" not in DFSPH.caps(thick, DFSPH.Config(viscosity="weiler2018"))
    with pytest.raises(UserError, match=r"^splishsplash-wcsph runs on cpu alone, not on cuda:0$"):
        check_backend(WCSPH, Target("cuda:0"))
    with pytest.raises(UserError, match="has no backend 'taichi'"):
        check_backend(WCSPH, Target(backend="taichi"))


def test_particles_are_written_in_their_order(tmp_path):
    x, v = np.arange(6.0).reshape(2, 3), -np.arange(6.0).reshape(2, 3)
    write_bgeo(tmp_path / "p.bgeo", x, v)
    data = (tmp_path / "p.bgeo").read_bytes()
    assert data[:5] == b"BgeoV" and struct.unpack(">3i", data[5:17]) == (5, 2, 0)
    assert struct.unpack(">14f", data[-58:-2]) == (0, 1, 2, 1, 0, -1, -2, 3, 4, 5, 1, -3, -4, -5)


def test_an_engine_talks_aside(capfd):
    with talking_aside():
        os.write(1, b"chatter")
    os.write(1, b"ours")
    assert capfd.readouterr() == ("ours", "chatter")
