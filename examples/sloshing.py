"""A tank whose surface starts as half a cosine: the first mode of sloshing, w^2 = g k tanh(k H) (Lamb 1932, 228).

fluidbench validate examples/sloshing.py
"""

from math import pi, sqrt, tanh

import numpy as np

import fluidbench as fb

WIDTH, DEPTH, CREST = 1.0, 0.4, 0.05  # m
K = pi / WIDTH
PERIOD = 2 * pi / sqrt(9.81 * K * tanh(K * DEPTH))


def scenarios(spacing):
    size = [WIDTH, 8 * spacing, DEPTH + CREST]  # periodic across: a slice of a wide tank
    walls = {"y_lower": "periodic", "y_upper": "periodic", "z_lower": "slip"}
    domain = {"lower": [0, 0, 0], "upper": [WIDTH, 8 * spacing, 2 * DEPTH], "walls": walls}
    surface = f"z < {DEPTH} + {CREST} * cos({K} * x)"
    water = {"kind": "box", "center": [edge / 2 for edge in size], "size": size, "where": surface}
    more = {"material": {"density": 1000.0}, "duration": 1.5 * PERIOD, "output_interval": PERIOD / 40}
    return {"tank": fb.define("sloshing", domain=domain, bodies=[water], spacing=spacing, **more)}


def evaluate(runs):
    run = runs["tank"]
    lean = np.array([frame["position"][:, 0].mean() - WIDTH / 2 for frame in run.frames])  # the mode, to first order
    i = np.flatnonzero(np.diff(np.sign(lean)))  # it passes the middle after output i
    crossings = run.times[i] + (run.times[i + 1] - run.times[i]) * lean[i] / (lean[i] - lean[i + 1])
    number = fb.Number("period [s]", 2 * float(np.diff(crossings).mean()), PERIOD)
    return fb.Finding(abs(number.measured / number.reference - 1), (number,))


words = ("sloshing", "the first mode of a tank", "liquid", "Lamb 1932", "error of the period")
CASE = fb.Case(*words, spacing=WIDTH / 40, tolerance=0.1, scenarios=scenarios, evaluate=evaluate)
