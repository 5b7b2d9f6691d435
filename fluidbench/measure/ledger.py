"""One row of measures from one snapshot: the conservation ledger and the lengths that apply to the scenario."""

import numpy as np

from ..method.frame import CARRIED, Frame
from ..scenario import Scenario
from ..scenario.layout import emitted
from .bead import Bead, laid_share, layer_heights, measure_bead
from .deposit import Deposit
from .feed import feeding, is_out
from .slump import measure_slump
from .tower import family_spread, is_tower, is_wall, measure_tower, progress, standing, wall_posture


def deposit_of(frame: Frame, scenario: Scenario) -> Deposit:
    """The deposited field of a snapshot, without what is still inside the nozzle."""
    free = is_out(frame, scenario)
    return Deposit.of(
        frame["position"].compress(free, axis=0), frame["volume"][free], scenario.domain, scenario.spacing
    )


def ledger(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Mass, momentum, energies and centre of mass of all that moves freely, outside the nozzle or in its bore, summed
    in float64."""
    free = frame["held"] != CARRIED
    m = frame["mass"][free].astype(float)
    x, v, spin = (
        frame[key].compress(free, axis=0).T.astype(float, order="C") for key in ("position", "velocity", "spin")
    )

    def total(values: np.ndarray) -> np.ndarray:
        return (m * values).sum(axis=-1)  # no product of matrices, whose threads wait for one another

    mass, momentum, center = float(m.sum()), total(v), total(x)
    row = {"particles": int(free.sum()), "mass_kg": mass}
    row |= {f"momentum_{axis}_kg_m_s": float(momentum[i]) for i, axis in enumerate("xyz")}
    turn = [total(x[i - 2] * v[i - 1] - x[i - 1] * v[i - 2]) + spin[i].sum() for i in range(3)]
    row |= {f"angular_momentum_{axis}_kg_m2_s": float(turn[i]) for i, axis in enumerate("xyz")}
    row["kinetic_energy_J"] = 0.5 * float(total((v * v).sum(axis=0)))
    row["potential_energy_J"] = -float(total(scenario.potential_at(x.T)))
    row |= {f"center_{axis}_m": float(center[i]) / mass if mass else 0.0 for i, axis in enumerate("xyz")}
    return row


def lengths(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Every length that the scenario calls for, all from the deposited field, with its resolution: a single bead's once
    the path has been travelled."""
    return _lengths(frame, deposit_of(frame, scenario), scenario)


def _lengths(frame: Frame, deposit: Deposit, scenario: Scenario) -> dict[str, float]:
    row = {"resolution_m": deposit.spacing, "top_m": deposit.top() - scenario.domain.lower[2]}
    row |= measure_slump(deposit, scenario)
    if is_tower(scenario):
        row |= standing(deposit, scenario) | (wall_posture(frame, scenario) if is_wall(scenario) else {})
    elif scenario.track is not None and float(frame["time"]) >= scenario.track.end * (1.0 - 1e-6):
        row |= beads(frame, deposit, scenario)
    return row | progress(frame, scenario) | feeding(frame, scenario)


def bead_of(frame: Frame, deposit: Deposit, scenario: Scenario) -> Bead | None:
    """Sections along what was laid of the path: of all that lies there, or, where layers are not laid over one another,
    of the measured stroke's own matter."""
    path, track = scenario.toolpath, scenario.track
    free = is_out(frame, scenario)
    births = frame["birth_time"][free]
    if path is None or track is None:
        return None
    if not track.repeats:
        own = (births >= track.stroke.time[0]) & (births <= track.stroke.time[-1])
        births = births[own]
        deposit = Deposit.of(
            frame["position"][free][own], frame["volume"][free][own], scenario.domain, scenario.spacing
        )
    return measure_bead(deposit, scenario, laid_share(births, scenario))


def beads(frame: Frame, deposit: Deposit, scenario: Scenario) -> dict[str, float]:
    """Section of the bead and rise of the layers along what was laid of the path."""
    bead, path, free = bead_of(frame, deposit, scenario), scenario.toolpath, is_out(frame, scenario)
    if bead is None or path is None or scenario.track is None:
        return {}
    if not scenario.track.repeats:
        return bead.summary(1)
    rises = layer_heights(frame["position"][free], frame["birth_time"][free], scenario)
    return bead.summary(path.layers) | {f"layer_{i}_height_m": rise for i, rise in enumerate(rises, 2)}


def final_lengths(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """`lengths` and what only the finished print shows: beads and layers."""
    deposit = deposit_of(frame, scenario)
    row = _lengths(frame, deposit, scenario)
    if "bead_width_m" not in row:
        row |= beads(frame, deposit, scenario)
    free, path = is_out(frame, scenario), scenario.toolpath
    if path is not None and path.kind == "ring" and path.center is not None and path.speed > 0 and free.any():
        center = np.average(frame["position"][free, :2], axis=0, weights=frame["mass"][free])
        row["ring_drift_m"] = float(np.hypot(*(center - path.center)))
    if is_tower(scenario):
        row |= measure_tower(frame, scenario)
    if scenario.material.expansion is not None:
        row["family_spread_m"] = family_spread(frame, emitted(scenario))
    return row
