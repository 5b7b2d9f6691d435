"""Degree of cure over age against its rate equation, and the age at which a target is reached (exact)."""

import math
from collections.abc import Callable

import numpy as np

from fluidbench.scenario.cure import Cure
from fluidbench.study.case import Case, Curve, Finding, Number

DELAY, K1, K2, N, END = 0.5, 0.8, 3.0, 2.5, 4.0
RATES: dict[str, tuple[Cure, Callable[[float, float], float]]] = {
    "first order": (Cure(kind="first_order", delay=DELAY, rate=K1, youngs_modulus=1e5), lambda t, a: K1 * (1 - a)),
    "Kamal-Sourour": (
        Cure(kind="kamal_sourour", delay=DELAY, rate=K1, rate_autocatalytic=K2, youngs_modulus=1e5),
        lambda t, a: (K1 + K2 * a) * (1 - a),
    ),
    "Avrami": (
        Cure(kind="avrami", delay=DELAY, rate=K1, exponent=N, youngs_modulus=1e5),
        lambda t, a: N * K1 * (K1 * t) ** (N - 1) * (1 - a),
    ),
    "linear": (Cure(kind="linear", delay=DELAY, time=2 * END, youngs_modulus=1e5), lambda t, a: 0.5 / END),
}


def integrated(rate: Callable[[float, float], float], dt: float) -> tuple[np.ndarray, np.ndarray]:
    """(t, alpha) of d alpha / dt = rate(t, alpha) from 0, by the classical Runge-Kutta method."""
    times, alphas = [0.0], [0.0]
    for _ in range(round(END / dt)):
        t, a = times[-1], alphas[-1]
        one = rate(t, a)
        two = rate(t + dt / 2, a + dt / 2 * one)
        three = rate(t + dt / 2, a + dt / 2 * two)
        four = rate(t + dt, a + dt * three)
        times.append(t + dt)
        alphas.append(a + dt / 6 * (one + 2 * two + 2 * three + four))
    return np.array(times), np.array(alphas)


def drive(dt: float) -> Finding:
    """Largest departure from the rate equation, and of the age at 80 % of what was reached."""
    numbers, curves, worst = [], [], 0.0
    for name, (cure, rate) in RATES.items():
        t, exact = integrated(rate, dt)
        seen = np.array([cure.degree(DELAY + float(value)) for value in t])
        target = 0.8 * float(exact[-1])
        age, wanted = cure.age_at(target), DELAY + float(np.interp(target, exact, t))
        numbers.append(Number(f"{name}: age at alpha = {target:.3f} [s]", age, wanted))
        curves.append(Curve(name, "age after the onset [s]", "degree of cure", t, seen, t, exact))
        worst = max(worst, float(np.abs(seen - exact).max()), abs(age / wanted - 1.0))
    fastest = (K2 - K1) / (2 * K2)
    alpha = np.array([RATES["Kamal-Sourour"][0].degree(DELAY + 1e-4 * i) for i in range(20000)])
    numbers.append(Number("Kamal-Sourour: alpha where fastest", float(alpha[np.gradient(alpha).argmax()]), fastest))
    half = RATES["Avrami"][0].age_at(0.5) - DELAY
    numbers.append(Number("Avrami: half time [s]", half, math.log(2) ** (1 / N) / K1))
    return Finding(worst, tuple(numbers), tuple(curves))


CASE = Case(
    "cure_kinetics",
    "degree of cure by four laws",
    "process",
    "exact; references.md, G",
    "largest departure of alpha and of the time to a target; `spacing` is dt [s] of the reference",
    spacing=1e-2,
    tolerance=1e-4,
    drive=drive,
    quick=1e-2,
)
