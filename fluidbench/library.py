"""Finding, reading and overriding scenarios: TOML files with `extends`, `key=value` overrides, errors with a place."""

import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from .errors import UserError, suggestion
from .scenario import Scenario


def shipped() -> dict[str, Path]:
    """Name -> file of every scenario in the package."""
    import scenarios

    root = Path(scenarios.__file__).parent
    return {path.stem: path for path in sorted(root.glob("extrusion/*.toml"))}


def find(reference: str | Path) -> Path:
    """The file meant by a path or by the name of a shipped scenario."""
    path = Path(reference)
    if path.suffix == ".toml" or path.exists():
        if not path.is_file():
            raise UserError(f"no such scenario file: {path}")
        return path
    known = shipped()
    if str(reference) not in known:
        raise UserError(f"no scenario named '{reference}'{suggestion(str(reference), known)}")
    return known[str(reference)]


def load(
    reference: str | Path, overrides: dict[str, Any] | list[str] | None = None, quick: bool = False
) -> Scenario:  # fmt: skip
    """Read a scenario and apply overrides such as {"material.yield_stress": 50} or ["material.yield_stress=50"].

    `quick` merges the file's own [quick] table first; a file without one gets a third more spacing.

    Raises UserError naming the file and key of whatever is wrong.
    """
    path = find(reference)
    table = _read(path, ())
    table.setdefault("name", path.stem)
    shorter = table.pop("quick", None)
    if quick:
        table = _merge(table, shorter) if shorter is not None else table | {"spacing": 4 / 3 * table.get("spacing", 0)}
    if isinstance(overrides, list):
        overrides = dict(parse_override(text) for text in overrides)
    for key, value in (overrides or {}).items():
        assign(table, key, value)
    return validate(table, str(path))


def validate(table: dict[str, Any], where: str) -> Scenario:
    """A table as a Scenario; raises UserError with one line a mistake, each with the key and the cure."""
    try:
        return Scenario.model_validate(table)
    except ValidationError as error:
        raise UserError("\n".join(_explain(item, where) for item in error.errors())) from None


def parse_override(text: str) -> tuple[str, Any]:
    """'key=value' -> (key, value), the value read as TOML and otherwise as a string; `none` takes the key out."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise UserError(f"--set takes key=value, such as material.yield_stress=50; got '{text}'")
    if value.strip() == "none":
        return key.strip(), None
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


def _read(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    """A file's table with the tables that it extends underneath."""
    path = path.resolve()
    if path in seen:
        raise UserError(f"{path}: extends itself by way of {seen[-1].name}")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: not valid TOML: {error}") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from None
    base = table.pop("extends", None)
    if base is None:
        return table
    beside = path.parent / str(base)
    return _merge(_read(beside if beside.is_file() else find(base), (*seen, path)), table)


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
    node: Any = table
    for part in parents:
        node = node[_position(node, part, key)] if isinstance(node, list) else node.setdefault(part, {})
        if not isinstance(node, dict | list):
            raise UserError(f"--set {key}: '{part}' is a value, not a table")
    if isinstance(node, list):
        node[_position(node, last, key)] = value
    elif value is None:
        node.pop(last, None)
    else:
        node[last] = value


def _position(node: list[Any], part: str, key: str) -> int:
    if not part.isdigit() or int(part) >= len(node):
        raise UserError(f"--set {key}: '{part}' must be a number below {len(node)}")
    return int(part)


def _explain(item: Any, where: str) -> str:
    """One pydantic error in words."""
    path = [str(part) for part in item["loc"] if not str(part).startswith(("literal[", "function-", "tagged"))]
    path = path or [str(part) for part in item["loc"]]
    key = ".".join(path) or "scenario"
    if item["type"] == "extra_forbidden":
        return f"{where}: unknown key '{key}'{suggestion(path[-1], _fields_at(path[:-1]))}"
    if item["type"] == "missing":
        return f"{where}: '{key}' is missing"
    message = item["msg"].removeprefix("Value error, ")
    got = "" if item["type"] == "value_error" else f" (got {item['input']!r})"
    return f"{where}: {key}: {message[0].lower()}{message[1:]}{got}"


def _fields_at(path: list[str]) -> list[str]:
    """The keys that the model at `path` knows."""
    model: Any = Scenario
    for part in path:
        field = None if part.isdigit() else model.model_fields.get(part)
        if field is not None:
            model = _model_in(field.annotation) or model
    return list(model.model_fields)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The first model inside an annotation such as `tuple[Body, ...] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in getattr(annotation, "__args__", ()):
        if (found := _model_in(inner)) is not None:
            return found
    return None
