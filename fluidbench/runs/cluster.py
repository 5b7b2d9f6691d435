"""Executors by name, for the command line: a cluster's queue through submitit (the extra `slurm`)."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from ..errors import UserError, quoted, suggestion

CLUSTERS = {"here": None, "slurm": "slurm", "local": "local"}  # submitit's names; its `local` is for trying things out


def check_executor(text: str) -> None:
    """Raise UserError for what `executor_of` would refuse; writes nothing where results go."""
    with tempfile.TemporaryDirectory() as folder:
        executor_of(text, Path(folder))


def executor_of(text: str, out: Path) -> Any:
    """None for "here", otherwise a submitit executor: "slurm", or "slurm:slurm_partition=gpu,timeout_min=60" with
    submitit's own parameters. Its logs lie in the output folder. Raises UserError for what is not known, or not
    installed."""
    name, _, given = text.partition(":")
    if name not in CLUSTERS:
        raise UserError(f"--executor: no {quoted(name)}{suggestion(name, CLUSTERS)}")
    if name == "here":
        if given:
            raise UserError(f"--executor: here takes no parameters; got {quoted(given)}")
        return None
    try:
        import submitit
    except ImportError:
        raise UserError("--executor needs submitit: pip install 'fluidbench[slurm]'") from None
    parameters = dict(_parameter(part) for part in given.split(",") if part)
    try:
        executor = submitit.AutoExecutor(folder=out.absolute() / "submitit", cluster=CLUSTERS[name])
        executor.update_parameters(**parameters)
    except Exception as error:  # submitit has no common class for what it refuses
        raise UserError(f"--executor {quoted(text)}: {' '.join(str(error).split())}") from None
    return executor


def _parameter(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals:
        raise UserError(f"--executor: parameters are key=value, such as slurm_partition=gpu; got {quoted(text)}")
    return key.strip(), int(value) if value.strip().isdecimal() else value.strip()
