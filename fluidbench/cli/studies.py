"""sweep, stability, bench, ablate, select, guide, table1 and table2: studies made of many runs."""

from typing import Annotated, Any

import typer

from .app import app, finish
from .options import (
    From,
    MeasuredFile,
    Quick,
    ScenarioName,
    Seed,
    Settings,
    Shorter,
    Solvers,
    Spacing,
    Within,
    alone,
    axes_of,
    budget_of,
    count_of,
    limited,
    load_scenario,
    methods_in,
    names_in,
    placed,
    repeats_of,
    running,
    within_of,
)


@app.command()
@running(wall_limit=900.0)
def sweep(
    scenario: ScenarioName,
    over: Annotated[
        list[str],
        typer.Option(
            help="a key and its values: material.yield_stress=20:200:5 (five of them, evenly), =1:1000:4:log, or "
            "=20,50,100; again for a second key, and so on"
        ),
    ],
    solvers: Solvers = None,
    worlds: Annotated[
        int | None,
        typer.Option(
            min=1, max=10_000, help="points in one launch, where they can share one; default 64 on a GPU, 1 on a CPU"
        ),
    ] = None,
    set_: Settings = None,
    spacing: Spacing = None,
    quick: Shorter = False,
    *,
    options: Any,
) -> None:
    """Run a scenario at every combination of values of some of its keys, through every method.

    Points that differ in material or body force alone share launches on a GPU. A second call reuses what is finished.
    """
    from ..study.sweep import sweep as study

    resolved = load_scenario(scenario, set_, spacing, quick)
    axes = axes_of(over)
    finish(study(resolved, axes, methods_in(solvers), worlds=worlds, **placed(options, f"sweep-{resolved.name}")))


@app.command()
@running(wall_limit=1800.0)
def stability(
    scenario: ScenarioName = "line_bead",
    axis: Annotated[
        str | None,
        typer.Option(
            help="axes, separated by commas; default all: viscosity, youngs_modulus, "
            "poisson_ratio, yield_stress, exit_speed, density, spacing, and the "
            "methods' own, such as particles_per_cell"
        ),
    ] = None,
    solvers: Solvers = None,
    set_: Settings = None,
    spacing: Spacing = None,
    quick: Quick = False,
    *,
    options: Any,
) -> None:
    """Find the largest stable time step along material and numerical axes, beside each method's bound and theory.

    A second call reuses the points that are finished.
    """
    from ..study.stability import stability as study

    resolved = load_scenario(scenario, set_, spacing)
    axes = [] if axis is None else names_in(axis, "--axis", "axis")
    finish(study(resolved, methods_in(solvers), axes=axes, quick=quick, **placed(options, "stability")))


@app.command()
@running(wall_limit=600.0)
def bench(
    solvers: Solvers = None,
    particles: Annotated[
        str | None,
        typer.Option(help="sizes, separated by commas; default 2197,17576 on the CPU and 17576,300763 on a GPU"),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="a second for each block instead of five")] = False,
    *,
    options: Any,
) -> None:
    """Measure what this machine does: the substep of every method alone, beside what its memory allows.

    Blocks of liquid and of paste at rest, one at a time, always anew.
    """
    from ..study.bench import bench as study

    sizes = (
        None if particles is None else [count_of(n, "--particles") for n in names_in(particles, "--particles", "size")]
    )
    finish(study(methods_in(solvers), particles=sizes, quick=quick, **placed(options, "bench")))


@app.command()
@running(wall_limit=900.0)
def ablate(
    scenario: ScenarioName,
    solvers: Solvers = None,
    tolerance: Annotated[str, typer.Option(help="how far a length may move, e.g. 5%")] = "5%",
    set_: Settings = None,
    spacing: Spacing = None,
    *,
    options: Any,
) -> None:
    """Switch physical features off and numerical economies on, one at a time: what moves, what is saved.

    Ends with the leanest mix that stays within the tolerance, confirmed by a run. A second call reuses finished runs.
    """
    from ..study.ablate import ablate as study

    resolved = load_scenario(scenario, set_, spacing)
    given = [*(set_ or []), *([f"spacing={spacing!r}"] if spacing is not None else [])]
    more = placed(options, "ablate")
    finish(study(resolved, methods_in(solvers), tolerance=tolerance, called=scenario, given=given, **more))


