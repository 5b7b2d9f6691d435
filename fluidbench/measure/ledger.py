"""One row of measures from one snapshot: the conservation ledger and the lengths that apply to the scenario."""

import numpy as np

from ..method.frame import CARRIED, Frame
from ..scenario import Scenario
from ..scenario.layout import emitted
from .bead import laid_share, layer_heights, measure_bead
from .deposit import Deposit
from .slump import measure_slump
from .tower import family_spread, is_tower, measure_tower, progress, standing


def deposit_of(frame: Frame, scenario: Scenario) -> Deposit:
    """The deposited field of a snapshot, without what is still inside the nozzle."""
    free = frame["held"] != CARRIED
    return Deposit.of(frame["position"][free], frame["volume"][free], scenario.domain, scenario.spacing)


def ledger(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Mass, momentum, energies and centre of mass of everything outside the nozzle, summed in float64."""
    free = frame["held"] != CARRIED
    m = frame["mass"][free].astype(float)
    x, v = frame["position"][free].astype(float), frame["velocity"][free].astype(float)
    mass = float(m.sum())
    row = {"particles": int(free.sum()), "mass_kg": mass}
    row |= {f"momentum_{axis}_kg_m_s": float(m @ v[:, i]) for i, axis in enumerate("xyz")}
    turn = (m[:, None] * np.cross(x, v)).sum(axis=0) + frame["spin"][free].astype(float).sum(axis=0)
    row |= {f"angular_momentum_{axis}_kg_m2_s": float(turn[i]) for i, axis in enumerate("xyz")}
    row["kinetic_energy_J"] = 0.5 * float(m @ (v * v).sum(axis=1))
    row["potential_energy_J"] = -float(m @ scenario.potential_at(x))
    row |= {f"center_{axis}_m": float(m @ x[:, i]) / mass if mass else 0.0 for i, axis in enumerate("xyz")}
    return row


def lengths(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Every length that the scenario calls for, all from the deposited field, with its resolution."""
    deposit = deposit_of(frame, scenario)
    row = {"resolution_m": deposit.spacing, "top_m": deposit.top() - scenario.domain.lower[2]}
    row |= measure_slump(deposit, scenario)
    if is_tower(scenario):
        row |= standing(deposit, scenario)
    return row | progress(frame, scenario)


def final_lengths(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """`lengths` and what only the finished print shows: beads and layers."""
    row = lengths(frame, scenario)
    free = frame["held"] != CARRIED
    laid = laid_share(frame["birth_time"][free], scenario)
    bead = measure_bead(deposit_of(frame, scenario), scenario, laid)
    if bead is not None and scenario.toolpath is not None:
        row |= bead.summary(scenario.toolpath.layers)
        for i, rise in enumerate(layer_heights(frame["position"][free], frame["birth_time"][free], scenario), 2):
            row[f"layer_{i}_height_m"] = rise
        if scenario.toolpath.kind == "ring" and scenario.toolpath.center is not None:
            center = np.average(frame["position"][free, :2], axis=0, weights=frame["mass"][free])
            row["ring_drift_m"] = float(np.hypot(*(center - scenario.toolpath.center)))
    if is_tower(scenario):
        row |= measure_tower(frame, scenario)
    if scenario.material.expansion is not None:
        row["family_spread_m"] = family_spread(frame, emitted(scenario))
    return row
