"""Published and exact answers beside what a run measured; tables and their sources lie in scenarios/reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..scenario import Scenario
from ..scenario.library import reference_table
from ..scenario.stream import Stream
from .bead import planned_area

if TYPE_CHECKING:
    import pandas as pd

ALIKE = 0.02  # difference of proportions (relative, and of H / R itself) up to which a reference is of the same body
GATE_SHIFT = 0.3  # Martin & Moyce's clock starts when the gate does; their T may be late by this much


@dataclass(frozen=True)
class Answer:
    """One comparison. `error` is relative to the reference unless `measure` says otherwise; `reads` is the key of
    the length at the end of a run that it is of, where it is of one."""

    quantity: str
    measured: float
    reference: float
    error: float
    measure: str
    source: str
    reads: str = ""


def table(name: str) -> pd.DataFrame:
    """A reference table of the package."""
    import pandas as pd

    return pd.read_csv(reference_table(name), comment="#")


class DoesNotApply(Exception):
    """A reference that says nothing of this run; the message says why."""


def answers(scenario: Scenario, series: pd.DataFrame, final: dict[str, float]) -> tuple[list[Answer], list[str]]:
    """(all references that apply to a finished run, given its measures over time and at the end; one line for each that
    does not apply, with the reason)."""
    made: list[Callable[[], Answer]] = []
    if scenario.nozzle is not None:
        made.append(lambda: _mass(scenario, series, final))
        if "bead_area_m2" in final:
            made.append(lambda: _area(final))
            made.append(lambda: _matter(scenario, series, final))
    if scenario.reference == "viscoplastic_slump":
        made.append(lambda: _slump(scenario, final))
    if scenario.reference == "martin_moyce_front":
        made.append(lambda: _front(scenario, series))
    found, reasons = [], []
    for answer in made:
        try:
            found.append(answer())
        except DoesNotApply as reason:
            reasons.append(str(reason))
    return found, reasons


def _mass(scenario: Scenario, series: pd.DataFrame, final: dict[str, float]) -> Answer:
    """Mass rho Q t, and what the bore held from the start; exact to one disc."""
    nozzle, track = scenario.nozzle, scenario.track
    assert nozzle is not None and track is not None
    t = float(series["time_s"].iloc[-1])
    stream, density = Stream(scenario), scenario.material.density
    expected = density * (nozzle.rate * float(track.extruded(t)) + stream.filled)
    off = abs(final["mass_kg"] - expected) / (stream.volume * len(stream.offsets) * density)
    source = "rho Q t" if stream.filled == 0.0 else "rho Q t, and the bore"
    return Answer("emitted mass [kg]", final["mass_kg"], expected, off, "in discs of one spacing", source)


def _area(final: dict[str, float]) -> Answer:
    """The bead's section, against the volume of matter that lies there: how well it is packed. Not against Q / V: a
    strand that is drawn along as it is begun is heavier further on."""
    got, matter = final["bead_area_m2"], final["bead_matter_m2"]
    if not matter > 0.0:
        raise DoesNotApply("bead area against its matter: none lies along the path")
    return Answer("bead area [m^2]", got, matter, abs(got / matter - 1.0), "relative", "its matter", "bead_area_m2")


def _matter(scenario: Scenario, series: pd.DataFrame, final: dict[str, float]) -> Answer:
    """The volume per length of what was laid, Q / V, times what it has expanded, once the whole path was travelled."""
    nozzle, path, track = scenario.nozzle, scenario.toolpath, scenario.track
    assert nozzle is not None and path is not None and track is not None
    t = float(series["time_s"].iloc[-1])
    if t < track.end * (1.0 - 1e-6):
        raise DoesNotApply(f"bead matter against Q / V: the path takes {track.end:.3g} s, the run ends at {t:.3g} s")
    area, source = planned_area(scenario), "Q / V"
    if (expansion := scenario.material.expansion) is not None:
        laid = float(track.extruding[-1]) * (np.arange(200) + 0.5) / 200
        area *= float(np.mean([expansion.volume_ratio(t - release) for release in track.release_time(laid)]))
        source = "R Q / V"
    got = final["bead_matter_m2"]
    return Answer("bead matter [m^2]", got, area, abs(got / area - 1.0), "relative", source, "bead_matter_m2")


def _slump(scenario: Scenario, final: dict[str, float]) -> Answer:
    """s' of a von Mises cylinder, H / R = 2, rough floor, against two independent computations."""
    what, g = "slump against the crosscheck", -float(scenario.acceleration[2])
    body = scenario.bodies[0] if scenario.bodies else None
    if "slump" not in final or body is None or body.kind != "cylinder" or not scenario.material.yield_stress or g <= 0:
        raise DoesNotApply(f"{what}: it is of one cylinder with a yield stress that slumps under its weight")
    height = 2.0 * float(body.extent[2])
    if abs(height / float(body.extent[0]) - 2.0) > ALIKE or scenario.domain.walls.z_lower != "stick":
        raise DoesNotApply(f"{what}: it is of H / R = 2 on a floor that sticks")
    tau = scenario.material.yield_stress / (scenario.material.density * g * height)
    data = table("viscoplastic_slump_crosscheck")
    low, high = (float(value) for value in data["tau_prime"].to_numpy()[[0, -1]])
    if not low <= tau <= high:
        raise DoesNotApply(f"{what}: tau' = {tau:.3g} lies outside the table, {low:g} .. {high:g}")
    expected = float(np.interp(tau, data["tau_prime"], data[["slump_vof", "slump_mpm_extrap"]].mean(axis=1)))
    off = abs(final["slump"] - expected)
    source = "viscoplastic_slump_crosscheck.csv"
    return Answer(f"slump at tau' = {tau:.3g}", final["slump"], expected, off, "absolute", source, "slump")


