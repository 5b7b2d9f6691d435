"""Progress of work, in a terminal or a notebook: a bar over all, and one for each piece that is under way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from ..runs.execute import Hooks
from ..runs.record import Run
from ..runs.work import Work

if TYPE_CHECKING:
    from rich.console import Console

FEW = 4  # reused runs that are named one by one
Line = Callable[[int, Any], str]  # what is said of piece i when it has ended; nothing if empty


class Display:
    """Shows work while it is entered; gives the hooks that the work reports to. Quiet where nobody looks, but for the
    lines that `line` makes of what has ended, and for what was reused."""

    def __init__(
        self,
        title: str,
        planned: Sequence[Work],
        line: Line | None = None,
        quiet: bool = False,
        console: Console | None = None,
    ) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        self.console = console or Console(stderr=True)
        self.line, self.planned, self.quiet = line, planned, quiet
        notebook = self.console.is_jupyter and find_spec("ipywidgets") is not None  # without it there is no bar
        seen = not quiet and (self.console.is_terminal or notebook)
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[state]}"),
            TimeElapsedColumn(),
        )
        self.progress = Progress(*columns, console=self.console, disable=not seen)
        self.overall = self.progress.add_task(title, total=len(planned), state="")
        self.tasks: dict[int, Any] = {}
        self.reused: list[Run] = []

    def __enter__(self) -> Hooks:
        self.progress.start()
        return Hooks(self.started, self.step, self.ended, self.note)

    def __exit__(self, *_: object) -> None:
        self.progress.stop()
        if self.reused and not self.quiet:
            self.note(f"reused: {_named(self.reused)}; --fresh (fresh=True) runs them again")

    def note(self, text: str) -> None:
        self.console.print(f"fluidbench: {text}", markup=False, highlight=False, soft_wrap=True)

    def started(self, i: int, work: Work, reused: bool) -> None:
        if not reused:
            self.tasks[i] = self.progress.add_task(f"  {work.name}{work.target.suffix}", total=100, state="compiling")

    def step(self, i: int, state: dict[str, Any]) -> None:
        text = f"t = {state['time']:.3f} of {state['until']:g} s, top speed {state['speed']:.3g} m/s"
        self.progress.update(self.tasks[i], completed=int(100 * state["time"] / state["until"]), state=text)

    def ended(self, i: int, result: Any) -> None:
        if i in self.tasks:
            self.progress.remove_task(self.tasks.pop(i))
        state = f"{result.label} {result.verdict}" if isinstance(result, Run) else ""
        self.progress.update(self.overall, advance=1, state=state)
        if isinstance(result, Run) and result.reused:
            self.reused.append(result)
        text = "" if self.line is None else self.line(i, result)
        if text and not self.quiet:
            self.console.print(text, markup=False, highlight=False, soft_wrap=True)


def _named(reused: Sequence[Run]) -> str:
    """Which runs are of an earlier call, and of when."""
    times = [run.record.machine.get("time", "no time") for run in reused]
    if len(reused) <= FEW:
        return ", ".join(f"{run.label} ({time})" for run, time in zip(reused, times, strict=True))
    return f"{len(reused)} runs, the oldest of {min(times)}"
