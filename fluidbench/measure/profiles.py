"""Measures of fields: error norms, Fourier amplitudes, shapes of drops, periods (references.md, conventions)."""

import numpy as np

from ..method.frame import Frame
from .deposit import Deposit


def relative_l2(values: np.ndarray, reference: np.ndarray) -> float:
    """E2 = sqrt(sum (q - q_ref)^2 / sum q_ref^2)."""
    return float(np.sqrt(np.square(values - reference).sum() / np.square(reference).sum()))


def relative_l1(values: np.ndarray, reference: np.ndarray) -> float:
    """E1 = mean |q - q_ref| / mean |q_ref|."""
    return float(np.abs(values - reference).mean() / np.abs(reference).mean())


def semi_axes(frame: Frame, cubes: bool = False) -> np.ndarray:
    """Semi-axes of the ellipsoid with the same second moments about its centre, shape (3,): sqrt(5 <x^2>).

    Points alone keep the ratios of axes exact while a body of them deforms. With `cubes` each adds the moment of a cube
    of its rest volume, V^(2/3) / 12: the points of few particles have too small a moment, and a body that splits them
    would seem to grow.
    """
    mass = frame["mass"].astype(float)
    x = frame["position"].astype(float)
    arm = x - mass @ x / mass.sum()
    moments = arm**2
    if cubes:
        moments += frame["volume"].astype(float)[:, None] ** (2.0 / 3.0) / 12.0
    return np.sqrt(5.0 * (mass @ moments) / mass.sum())


def kinetic_energy(frame: Frame) -> float:
    """[J]"""
    return 0.5 * float(frame["mass"].astype(float) @ np.square(frame["velocity"].astype(float)).sum(axis=1))


def sine_amplitude(frame: Frame, component: int, axis: int, number: float, phase: float = 0.0) -> float:
    """Amplitude [m/s] of sin(number x_axis + phase) in a velocity component, by projection over the particles."""
    shape = np.sin(number * frame["position"][:, axis].astype(float) + phase)
    return float((frame["velocity"][:, component] * shape).sum() / np.square(shape).sum())


def widest_diameter(deposit: Deposit, share: float = 1.0) -> float:
    """Diameter of the circle as large as the largest horizontal section [m]; `share` is the part that is modelled."""
    sections = deposit.fill.clip(0.0, 1.0).sum(axis=(0, 1))
    return float(np.sqrt(4.0 * sections.max() * deposit.spacing**2 / (np.pi * share)))


def crossings(time: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """Times at which a signal passes its mean upwards, linear between samples."""
    value = signal - signal.mean()
    i = np.flatnonzero((value[:-1] < 0) & (value[1:] >= 0))
    return time[i] - value[i] * (time[i + 1] - time[i]) / (value[i + 1] - value[i])


def damped_swing(time: np.ndarray, signal: np.ndarray, period: float) -> tuple[float, float, float]:
    """(rest, period [s], decay [1/s]) of rest - amplitude exp(-decay t) cos(2 pi t / period), fitted from a first guess
    of the period; whatever creeps is left out as a linear drift."""
    from scipy.optimize import curve_fit

    def swing(t, rest, amplitude, decay, cycles, drift):
        return rest + drift * t - amplitude * np.exp(-decay * t) * np.cos(2 * np.pi * cycles * t)

    clock, half = time / period, float(np.ptp(signal)) / 2
    fitted, _ = curve_fit(swing, clock, signal, [half, half, 0.1, 1.0, 0.0], maxfev=20000)
    return float(fitted[0]), float(period / abs(fitted[3])), float(fitted[2] / period)


def period(time: np.ndarray, signal: np.ndarray) -> float:
    """Mean period of an oscillation [s]; NaN with fewer than two passages through the mean."""
    passed = crossings(time, signal)
    return float(np.diff(passed).mean()) if len(passed) > 1 else float("nan")
