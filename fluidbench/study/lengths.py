"""The lengths of a finished run."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..runs.record import Record

LENGTHS = ("bead_width_m", "bead_height_m", "bead_area_m2", "slump", "spread_radius_m", "front_x_m", "height_m")


def lengths_of(record: Record) -> dict[str, float]:
    """The lengths, areas and slumps of a finished run: what a printer cares about."""
    return lengths_in(record.measures)


def lengths_in(found: Mapping[str, float]) -> dict[str, float]:
    """Those among measures."""
    layers = [key for key in found if key.startswith("layer_") and key.endswith(("height_m", "width_m", "radius_m"))]
    return {key: found[key] for key in (*LENGTHS, *layers) if math.isfinite(found.get(key, math.nan))}
