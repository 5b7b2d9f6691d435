"""Tables written as TOML, with hostile pieces put in as they are."""

from typing import Any


class Raw(str):
    """A literal that goes into the file as it is."""


def literal(value: Any) -> str:
    """A value as TOML on one line."""
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        plain = (c if 32 <= ord(c) < 127 and c not in '"\\' else f"\\U{ord(c):08X}" for c in value)
        return f'"{"".join(plain)}"'
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key(k)} = {literal(v)}" for k, v in value.items() if v is not None) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(literal, value)) + "]"
    return repr(value)


def key(text: str) -> str:
    bare = text.isascii() and text.replace("_", "a").replace("-", "a").isalnum()
    return text if bare else literal(text)


def dump(table: dict[str, Any]) -> bytes:
    """A table as a file."""
    text = "".join(f"{key(k)} = {literal(v)}\n" for k, v in table.items() if v is not None)
    return text.encode("utf-8", "surrogateescape")
