"""Finding, reading and overriding scenarios: TOML files with `extends`, `key=value` overrides, errors with a place."""

import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import UserError, quoted, suggestion
from .mistakes import mistakes, short, unknown_key
from .numerics import check_numerics, check_sections
from .scenario import Scenario
from .units import in_si

DEEPEST = 32  # files that extend one another
LARGEST = 2**20  # bytes of a scenario file


def shipped() -> dict[str, Path]:
    """Name -> file of every scenario in the package."""
    return {path.stem: path for path in _data("extrusion", ".toml")}


def reference_tables() -> list[Path]:
    """The tables that runs are compared with; the answers that `validate` found are none of them."""
    return [path for path in _data("reference", ".csv") if path.stem != "known_answers"]


def reference_table(name: str) -> Path:
    """The file of a reference table."""
    return next(path for path in _data("reference", ".csv") if path.stem == name)


def _data(folder: str, suffix: str) -> list[Path]:
    """Files of the package `scenarios`, by name."""
    found = (Path(str(entry)) for entry in files("scenarios").joinpath(folder).iterdir())
    return sorted(path for path in found if path.suffix == suffix)


def find(reference: str | Path) -> Path:
    """The file meant by a path or by the name of a shipped scenario."""
    if not isinstance(reference, str | Path):
        raise UserError(f"a scenario's name or its file is wanted (got {quoted(reference)})")
    known, path = shipped(), Path(reference)
    try:
        there, is_file = path.exists(), path.is_file()
    except (OSError, ValueError) as error:  # a name that is too long, or has a null character
        raise UserError(f"{quoted(str(reference))} is no file name: {_why(error)}") from None
    if str(reference) in known and not (there and path.suffix == ".toml"):
        return known[str(reference)]
    if path.suffix == ".toml" or there:
        if not is_file:
            raise UserError(_no_file(path) if there else f"no such scenario file: {quoted(str(path))}")
        return path
    raise UserError(f"no scenario named {quoted(str(reference))}{suggestion(str(reference), known)}")


def _no_file(path: Path) -> str:
    """What is there instead of a file."""
    what = "a folder" if path.is_dir() else "no regular file"
    return f"{quoted(str(path))} is {what}; a shipped scenario's name or a TOML file is wanted"


def _why(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)


def load(reference: str | Path, overrides: dict[str, Any] | list[str] | None = None, quick: bool = False) -> Scenario:
    """Read a scenario and apply overrides such as {"material.yield_stress": 50} or ["material.yield_stress=50"].

    `reference` is the name of a shipped scenario, or a TOML file; the values of `overrides` are in SI units, and None
    takes a key out. `quick` merges the file's own [quick] table first, whose keys are checked in any case; a file
    without one gets a third more spacing.

    Raises UserError naming the file and key of whatever is wrong.
    """
    path = find(reference)
    table = _read(path, ())
    table.setdefault("name", path.stem)
    shorter = table.pop("quick", None)
    if not isinstance(shorter, dict | None):
        raise UserError(f"{path}: quick: a table is wanted (got {quoted(shorter)})")
    if shorter is not None:
        _check_keys(shorter, path)
    if quick:
        table = _merge(table, shorter) if shorter is not None else _coarser(table)
    if isinstance(overrides, str | list | tuple):
        overrides = dict(parse_override(text) for text in ([overrides] if isinstance(overrides, str) else overrides))
    if not isinstance(overrides, dict | None):
        raise UserError(f"overrides are a table, or key=value texts; got {quoted(overrides)}")
    for key, value in (overrides or {}).items():
        assign(table, key, value)
    return validate(table, f"{path} with --set" if overrides else str(path))


def _check_keys(shorter: dict[str, Any], path: Path) -> None:
    """Raise UserError for a key of [quick] that no scenario has, or no method in its section of numerics."""
    if unknown := unknown_key(shorter, Scenario):
        raise UserError(f"{path}: quick: {unknown}")
    sections = shorter.get("numerics")
    try:
        check_sections(sections if isinstance(sections, dict) else {})
    except UserError as error:
        raise UserError(f"{path}: quick: {error}") from None


def _coarser(table: dict[str, Any]) -> dict[str, Any]:
    """A third more spacing, where there is one that is a number."""
    try:
        spacing = in_si(table.get("spacing"), "m")
    except ValueError:  # said with its place when the table is validated
        return table
    return table | {"spacing": 4 / 3 * spacing} if isinstance(spacing, int | float) else table


