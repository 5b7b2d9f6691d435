"""What somebody measured on a real print, to set beside what is computed."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator

from ..errors import UserError, quoted, suggestion
from .model import Model, NonNegative, Positive
from .units import in_si

ALONG = {"bead_width_m": "width", "bead_height_m": "height", "bead_area_m2": "area"}
"""Measures that a bead has at every place along its path, and their names there."""
OF_A_LAYER = ("level_m", "width_m", "radius_m", "height_m", "drift_m")
OF_ALL = (*ALONG, "top_m", "print_height_m", "slump", "spread_radius_m", "front_x_m", "height_m", "ring_drift_m")
SHORT = {"width": "bead_width_m", "height": "bead_height_m", "area": "bead_area_m2"}
SIGNED = ("front_x_m",)  # places, not sizes
COLUMNS = ("quantity", "layer", "place", "value", "uncertainty", "source")
MOST_ROWS = 10_000


class Measured(Model):
    """One measured number."""

    quantity: str = Field(description="what it is, such as width, height, area, top, slump")
    value: float = Field(description="in SI units, or with its unit")
    uncertainty: Positive | None = Field(None, description="of the value, as one standard deviation, or with its unit")
    layer: Annotated[int, Field(ge=1, le=10_000)] | None = Field(None, description="of which layer, from 1")
    place: NonNegative | None = Field(None, description="where along the path [m]; none for its average")
    source: str = Field("", description="where it is from")

    @model_validator(mode="before")
    @classmethod
    def _of_its_kind(cls, table: Any) -> Any:
        """Values in the unit of the quantity."""
        if not isinstance(table, dict) or not isinstance(table.get("quantity"), str):
            return table
        layer = table.get("layer")
        unit = unit_of(key_of(table["quantity"], layer not in (None, "")))
        given = {key: table[key] for key in ("value", "uncertainty") if key in table}
        try:
            return table | {key: in_si(value, unit) for key, value in given.items()}
        except ValueError as error:
            share = f"; {table['quantity']} is a share, such as 0.32 or 32 %" if not unit else ""
            raise ValueError(f"{error}{share}") from None

    @model_validator(mode="after")
    def _known(self) -> Measured:
        if self.place is not None and self.key not in ALONG:
            raise ValueError(f"place: only {', '.join(SHORT)} without a layer are known along the path")
        if self.value < 0.0 and self.key not in SIGNED:
            raise ValueError(f"value: {self.words} is a size, and not below 0 (got {self.value:g})")
        return self

    @property
    def key(self) -> str:
        """The key of the measure of a run that it is compared with."""
        name = key_of(self.quantity, self.layer is not None)
        return name if self.layer is None else f"layer_{self.layer}_{name}"

    @property
    def words(self) -> str:
        """What it is, for people."""
        name = re.sub(r"_m2?$", "", self.key).replace("_", " ")
        return name if self.place is None else f"{name} at {1e3 * self.place:g} mm"


Wanting = Callable[[Measured], str | None]


def key_of(quantity: str, layered: bool) -> str:
    """The name of a measure, without its layer; raises ValueError for one that no run has."""
    name = quantity.strip().lower().replace(" ", "_")
    known = OF_A_LAYER if layered else OF_ALL
    name = name if layered else SHORT.get(name, name)
    for candidate in (name, f"{name}_m", f"{name}_m2"):
        if candidate in known:
            return candidate
    plain = [re.sub(r"_m2?$", "", key) for key in known] + ([] if layered else list(SHORT))
    what = "of a layer" if layered else "of a run"
    raise ValueError(f"quantity: no measure {what} is called {quoted(quantity)}{suggestion(name, plain)}")


def unit_of(key: str) -> str:
    """The unit that the name of a measure ends in."""
    return {"m": "m", "m2": "m^2"}.get(key.rpartition("_")[2], "")


def read(path: str | Path, wanting: Wanting | None = None) -> tuple[Measured, ...]:
    """A table of measured values: quantity, value and, where known, uncertainty, layer, place and source. `wanting`
    says of a row why it cannot be compared, or None.

    Raises UserError naming file and line of whatever is wrong.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise UserError(f"{quoted(str(path))}: {getattr(error, 'strerror', None) or error}") from None
    kept = list(_lines(text, path))
    if not kept:
        raise UserError(f"{path}: no rows; the first line names columns of {', '.join(COLUMNS)}")
    if len(kept) > MOST_ROWS:
        raise UserError(f"{path}: {len(kept)} rows; {MOST_ROWS} at most")
    (first, names), *rows = kept
    head = [name.strip().lower() for name in names]
    for name in head:
        if name not in COLUMNS:
            raise UserError(f"{path}, line {first}: no column is called {quoted(name)}{suggestion(name, COLUMNS)}")
        if head.count(name) > 1:
            raise UserError(f"{path}, line {first}: the column {name} is there twice")
    if missing := [name for name in ("quantity", "value") if name not in head]:
        raise UserError(f"{path}, line {first}: the column {missing[0]} is missing")
    if not rows:
        raise UserError(f"{path}: it names columns and has no rows")
    return tuple(_row(head, row, f"{path}, line {number}", wanting) for number, row in rows)


def _lines(text: str, path: str | Path) -> Iterator[tuple[int, list[str]]]:
    """Rows that are neither empty nor a comment (#), each with the number of its first line."""
    lines = enumerate(text.splitlines(keepends=True), 1)
    for number, line in lines:
        if line.strip() and not line.lstrip().startswith("#"):
            rest = (more for _, more in lines)  # of a quoted cell of several lines
            try:
                yield number, next(csv.reader(chain([line], rest), skipinitialspace=True, strict=True))
            except csv.Error as error:
                raise UserError(f"{path}, line {number}: {error}") from None


def _row(head: list[str], row: list[str], where: str, wanting: Wanting | None) -> Measured:
    if len(row) != len(head):
        raise UserError(f"{where}: {len(row)} values in {len(head)} columns")
    table = {key: value.strip() for key, value in zip(head, row, strict=True) if value.strip()}
    try:
        made = Measured.model_validate(table)
    except ValidationError as error:
        found = error.errors(include_url=False, include_context=False)[0]
        key = ".".join(map(str, found["loc"]))
        said = str(found["msg"]).removeprefix("Value error, ")
        raise UserError(f"{where}: {f'{key}: ' if key else ''}{said[0].lower()}{said[1:]}") from None
    if wanting is not None and (reason := wanting(made)):
        raise UserError(f"{where}: {reason}")
    return made
