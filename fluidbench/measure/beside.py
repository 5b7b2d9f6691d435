"""What a run has of what somebody measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..scenario.measured import ALONG, Measured
from .ledger import bead_of, deposit_of

if TYPE_CHECKING:
    from ..runs.record import Run


def computed(run: Run, measured: Measured) -> float:
    """The value in a finished run [SI]; NaN where it has none."""
    if measured.place is None:
        return run.record.measures.get(measured.key, float("nan"))
    frame = run.frame()
    bead = bead_of(frame, deposit_of(frame, run.scenario), run.scenario)
    if bead is None or not bead.station[0] <= measured.place <= bead.station[-1]:
        return float("nan")
    return float(np.interp(measured.place, bead.station, getattr(bead, ALONG[measured.key])))
