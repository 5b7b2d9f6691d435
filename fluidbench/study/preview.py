"""What there is before anything runs: the resolved scenario with its needs, and the state of the machine."""

import json
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from ..errors import Obstacle
from ..registry import get_method
from ..report.table import Table, number
from ..scenario import Scenario
from ..scenario.bore import Bore
from .estimate import Estimate, estimate
from .workplace import methods_of


def preview(scenario: Scenario) -> tuple[str, list[Table]]:
    """The scenario as text, and tables of derived numbers, bounds and needs."""
    text = json.dumps(_shortened(scenario.model_dump(mode="json", exclude_none=True, exclude_defaults=True)), indent=2)
    estimates = [estimate(scenario, get_method(name)) for name in methods_of(None)]
    return text, [derived(scenario), *_bounds(estimates), _needs(estimates)]


def _shortened(value: Any) -> Any:
    """A dumped scenario with the size of an array for its numbers."""
    if isinstance(value, dict):
        packed = set(value) == {"float64", "shape"}
        size = f"an array of {' x '.join(map(str, value['shape']))}" if packed else ""
        return size or {key: _shortened(inner) for key, inner in value.items()}
    return [_shortened(inner) for inner in value] if isinstance(value, list) else value


def derived(scenario: Scenario) -> Table:
    """Numbers that follow from the scenario alone."""
    m, c = scenario.material, scenario.liquid_sound_speed
    tick, ticks, per_output = scenario.schedule
    table = Table("Derived numbers", ["", "value", "unit"])
    rows = [
        ("reference speed", scenario.reference_speed, "m/s"),
        ("bulk modulus K", m.bulk(c), "Pa"),
        ("shear modulus G", m.shear_modulus, "Pa"),
        ("wave speed", scenario.wave_speed, "m/s"),
        ("tick", tick, "s"),
        ("ticks", ticks, ""),
        ("ticks between outputs", per_output, ""),
    ]
    if scenario.nozzle is not None and scenario.track is not None:
        n = scenario.nozzle
        rows += [
            ("flow rate Q", n.rate, "m^3/s"),
            ("exit speed U", n.speed, "m/s"),
            ("end of extrusion", scenario.track.end, "s"),
        ]
        if scenario.sticks:
            pressure = Bore(m, n.diameter, n.speed).pressure_drop(n.rise)
            rows.append(("pressure along the bore, developed flow", pressure, "Pa"))
    table.rows.extend([name, number(value), unit] for name, value, unit in rows)
    return table


def _bounds(estimates: list[Estimate]) -> list[Table]:
    table = Table("Bounds at the reference speed", ["method", "bound", "dt [s]", "formula", "source"])
    for e in estimates:
        for bound in e.bounds:
            mark = " (binding)" if e.plan is not None and bound == e.plan.binding else ""
            table.rows.append([e.method, bound.name + mark, number(bound.dt), bound.formula, bound.source])
        if not e.bounds:
            table.rows.append([e.method, "-", "-", "it picks its own step", "-"])
    return [table]


def _needs(estimates: list[Estimate]) -> Table:
    table = Table("Needs", ["method", "particles", "dt [s]", "substeps", "memory [MiB]", "time on one core [s]"])
    for e in estimates:
        steps = ["-", "-"] if e.plan is None else [number(e.plan.dt), str(e.substeps)]
        needs = [*steps, number(e.memory_bytes / 2**20), "-" if e.wall_s is None else number(e.wall_s)]
        table.rows.append([e.method, str(e.particles), *needs])
    notes = [f"{e.method} refuses: {e.refusal}" for e in estimates if e.refusal]
    notes += [f"{e.method} approximates: {line}" for e in estimates for line in e.approximations]
    return Table(table.title, table.head, table.rows, "\n".join(notes))


def diagnosis() -> list[str]:
    """One line a fact: versions, devices, and for whatever is missing how to get it."""
    lines = [f"python {platform.python_version()} on {platform.platform()}, {os.cpu_count()} cores"]
    for package in (
        "fluidbench",
        "warp-lang",
        "taichi",
        "numpy",
        "scipy",
        "pandas",
        "pyarrow",
        "pydantic",
        "matplotlib",
        "plotly",
    ):
        try:
            lines.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            lines.append(f"{package} is MISSING: pip install {package}")
    return [*lines, *_devices()]


def _devices() -> list[str]:
    import warp as wp

    from ..native.device import kernels, start_warp

    try:
        start_warp()
    except Obstacle as error:
        return [f"kernels: {error}"]
    lines = [f"kernels: {kernels().note or f'compiled into {kernels().folder}'}", "device cpu: available"]
    for device in wp.get_cuda_devices():
        lines.append(f"device {device.alias}: {device.name}, {device.total_memory / 2**30:.1f} GiB, sm_{device.arch}")
    if not wp.get_cuda_devices():
        lines.append("device cuda: none found; runs on a GPU need an NVIDIA card with driver 580 or later")
    return lines
