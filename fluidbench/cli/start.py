"""init: a first scenario of one's own, by five questions."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from ..errors import UserError, quoted
from .app import app


@app.command()
def init(
    file: Annotated[Path, typer.Argument(help="the file to write")] = Path("my_print.toml"),
    defaults: Annotated[bool, typer.Option("--defaults", help="ask nothing: a bead of paste")] = False,
    force: Annotated[bool, typer.Option("--force", help="write over a file that is there")] = False,
) -> None:
    """Ask five questions about a print and write a commented scenario that runs."""
    from ..files import write_atomically
    from ..scenario.library import load
    from ..study.starter import QUESTIONS, check, outlook, scenario_text, suited

    if file.suffix != ".toml":
        raise UserError(f"{quoted(str(file))}: a scenario's file ends in .toml")
    if "\0" in str(file):
        raise UserError(f"{quoted(str(file))} is no name of a file")
    if file.exists() and not force:
        raise UserError(f"{quoted(str(file))} is there already; give another name, or --force")
    answers: dict[str, str] = {}
    suits: dict[str, str] = {}
    for number, question in enumerate(QUESTIONS, 1):
        default = suits.get(question.key, question.default)
        answer = default
        while not defaults:
            try:
                answer = typer.prompt(f"{number}/{len(QUESTIONS)} {question.text}", default=default)
                check(question.key, answer)
                break
            except UserError as error:
                typer.echo(f"  {error}")
            except typer.Abort:
                raise UserError(f"question {number} was not answered; --defaults asks none") from None
        answers[question.key] = answer
        if question.key == "material":
            suits = suited(answer)
    write_atomically(file, scenario_text(answers, shlex.quote(str(file))))
    typer.echo(f"written: {file}")
    for line in outlook(load(file)):
        typer.echo(line)
    name = shlex.quote(str(file))
    typer.echo(f"next: fluidbench show {name} --path; fluidbench compare {name}; fluidbench select {name} --within 6m")
