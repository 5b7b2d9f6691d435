"""A vortex in a box with slip walls, steady without viscosity: how much of its energy does a method keep?

fluidbench validate examples/vortex.py
"""

import fluidbench as fb

EDGE, TIME = 1.0, 1.0  # m, s
FIELD = ("sin(pi * x) * cos(pi * y)", "-cos(pi * x) * sin(pi * y)", "0")


def scenarios(spacing):
    deep = 8 * spacing  # periodic: a slice of a long vortex
    centre, size = [EDGE / 2, EDGE / 2, deep / 2], [EDGE, EDGE, deep]
    domain = {"lower": [0, 0, 0], "upper": size, "walls": {"z_lower": "periodic", "z_upper": "periodic"}}
    body = {"kind": "box", "center": centre, "size": size, "velocity_field": FIELD}
    more = {"material": {"density": 1000.0}, "gravity": [0, 0, 0], "duration": TIME, "spacing": spacing}
    return {"vortex": fb.define("vortex", domain=domain, bodies=[body], **more)}


def evaluate(runs):
    energy = runs["vortex"].series["kinetic_energy_J"]
    number = fb.Number("kinetic energy [J]", energy.iloc[-1], energy.iloc[0])
    return fb.Finding(1 - number.measured / number.reference, (number,))


words = ("vortex", "a vortex in a box", "liquid", "Euler: steady", "share of the energy lost")
CASE = fb.Case(*words, spacing=EDGE / 32, tolerance=0.1, scenarios=scenarios, evaluate=evaluate)