def martin_moyce(scenario: Scenario) -> tuple[float, float, pd.DataFrame]:
    """(width a of the column [m], T over time sqrt(n^2 g / a) [1/s], table of T and Z) for the scenario's column, the
    table being that of its proportions n^2 = 1 or 2; raises DoesNotApply for others."""
    g = -float(scenario.acceleration[2])
    body = scenario.bodies[0] if scenario.bodies else None
    if body is None or body.kind != "box" or body.where is not None or g <= 0:
        raise DoesNotApply("front against Martin & Moyce: it is of one column of a liquid in a box, with gravity")
    a, ratio = float(2.0 * body.extent[0]), float(body.extent[2] / body.extent[0])
    nearest = min((1, 2), key=lambda n: abs(ratio - n))
    if abs(ratio / nearest - 1.0) > ALIKE:
        raise DoesNotApply(f"front against Martin & Moyce: tables are of n^2 = 1 and 2, the column has {ratio:.3g}")
    data = table(f"dam_break_martin_moyce_front_n2_{nearest}")
    if "kind" in data:  # the table of n^2 = 2 holds points read off a figure, too
        data = data.loc[data["kind"] == "table"]
    return a, float(np.sqrt(ratio * g / a)), data


def _front(scenario: Scenario, series: pd.DataFrame) -> Answer:
    """RMS of (Z - Z_ref) / Z_ref for 0.84 <= T <= 3.33 after the best shift of the clock within 0.3."""
    if "front_x_m" not in series:
        raise DoesNotApply("front against Martin & Moyce: it is of one column of a liquid in a box, with gravity")
    a, rate, data = martin_moyce(scenario)
    data = data[data["T"].between(0.84, 3.33)]
    clock = series["time_s"].to_numpy() * rate
    shifts = np.linspace(-GATE_SHIFT, GATE_SHIFT, 61)
    reached = [data["T"].to_numpy() + shift for shift in shifts]
    if clock[-1] < data["T"].max() - GATE_SHIFT:
        raise DoesNotApply(
            f"front against Martin & Moyce: the table ends at T = {data['T'].max():g}, the run at T = {clock[-1]:.3g}"
        )
    errors = [
        float(np.sqrt(np.mean((np.interp(t, clock, series["front_x_m"] / a) / data["Z"] - 1.0) ** 2))) for t in reached
    ]
    best = int(np.argmin(errors))
    z = float(np.interp(reached[best][-1], clock, series["front_x_m"] / a))
    return Answer(
        f"front Z at T = {float(data['T'].iloc[-1]):g}",
        z,
        float(data["Z"].iloc[-1]),
        errors[best],
        f"RMS over 0.84 <= T <= 3.33, clock shifted by {shifts[best]:+.2f}",
        "Martin & Moyce 1952",
    )
