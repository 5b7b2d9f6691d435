"""The common material law on one point, without a flow: Maxwell, Oldroyd-B, Herschel-Bulkley (exact)."""

import math
from typing import Any

import numpy as np

from fluidbench.study.case import Case, Curve, Finding, Number
from solvers import constitutive as law

UNIT = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
MODULUS, RELAXATION, RATE = 1e4, 0.1, 5.0
NEVER = 1e30


def driven(gradient: tuple[float, ...], time: float, dt: float, yield_stress: float, k: float, n: float, relax: float):
    """History of the elastic tensor b under a constant velocity gradient, shape (steps, 6)."""
    b: Any = UNIT
    history = []
    for _ in range(round(time / dt)):
        arguments: Any = (*gradient, *b, MODULUS, yield_stress, k, n, relax, dt)
        b = law.strain_and_flow(*arguments)[:6]
        history.append(b)
    return np.array(history)


def drive(dt: float) -> Finding:
    """Largest relative error of: shear start-up and N1, uniaxial stretching, relaxation, and steady plastic flow."""
    shear, eta, lam = (0, RATE, 0, 0, 0, 0, 0, 0, 0), MODULUS * RELAXATION, RELAXATION
    start = driven(shear, 0.4, dt, NEVER, 0.0, 1.0, 1 / lam)
    t = dt * np.arange(1, len(start) + 1)
    tau, first = MODULUS * start[:, 3], MODULUS * (start[:, 0] - start[:, 1])
    tau_ref = eta * RATE * (1 - np.exp(-t / lam))
    n1 = 2 * eta * lam * RATE**2 * (1 - (1 + t[-1] / lam) * math.exp(-t[-1] / lam))
    e = 2.0
    pull = driven((-e / 2, 0, 0, 0, -e / 2, 0, 0, 0, e), 0.4, dt, NEVER, 0.0, 1.0, 1 / lam)[-1]
    el = e * lam
    zz = (1 - 2 * el * math.exp(-(1 - 2 * el) * t[-1] / lam)) / (1 - 2 * el)
    rr = (1 + el * math.exp(-(1 + el) * t[-1] / lam)) / (1 + el)
    plastic = driven(shear, 0.5, dt, 50.0, 8.0, 0.5, 0.0)[-1]
    numbers = (
        Number("Oldroyd-B shear stress [Pa]", float(tau[-1]), float(tau_ref[-1])),
        Number("first normal stress difference [Pa]", float(first[-1]), n1),
        Number("uniaxial stress difference [Pa]", MODULUS * float(pull[2] - pull[0]), MODULUS * (zz - rr)),
        Number("Herschel-Bulkley stress [Pa]", MODULUS * float(plastic[3]), 50.0 + 8.0 * RATE**0.5),
    )
    error = max(abs(n.measured / n.reference - 1.0) for n in numbers)
    return Finding(error, numbers, (Curve("start-up", "time [s]", "shear stress [Pa]", t, tau, t, tau_ref),))


CASE = Case(
    "constitutive_driver",
    "the material law on a single point",
    "viscoelastic",
    "exact; references.md, E",
    "largest relative error of four stresses; `spacing` is dt [s]",
    spacing=1e-3,
    tolerance=0.02,
    drive=drive,
    quick=1e-3,
)