@app.command()
@running(wall_limit=900.0)
def select(
    context: typer.Context,
    scenario: ScenarioName,
    tolerance: Annotated[str, typer.Option(help="largest relative error of any length, e.g. 5%")] = "5%",
    budget: Annotated[str | None, typer.Option(help="wall time of a run, e.g. 60s, or realtime; default none")] = None,
    within: Within = None,
    solvers: Solvers = None,
    set_: Settings = None,
    spacing: Spacing = None,
    measured: MeasuredFile = None,
    quick: Shorter = False,
    *,
    options: Any,
) -> None:
    """Recommend a method, spacing and time step: least cost within a tolerance, on this machine, with the evidence.

    Runs every method at four spacings, on a GPU at five. A second call, with another tolerance or budget, reuses the
    runs.
    """
    from ..study.select import select as study

    resolved = load_scenario(scenario, set_, spacing, quick)
    longest, pace = budget_of(budget)
    more = placed(limited(context, options), f"select-{resolved.name}")
    chosen = study(
        resolved,
        methods_in(solvers),
        tolerance=tolerance,
        budget=longest,
        pace=pace,
        within=within_of(within),
        called=scenario,
        measured=measured or (),
        **more,
    )
    finish(chosen)


@app.command()
@running(wall_limit=900.0)
def guide(
    context: typer.Context,
    scenarios: Annotated[
        list[str] | None, typer.Argument(help="scenarios, by name or as TOML files; default one for each job")
    ] = None,
    from_: From = None,
    tolerance: Annotated[str, typer.Option(help="largest relative errors of any length, separated by commas")] = (
        "2%,5%,10%"
    ),
    within: Within = None,
    solvers: Solvers = None,
    quick: Shorter = False,
    *,
    options: Any,
) -> None:
    """Which method for what: the cheapest method and spacing for each job and tolerance, on this machine, as one chart.

    What `select` does, for paste, concrete, foam, honey and water, or for the scenarios named: hours on a CPU, or as
    long as it may take `--within`.
    """
    from ..study.guide import guide as study
    from ..study.guide import published

    shares = names_in(tolerance, "--tolerance", "tolerance")
    if from_ is not None:
        alone(context, "from_", "tolerance")
        finish(published(from_, shares, placed(options, "guide-published").get("out")))
        return
    more = placed(limited(context, options), "guide")
    limit = within_of(within)
    finish(study(scenarios or None, methods_in(solvers), tolerances=shares, quick=quick, within=limit, **more))


@app.command()
@running(wall_limit=3600.0)
def table1(
    context: typer.Context,
    scenario: ScenarioName = "line_bead",
    from_: From = None,
    repeats: Annotated[int, typer.Option(min=2, help="runs of each method on the scenario, for the spread")] = 3,
    set_: Settings = None,
    spacing: Spacing = None,
    quick: Quick = False,
    seed: Seed = 0,
    *,
    options: Any,
) -> None:
    """Judge the published table of adjectives: every cell beside a measured number and a verdict computed by a rule.

    A second call reuses the runs that are finished.
    """
    from ..paper.table1 import coarser, published
    from ..paper.table1 import table1 as study

    if from_ is not None:
        alone(context, "from_")
        finish(published(from_, placed(options, "table1-published").get("out")))
        return

    resolved = load_scenario(scenario, set_, spacing)
    if quick and spacing is None:
        resolved = resolved.replace(spacing=coarser(resolved))
    finish(study(resolved, repeats=repeats_of(repeats), quick=quick, seed=seed, **placed(options, "table1")))


@app.command()
@running(wall_limit=1800.0)
def table2(
    context: typer.Context,
    solvers: Solvers = "mpm",
    from_: From = None,
    pools: Annotated[str, typer.Option(help="pool sizes to preallocate; `fit` is as many as needed")] = "fit,298000",
    variants: Annotated[
        str | None,
        typer.Option(
            help="towers, separated by commas: plain, curing, expansion, expansion + curing, ...; default all"
        ),
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="runs of each row, without and with pictures")] = 5,
    quick: Quick = False,
    *,
    options: Any,
) -> None:
    """Time the printed tower, feature by feature, with and without pictures; the paper's claims as verdicts.

    A second call reuses the runs that are finished.
    """
    from ..paper.table2 import published
    from ..paper.table2 import table2 as study

    if from_ is not None:
        alone(context, "from_")
        finish(published(from_, placed(options, "table2-published").get("out")))
        return
    sizes = [None if part == "fit" else count_of(part, "--pools") for part in names_in(pools, "--pools", "pool")]
    towers = None if variants is None else names_in(variants, "--variants", "variant")
    more = placed(options, "table2")
    finish(study(methods_in(solvers), pools=sizes, variants=towers, repeats=repeats_of(repeats), quick=quick, **more))
