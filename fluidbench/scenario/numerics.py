"""The sections of `numerics`: each is checked by the settings of the method of that name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from ..errors import UserError, quoted, suggestion
from ..registry import get_method, registered
from .scenario import Scenario

if TYPE_CHECKING:
    from ..method.contract import Method


def configure(method: type[Method], scenario: Scenario) -> Any:
    """The method's Config with the scenario's `numerics` section applied, and decided; raises UserError for unknown
    keys."""
    given = scenario.numerics.get(method.name, {})
    try:
        return method.decided(scenario, method.Config(**given))
    except ValidationError as error:
        item = error.errors()[0]
        key = ".".join(str(part) for part in item["loc"])
        if item["type"] == "extra_forbidden":
            raise UserError(
                f"numerics.{method.name}: unknown key '{key}'{suggestion(key, method.Config.model_fields)}"
            ) from None
        words = item["msg"].removeprefix("Value error, ")
        raise UserError(f"numerics.{method.name}.{key}: {words} (got {quoted(item['input'])})") from None


def check_numerics(scenario: Scenario) -> None:
    """Raise UserError for a section of `numerics` that no method reads, or that its method refuses."""
    for name in scenario.numerics:
        configure(_method(name), scenario)


def check_sections(sections: dict[str, Any]) -> None:
    """Raise UserError for a section that no method reads, or a key in it that its method does not know."""
    for name, section in sections.items():
        known = _method(name).Config.model_fields
        for key in section if isinstance(section, dict) else ():
            if key not in known:
                raise UserError(f"numerics.{name}: unknown key {quoted(key)}{suggestion(key, known)}")


def _method(name: str) -> type[Method]:
    """The method that reads a section of `numerics`; raises UserError for one that there is not."""
    names = registered()
    if name not in names:
        raise UserError(f"numerics.{quoted(name)[1:-1]}: no method of that name{suggestion(name, names)}")
    return get_method(name)
