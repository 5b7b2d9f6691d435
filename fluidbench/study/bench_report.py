"""What `bench` shows: speeds beside the machine's limit, and published speeds for scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..measure.reference import table as reference
from ..method.target import Target
from ..report.plot import Plot, Trace, colour
from ..report.report import Report
from ..report.table import Table

Row = dict[str, Any]
PUBLISHED = "speed_particle_codes_published"


def report(rows: Sequence[Row], target: Target) -> Report:
    import pandas as pd

    sound = [row for row in rows if "reason" not in row]
    lines = [
        f"{row['method']}, {row['material']}, {row['particles']:,} particles: {row['substeps_per_s']:,.0f} substeps/s"
        + ("" if row["share_of_limit"] is None else f", {row['share_of_limit']:.0%} of what memory allows")
        + "."
        for row in sound
    ]
    subtitle = "A block of material at rest in a closed box; substeps alone, compilation apart"
    if sound:
        subtitle += (
            f"; on {target.device}, whose memory streams {sound[0]['memory_GB_per_s']:.3g} GB/s and whose nearest "
            f"caches give {sound[0]['cache_GB_per_s']:.3g} GB/s" + (" (one thread)" * (target.device == "cpu"))
        )
    return Report(
        "bench",
        f"fluidbench bench: {target.device}",
        f"{subtitle}.",
        lines,
        [_speeds(rows), _published()],
        pd.DataFrame(rows),
        _plots(sound) if sound else [],
        failures=[f"{r['method']}, {r['material']}, {r['particles']:,}: {r['reason']}" for r in rows if "reason" in r],
    )


def _speeds(rows: Sequence[Row]) -> Table:
    table = Table(
        "Speed of a substep",
        ["method", "material", "particles", "substeps/s", "M p-s/s", "M p-s/CPU s", "limit", "share", "B/particle"],
        note="M p-s: million particle-substeps. limit: substeps/s if a substep took no longer than to move its bytes.",
    )
    for row in rows:
        named = [row["method"], row["material"], f"{row['particles']:,}"]
        if "reason" in row:
            table.rows.append([*named, row["reason"], *["-"] * 5])
            continue
        known = row["share_of_limit"] is not None
        table.rows.append(
            [
                *named,
                f"{row['substeps_per_s']:,.4g}",
                f"{row['particle_substeps_per_s'] / 1e6:.3g}",
                f"{row['particle_substeps_per_cpu_s'] / 1e6:.3g}",
                f"{row['limit_substeps_per_s']:,.4g}" if known else "-",
                f"{row['share_of_limit']:.0%}" if known else "-",
                f"{row['bytes_per_particle']:,.0f}",
            ]
        )
    return table


def _published() -> Table:
    """Speeds of other codes, as their authors say."""
    table = Table(
        "Published, for scale",
        ["method", "code", "hardware", "particles", "M p-s/s"],
        note="other cases, other neighbours, other physics: sources in scenarios/reference",
    )
    for row in reference(PUBLISHED).dropna(subset=["mps"]).to_dict("records"):
        table.rows.append([row["method"], row["code"], row["hardware"], f"{row['particles']:,}", f"{row['mps']:.3g}"])
    return table


def _plots(rows: Sequence[Row]) -> list[Plot]:
    """Cost by size, with what memory allows dashed in, and memory beside it."""
    cost, limits, memory = [], [], []
    for method, material in dict.fromkeys((row["method"], row["material"]) for row in rows):
        own = [row for row in rows if (row["method"], row["material"]) == (method, material)]
        shade = colour(method if material == rows[0]["material"] else f"{method} ({material})")
        sizes = [row["particles"] for row in own]
        spent = [1e9 / row["particle_substeps_per_s"] for row in own]
        cost.append(Trace(f"{method} ({material})", sizes, spent, "line+points", shade))
        memory.append(
            Trace(f"{method} ({material})", sizes, [row["bytes_per_particle"] for row in own], "line+points", shade)
        )
        if all(row["limit_substeps_per_s"] is not None for row in own):
            least = [1e9 / (row["limit_substeps_per_s"] * row["particles"]) for row in own]
            limits.append(Trace("", sizes, least, "dashed", shade))
    return [
        Plot(
            "cost_by_size",
            "Cost by size; dashed: if a substep only moved its bytes",
            "particles",
            "ns per particle and substep",
            [*cost, *limits],
            log=True,
        ),
        Plot("memory_by_size", "Memory by size", "particles", "bytes a particle", memory, log=True),
    ]
