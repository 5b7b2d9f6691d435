"""Files that are whole or not there."""

import hashlib
import itertools
import os
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import Obstacle

if TYPE_CHECKING:
    import pandas as pd

PART = ".part"


def write_atomically(path: Path, data: bytes | str) -> None:
    """Write beside the target, then rename: a reader sees the old file or the whole new one.

    Raises Obstacle where the system will not have it; nothing is left behind then.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}{PART}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data.encode() if isinstance(data, str) else data)
        make_way(path)
        part.replace(path)
    except OSError as error:
        remove_quietly(part)
        raise Obstacle(f"cannot write {path}: {error.strerror}") from None
    except BaseException:
        remove_quietly(part)
        raise


def make_way(path: Path) -> None:
    """Clear a folder from where a file will be; one that holds something is put aside, under another name."""
    if path.is_dir() and not path.is_symlink():
        try:
            path.rmdir()
        except OSError:
            aside = (path.with_name(f"{path.name}.aside-{i}") for i in itertools.count(1))
            path.rename(next(name for name in aside if not name.exists()))


def remove_quietly(path: Path) -> None:
    """Remove a file that may not be there, on a disk that may not answer."""
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return


def write_npz(path: Path, arrays: Mapping[str, Any]) -> None:
    """Arrays by name as one file of NumPy's, written atomically."""
    import io

    import numpy as np

    buffer = io.BytesIO()
    np.savez(buffer, **dict[str, Any](arrays))
    write_atomically(path, buffer.getvalue())


def write_parquet(path: Path, table: "pd.DataFrame") -> None:
    """A table as parquet, written atomically."""
    import io

    buffer = io.BytesIO()
    table.to_parquet(buffer)
    write_atomically(path, buffer.getvalue())


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