def define(name: str, **table: Any) -> Scenario:
    """A scenario from keyword tables, validated like a file.

    `name` is what folders are called by; `table` holds the keys of a TOML file, in SI units.

    Raises UserError with the key of whatever is wrong.
    """
    return validate({"name": name, **table}, name)


def validate(table: dict[str, Any], where: str) -> Scenario:
    """A table as a Scenario; raises UserError with one line a mistake, each with the key and the cure."""
    try:
        scenario = Scenario.model_validate(table)
    except ValidationError as error:
        raise mistakes(error, where, Scenario) from None
    except (ArithmeticError, MemoryError, RecursionError) as error:
        raise UserError(f"{where}: cannot be computed with ({type(error).__name__}: {error})") from None
    try:
        check_numerics(scenario)
    except UserError as error:
        raise UserError(f"{where}: {error}") from None
    return scenario


def parse_override(text: str) -> tuple[str, Any]:
    """'key=value' -> (key, value), the value read as TOML and otherwise as a string; `none` takes the key out."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise UserError(f"--set takes key=value, such as material.yield_stress=50; got {quoted(text)}")
    if value.strip() == "none":
        return key.strip(), None
    try:
        found = tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()
    except (RecursionError, ValueError) as error:
        raise UserError(f"--set {quoted(key.strip())[1:-1]}: {quoted(value)} cannot be read: {error}") from None
    if set(found) != {"value"}:
        raise UserError(f"--set takes one key=value; got {quoted(text)}")
    return key.strip(), found["value"]


def _read(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    """A file's table with the tables that it extends underneath."""
    path = path.resolve()
    if path in seen:
        raise UserError(f"{path}: extends itself by way of {seen[-1].name}")
    if len(seen) >= DEEPEST:
        raise UserError(f"{seen[0]}: extends more than {DEEPEST} files deep")
    try:
        if path.stat().st_size > LARGEST:
            raise UserError(f"{path}: {path.stat().st_size} bytes are no scenario; {LARGEST} at most")
        table = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:  # TOML's and Unicode's errors are values'
        raise UserError(f"{path}: not valid TOML: {short(error)}") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from None
    own = table.get("toolpath")
    if isinstance(own, dict) and isinstance(own.get("file"), str):  # beside the file that names it
        own["file"] = str(path.parent / own["file"])
    base = table.pop("extends", None)
    if base is None:
        return table
    if not isinstance(base, str):
        raise UserError(f"{path}: extends: the name of a scenario or a file is wanted (got {quoted(base)})")
    try:
        beside = path.parent / base
        further = beside if beside.is_file() else find(base)
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: extends: {quoted(base)} is no file name: {_why(error)}") from None
    except UserError as error:
        raise UserError(f"{path}: extends: {error}") from None
    return _merge(_read(further, (*seen, path)), table)


def _merge(base: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """`change` over `base`: tables merge key by key, anything else is replaced."""
    merged = dict(base)
    for key, value in change.items():
        both = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = _merge(base[key], value) if both else value
    return merged


def assign(table: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key, stepping into tables by name and into lists by number; None takes it out."""
    *parents, last = key.split(".")
    if len(parents) > DEEPEST or not all((*parents, last)):
        raise UserError(f"--set {quoted(key)}: keys are names joined by dots, such as material.yield_stress")
    node: Any = table
    for i, part in enumerate(parents):
        if isinstance(node, list | tuple):
            node = node[_position(node, part, key)]
        else:  # `bodies.0.kind` begins the list of bodies where there is none
            node = node.setdefault(part, [{}] if parents[i + 1 : i + 2] == ["0"] else {})
        if not isinstance(node, dict | list):
            raise UserError(f"--set {key}: {quoted(part)} is a value, not a table")
    if isinstance(node, list):
        node[_position(node, last, key)] = value
    elif value is None:
        node.pop(last, None)
    else:
        node[last] = value


def _position(node: list[Any] | tuple[Any, ...], part: str, key: str) -> int:
    if not (part.isascii() and part.isdigit()) or len(part) > 9 or int(part) >= len(node):
        raise UserError(f"--set {key}: {quoted(part)} must be a number below {len(node)}")
    return int(part)
