"""What a run has of what somebody measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..scenario.measured import ALONG, Measured
from .ledger import bead_of, deposit_of

if TYPE_CHECKING:
    from ..runs.record import Run


def computed(run: Run, measured: Sequence[Measured]) -> list[float]:
    """The values in a finished run [SI], NaN where it has none."""
    bead = None
    if any(one.place is not None for one in measured):
        frame = run.frame()
        bead = bead_of(frame, deposit_of(frame, run.scenario), run.scenario)
    found = []
    for one in measured:
        if one.place is None:
            found.append(run.record.measures.get(one.key, math.nan))
        elif bead is None or not bead.station[0] <= one.place <= bead.station[-1]:
            found.append(math.nan)
        else:
            found.append(float(np.interp(one.place, bead.station, getattr(bead, ALONG[one.key]))))
    return found
