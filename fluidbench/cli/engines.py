"""engines: methods that others wrote, added and removed."""

from typing import Annotated

import typer

from .app import app

engines = typer.Typer(
    name="engines",
    no_args_is_help=True,
    help="Engines that others wrote: list them, add them, remove them.",
    rich_markup_mode=None,
)
app.add_typer(engines)
Name = Annotated[str, typer.Argument(help="an engine (see `fluidbench engines list`)")]


@engines.command("list")
def list_() -> None:
    """Engines that can be added, what is there of them, and the methods that they bring."""
    from ..engines.catalogue import ENGINES
    from ..engines.environment import installed, missing

    for engine in ENGINES.values():
        found, reason = installed(engine), missing(engine)
        state = f"{found.version}, installed" if found is not None and reason is None else reason
        typer.echo(f"{engine.name:<14} {state}")
        typer.echo(f"{'':<14} {engine.title}, {engine.licence}, {engine.address}")
        typer.echo(f"{'':<14} methods: {', '.join(engine.methods)}")


@engines.command()
def add(name: Name) -> None:
    """Install an engine in an environment of its own, below your data folder; an engine that is there is made anew."""
    from ..engines.catalogue import engine_named
    from ..engines.environment import add as make

    engine = engine_named(name)
    made = make(engine, typer.echo)
    typer.echo(f"{engine.title} {made.version} is installed; methods: {', '.join(engine.methods)}")


@engines.command()
def remove(name: Name) -> None:
    """Remove an engine's environment."""
    from ..engines.catalogue import engine_named
    from ..engines.environment import remove as clear

    engine = engine_named(name)
    typer.echo(f"{engine.title} is removed" if clear(engine) else f"{engine.title} was not installed")
