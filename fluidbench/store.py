"""Results on disk: one folder a run, written atomically, found again by what went into it."""

import hashlib
import json
import os
import tempfile
from pathlib import Path
from typing import Any

from . import __version__
from .errors import UserError

RECORD = "record.json"
FINAL = {"completed", "diverged", "out_of_capacity", "refused"}  # verdicts that another attempt would not change


def key_of(inputs: dict[str, Any]) -> str:
    """Ten characters that name a run by its inputs and the package version."""
    text = json.dumps({**inputs, "version": __version__}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:10]


def write_atomically(path: Path, data: bytes | str) -> None:
    """Write beside the target, then rename: a reader sees the old file or the whole new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    with os.fdopen(handle, "wb") as file:
        file.write(data.encode() if isinstance(data, str) else data)
    Path(name).replace(path)


class Store:
    """The output folder of a study."""

    def __init__(self, root: Path) -> None:
        self.root = root
        try:
            root.mkdir(parents=True, exist_ok=True)
            probe = tempfile.NamedTemporaryFile(dir=root)  # noqa: SIM115
            probe.close()
        except OSError as error:
            raise UserError(
                f"cannot write to the output folder {root}: {error.strerror}; choose another with --out"
            ) from None

    def folder(self, name: str, inputs: dict[str, Any]) -> Path:
        return self.root / "runs" / f"{name}-{key_of(inputs)}"

    def record(self, folder: Path) -> dict[str, Any] | None:
        """The record of a run that need not be repeated; None when there is none."""
        path = folder / RECORD
        if not path.is_file():
            return None
        record = json.loads(path.read_text())
        return record if record["verdict"] in FINAL else None
