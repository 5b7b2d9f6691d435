"""Mistakes in a table in words that its writer uses: keys and tables, instead of classes and tuples."""

from __future__ import annotations

import types
from collections.abc import Sequence
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from ..errors import UserError, quoted, suggestion

MOST_LINES = 5  # mistakes that are told at once
INNER = ("literal[", "function-", "tagged")  # with what pydantic marks its own steps in a path


def mistakes(error: ValidationError, where: str, root: type[BaseModel]) -> UserError:
    """The error for whoever wrote a table of the model `root`, which lies `where`: a line a mistake, each with the key
    and what would be right."""
    found = []
    for item in error.errors(include_url=False):
        path, instead = _path(item["loc"], root)
        unmeant = "literal_error" if isinstance(item["input"], dict) else "model_type"
        if instead is None or item["type"] != unmeant:  # of a word or a table, what was given is said to be wrong
            found.append(_line(item, path, instead, root))
    lines = list(dict.fromkeys(f"{where}: {line}" for line in found[:MOST_LINES]))
    more = [f"{where}: and {len(found) - MOST_LINES} more mistakes"] if len(found) > MOST_LINES else []
    return UserError("\n".join([*lines, *more]))


def unknown_key(table: dict[str, Any], model: type[BaseModel], above: tuple[str, ...] = ()) -> str | None:
    """What is said of the first key that a model does not have, in a table of some of its keys; None where there is
    none. The sections of `numerics` are left to their methods."""
    for key, value in table.items():
        if key not in model.model_fields:
            return f"unknown key '{quoted('.'.join([*above, key]))[1:-1]}'{suggestion(key, model.model_fields)}"
        inner, place = _model_in(model.model_fields[key].annotation), (*above, key)
        inside = {(*place, str(i)): part for i, part in enumerate(value)} if isinstance(value, list) else {place: value}
        for where, part in inside.items():
            if inner is not None and isinstance(part, dict) and (found := unknown_key(part, inner, where)):
                return found
    return None


def short(error: object) -> str:
    """What an error says, on one line of bearable length."""
    text = " ".join(str(error).split())
    return text if len(text) <= 450 else f"{text[:450]}..."


def _line(item: Any, path: list[str], instead: type[BaseModel] | None, root: type[BaseModel]) -> str:
    """One error; `instead`: the model of a table that may stand there instead of a word."""
    key = quoted(".".join(path))[1:-1] or root.__name__.lower()
    if item["type"] == "extra_forbidden":
        return f"unknown key '{key}'{suggestion(path[-1], _walk(path[:-1], root)[1].model_fields)}"
    if item["type"] == "missing" and path[-1].isdigit():
        return (
            f"{quoted('.'.join(path[:-1]))[1:-1]}: {_list_at(path[:-1], root)} is wanted (got {quoted(item['input'])})"
        )
    if item["type"] == "missing":
        return f"'{key}' is missing"
    message = _wanted(item, path, root) or short(item["msg"]).removeprefix("Value error, ")
    if instead is not None:
        message += f", or a table with {', '.join(instead.model_fields)}"
    got = "" if item["type"] == "value_error" else f" (got {quoted(item['input'])})"
    return f"{key}: {message[0].lower()}{message[1:]}{got}"


def _wanted(item: Any, path: list[str], root: type[BaseModel]) -> str | None:
    """What is wanted where pydantic would name classes of Python."""
    if item["type"] in ("model_type", "dict_type"):
        named = f" [{'.'.join(path)}]" if path and not any(part.isdigit() for part in path) else ""
        return f"a table{named} is wanted"
    if item["type"] in ("tuple_type", "list_type", "too_long"):
        return f"{_list_at(path, root)} is wanted"
    return None


def _list_at(path: list[str], root: type[BaseModel]) -> str:
    """What a list at a path holds."""
    annotation, _ = _walk(path, root)
    if _model_in(annotation) is not None:
        return f"a list of tables [[{'.'.join(path)}]]"
    parts = get_args(annotation)
    if not parts or parts[-1] is Ellipsis:
        return "a list"
    return f"a list of {len(parts)} {'numbers' if set(parts) == {float} else 'values'}"


def _walk(path: Sequence[str], root: type[BaseModel]) -> tuple[Any, type[BaseModel]]:
    """What a key or an element of a list is annotated with; and the model of the tables there, or around it."""
    annotation: Any = None
    model = root
    for part in path:
        if part.isdigit():
            annotation = next(iter(get_args(annotation)), None)
        else:
            field = model.model_fields.get(part)
            annotation = None if field is None else _without_none(field.annotation)
        model = _model_in(annotation) or model
    return annotation, model


def _without_none(annotation: Any) -> Any:
    """`X` of `X | None`."""
    kept = [part for part in get_args(annotation) if part is not type(None)]
    return kept[0] if _is_union(annotation) and len(kept) == 1 else annotation


def _is_union(annotation: Any) -> bool:
    return get_origin(annotation) in (Union, types.UnionType)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The first model inside an annotation such as `tuple[Body, ...] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for inner in get_args(annotation) if (found := _model_in(inner)) is not None), None)


def _path(loc: Sequence[Any], root: type[BaseModel]) -> tuple[list[str], type[BaseModel] | None]:
    """The keys of an error's place; and the model of a table that may stand there instead of a word, which pydantic
    names as if it were a key."""
    path: list[str] = []
    instead = tag = None
    for part in map(str, loc):
        if part == tag:
            tag = None
        elif not part.startswith(INNER):
            path.append(part)
            annotation, _ = _walk(path, root)
            instead = _model_in(annotation) if _is_union(annotation) else None
            tag = None if instead is None else instead.__name__
    return path, instead
