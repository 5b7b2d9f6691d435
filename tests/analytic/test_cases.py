"""Cases of scenarios/analytic at their own tolerance: the cheap ones by default, all of them, and out of order,
with `-m slow`."""

import numpy as np
import pytest

from fluidbench.method.target import HERE
from fluidbench.study.case import cases
from fluidbench.study.trials import EXEMPT, MISS, PASS, plan, run
from fluidbench.study.workplace import Workplace

from ..conftest import NATIVE

CHEAP = [
    ("free_fall", "mpm"),
    ("conservation_ledger", "mpm"),
    ("conservation_ledger", "sph"),
    ("conservation_ledger", "pbd"),
    ("emission_mass_rate", "mpm"),
    ("emission_mass_rate", "pbd"),
    ("elliptic_drop", "mpm"),
    ("elliptic_drop", "sph"),
    ("hydrostatic_column", "mpm"),
    ("shear_wave_decay", "mpm"),
    ("shear_wave_decay", "sph"),
    ("shear_wave_decay", "pbd"),
    ("rigid_rotation", "mpm"),
    ("poiseuille_startup", "sph"),
    ("poiseuille_startup", "pbd"),
    ("rigid_rotation", "pbd"),
    ("emission_mass_rate", "sph"),
    ("bingham_channel", "mpm"),
    ("bar_vibration", "mpm"),
    ("self_weight_column", "mpm"),
    ("oldroyd_startup", "mpm"),
    ("dam_break", "mpm"),
]
SHAKEN = [(name, method) for name in ("free_fall", "poiseuille_startup") for method in NATIVE]
ALL = [(name, method) for name, case in cases().items() for method in NATIVE if not case.skips(method)]


def judged(tmp_path, name, method, levels=("coarse",), seed=0):
    """The trials of a case, run and judged."""
    trials = plan([cases()[name]], [method], levels, False, HERE, 1800.0, seed)
    run(trials, Workplace.of({"out": tmp_path, "jobs": 1, "progress": False}, 1800.0))
    return trials


@pytest.mark.parametrize(("name", "method"), CHEAP)
def test_cheap_cases_pass(tmp_path, name, method):
    (trial,) = judged(tmp_path, name, method)
    assert trial.verdict == PASS, f"error {trial.error:.4g} of {trial.tolerance:g}: {trial.note}"


@pytest.mark.parametrize(("name", "method"), SHAKEN)
def test_shaken_bodies_are_not_flung(tmp_path, name, method):
    """A method that reads its density from places pushed those of a shaken body apart, at half a metre a second."""
    (trial,) = judged(tmp_path, name, method, seed=1)
    assert trial.verdict == PASS, f"error {trial.error:.4g} of {trial.tolerance:g}: {trial.note}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method", "seed"), [(*pair, seed) for seed in (0, 1) for pair in ALL if seed or pair not in CHEAP]
)
def test_dear_and_shaken_cases_pass_or_say_why_not(tmp_path, name, method, seed):
    (trial,) = judged(tmp_path, name, method, seed=seed)
    case = cases()[name]
    known = trial.verdict == EXEMPT or (trial.verdict == MISS and method in case.causes)
    assert trial.verdict == PASS or known, f"{trial.verdict}: error {trial.error:.4g} of {trial.tolerance:g}"


@pytest.mark.parametrize(
    ("name", "method", "least"), [("poiseuille_startup", "mpm", 1.5), ("elliptic_drop", "mpm", 0.9)]
)
def test_errors_fall_with_the_spacing(tmp_path, name, method, least):
    """Observed order over three spacings, everything else fixed."""
    trials = judged(tmp_path, name, method, ("rough", "coarse", "medium"))
    slope = np.polyfit(np.log([t.spacing for t in trials]), np.log([t.error for t in trials]), 1)[0]
    assert slope >= least


def test_the_law_converges_at_first_order():
    driver = cases()["constitutive_driver"].drive
    assert driver is not None
    errors = [driver(dt).error for dt in (4e-3, 2e-3, 1e-3)]
    assert errors[-1] < 0.02 and np.log2(errors[0] / errors[2]) / 2 == pytest.approx(1.0, abs=0.2)
