"""Published and exact answers beside what a run measured; tables and their sources lie in scenarios/reference."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..process.stream import Stream
from ..scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd

GATE_SHIFT = 0.3  # Martin & Moyce's clock starts when the gate does; their T may be late by this much


@dataclass(frozen=True)
class Answer:
    """One comparison. `error` is relative to the reference unless `measure` says otherwise."""

    quantity: str
    measured: float
    reference: float
    error: float
    measure: str
    source: str


def table(name: str) -> pd.DataFrame:
    """A reference table of the package."""
    import pandas as pd

    import scenarios

    return pd.read_csv(Path(scenarios.__file__).parent / "reference" / f"{name}.csv", comment="#")


def answers(scenario: Scenario, series: pd.DataFrame, final: dict[str, float]) -> list[Answer]:
    """All references that apply to a finished run, given its measures over time and at the end."""
    found = []
    if scenario.nozzle is not None:
        found += _emission(scenario, series, final)
    if scenario.reference == "viscoplastic_slump" and "slump" in final:
        found.append(_slump(scenario, final["slump"]))
    if scenario.reference == "martin_moyce_front" and "front_x_m" in series:
        found.append(_front(scenario, series))
    return found


def _emission(scenario: Scenario, series: pd.DataFrame, final: dict[str, float]) -> list[Answer]:
    """Mass rho Q t, exact to one disc, and the bead's section Q / V."""
    nozzle, path, track = scenario.nozzle, scenario.toolpath, scenario.track
    assert nozzle is not None and path is not None and track is not None
    t = float(series["time_s"].iloc[-1])
    expected = scenario.material.density * nozzle.rate * float(track.extruded(t))
    disc = Stream(scenario).volume * len(Stream(scenario).offsets) * scenario.material.density
    off = final["mass_kg"] - expected
    found = [
        Answer("emitted mass [kg]", final["mass_kg"], expected, abs(off) / disc, "in discs of one spacing", "rho Q t")
    ]
    if "bead_area_m2" in final:
        area, source = nozzle.rate / path.speed, "Q / V"
        if (expansion := scenario.material.expansion) is not None:
            ages = t - np.linspace(0.0, track.end, 200)[track.velocity(np.linspace(0.0, track.end, 200)).any(axis=1)]
            area *= float(np.mean([expansion.volume_ratio(age) for age in ages]))
            source = "R Q / V"
        got = final["bead_area_m2"]
        found.append(Answer("bead area [m^2]", got, area, abs(got / area - 1.0), "relative", source))
    return found


def _slump(scenario: Scenario, slump: float) -> Answer:
    """s' of a von Mises cylinder, H / R = 2, rough floor, against two independent computations."""
    body = scenario.bodies[0]
    height = 2.0 * float(body.extent[2])
    stress = scenario.material.yield_stress or 0.0
    tau = stress / (scenario.material.density * abs(float(scenario.acceleration[2])) * height)
    data = table("viscoplastic_slump_crosscheck")
    best = data[["slump_vof", "slump_mpm_extrap"]].mean(axis=1)
    expected = float(np.interp(tau, data["tau_prime"], best))
    note = "absolute" if 0.05 <= tau <= 0.3 else "absolute; tau' outside the table, its end value taken"
    return Answer(
        f"slump at tau' = {tau:.3g}", slump, expected, abs(slump - expected), note, "viscoplastic_slump_crosscheck.csv"
    )


def _front(scenario: Scenario, series: pd.DataFrame) -> Answer:
    """RMS of (Z - Z_ref) / Z_ref for 0.84 <= T <= 3.33 after the best shift of the clock within 0.3."""
    a = float(2.0 * scenario.bodies[0].extent[0])
    g = abs(float(scenario.acceleration[2]))
    ratio = float(scenario.bodies[0].extent[2] / scenario.bodies[0].extent[0])
    data = table(f"dam_break_martin_moyce_front_n2_{2 if ratio > 1.5 else 1}")
    data = data[(data["kind"] == "table") & data["T"].between(0.84, 3.33)]
    clock = series["time_s"].to_numpy() * np.sqrt(ratio * g / a)
    shifts = np.linspace(-GATE_SHIFT, GATE_SHIFT, 61)
    reached = [data["T"].to_numpy() + shift for shift in shifts]
    if clock[-1] < data["T"].max() - GATE_SHIFT:
        return Answer(
            "front RMS", float("nan"), 0.0, float("nan"), "run too short for the table", "Martin & Moyce 1952"
        )
    errors = [
        float(np.sqrt(np.mean((np.interp(t, clock, series["front_x_m"] / a) / data["Z"] - 1.0) ** 2))) for t in reached
    ]
    best = int(np.argmin(errors))
    z = float(np.interp(reached[best][-1], clock, series["front_x_m"] / a))
    return Answer(
        "front Z at T = 3.33", z, float(data["Z"].iloc[-1]), errors[best],
        f"RMS over 0.84 <= T <= 3.33, clock shifted by {shifts[best]:+.2f}", "Martin & Moyce 1952",
    )  # fmt: skip
