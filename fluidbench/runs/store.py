"""Results on disk: one folder a run, written atomically, found again by what went into it, trusted only if whole."""

import errno
import hashlib
import json
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import Obstacle, UserError, quoted
from ..files import PART, digest, remove_quietly, write_atomically
from .work import canonical, key_of

RECORD, SEAL, CLAIM = "record.json", "seal", "claim.lock"
PATIENCE = 5.0  # seconds after which somebody who waits for a claim is told


def seal(record: Mapping[str, Any]) -> str:
    """What a record's content sums to: a record that was edited, or torn, does not match its seal."""
    return hashlib.sha256(canonical({k: v for k, v in record.items() if k != SEAL})).hexdigest()


def write_record(
    folder: Path, record: dict[str, Any], files: Iterable[Path] = (), name: str = RECORD
) -> dict[str, Any]:
    """Seal a record with the sums of the files that belong to it, write it, and return it as a reader will see it."""
    record = json.loads(json.dumps(record | {"files": {path.name: digest(path) for path in files}}))
    record[SEAL] = seal(record)
    write_atomically(folder / name, json.dumps(record, indent=1))
    return record


def read_record(folder: Path, name: str = RECORD) -> tuple[dict[str, Any] | None, str]:
    """(record, "") of a folder; (None, why not) where it is missing, torn or edited, or a file of it is."""
    path = folder / name
    if not path.exists():
        return None, ""
    try:
        record = json.loads(path.read_text())
        whole = isinstance(record, dict) and record.get(SEAL) == seal(record) and isinstance(record.get("files"), dict)
    except (OSError, ValueError, RecursionError):
        return None, f"{name} cannot be read"
    if not whole:
        return None, f"{name} is not as it was written"
    for file, expected in record["files"].items():
        try:
            if digest(folder / file) != expected:
                return None, f"{file} is not as it was written"
        except OSError:
            return None, f"{file} cannot be read" if (folder / file).exists() else f"{file} is missing"
    return record, ""


class Store:
    """The output folder of a study; it comes into being with the first result.

    With `fresh` nothing that was there before is reused. `keeper` keeps a temporary folder as long as somebody holds
    it.
    """

    def __init__(self, root: Path, fresh: bool = False, keeper: Any = None) -> None:
        self.root, self.fresh, self.keeper = root, fresh, keeper
        self.made: set[Path] = set()  # folders of runs that were made on this store's behalf
        try:
            _try_to_write(root)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            where = quoted(str(root))[1:-1]
            raise UserError(f"cannot write to the output folder {where}: {reason}; choose another with --out") from None

    def folder(self, name: str, inputs: Mapping[str, Any]) -> Path:
        return self.root / "runs" / f"{name}-{key_of(inputs)}"

    def may_reuse(self, folder: Path) -> bool:
        """Whether what lies in a folder may be reused: not with `fresh`, unless it was made on this store's behalf."""
        return not self.fresh or folder in self.made


def _try_to_write(root: Path) -> None:
    """Write, and remove, a file where the folder is or would be; raises OSError where that cannot be."""
    there = root
    while not there.exists():
        there = there.parent
    if not there.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "Not a directory")
    tempfile.NamedTemporaryFile(dir=there).close()
    if there != root and len(root.name.encode()) > 255:
        raise OSError(errno.ENAMETOOLONG, "File name too long")


@contextmanager
def claimed(folder: Path, note: Callable[[str], None]) -> Iterator[None]:
    """Hold a run's folder: of two studies that want the same run the second waits, and finds it finished. The claim of
    a process that was killed does not hold."""
    from filelock import SoftFileLock, Timeout

    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = SoftFileLock(folder / CLAIM)
        try:
            lock.acquire(timeout=PATIENCE)
        except Timeout:
            note(f"waiting for {folder.name}, which another process makes (it is gone? delete {folder / CLAIM})")
            lock.acquire()
    except OSError as error:
        raise Obstacle(f"cannot write to {folder}: {error.strerror}") from None
    try:
        for part in folder.glob(f".*{PART}"):  # of somebody who was killed
            remove_quietly(part)
        yield
    finally:
        lock.release()
