"""What all input is made of: frozen models that refuse unknown keys, keys without effect and numbers beyond physics.

Kernels compute in single precision. No number may be so large that its square is no float32, none so small that it is
no float32 itself; quantities that are positive by nature are divided by, and their squares must not vanish either.
"""

import functools
import math
import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

from annotated_types import Gt
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from ..errors import suggestion
from .mistakes import mistakes
from .units import in_si

LARGEST, SMALLEST = 1e18, 1e-18  # whose squares are float32s
LEAST = 1.2e-38  # the smallest float32 of full precision


def check_size(value: float) -> float:
    """The value; raises ValueError for one whose square vanishes in single precision."""
    if 0 < value < SMALLEST:
        raise ValueError(f"{value:.3g} is beyond any physics; {SMALLEST:g} is the least that can be computed with")
    return value


Positive = Annotated[float, Field(gt=0), AfterValidator(check_size)]
NonNegative = Annotated[float, Field(ge=0), AfterValidator(check_size)]
Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


class Model(BaseModel):
    """A frozen table of input."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    judged_later: ClassVar[tuple[str, ...]] = ()  # keys whose size a model judges itself, with what it would have meant

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_values(cls, value: Any, info: ValidationInfo) -> Any:
        """True is 1 to Python, but no number to people."""
        annotation = cls.model_fields[info.field_name or ""].annotation
        if annotation is not bool and any(isinstance(v, bool) for v in _leaves(value)):
            raise ValueError("true and false are not values of this key")
        return value

    @field_validator("*", mode="before")
    @classmethod
    def _in_si(cls, value: Any, info: ValidationInfo) -> Any:
        """Texts such as "20 mm" are numbers, too."""
        wanted = cls.unit_of(info.field_name or "")
        if wanted is not None and "flow_index" in info.data:
            wanted = wanted.replace("^n", f"^{info.data['flow_index']:g}")
        return value if wanted is None else _converted(value, wanted)

    @classmethod
    @functools.cache
    def unit_of(cls, key: str) -> str | None:
        """The SI unit that a key is described in, empty for a ratio; None where it holds no numbers of one kind."""
        field = cls.model_fields[key]
        units = re.findall(r"\[([^\]]*)\]", field.description or "")
        if not units or any(word in str(field.annotation) for word in ("str", "Packed")):
            return None
        return "" if units[-1] == "-" else units[-1]

    @field_validator("*", mode="after")
    @classmethod
    def _within_single_precision(cls, value: Any, info: ValidationInfo) -> Any:
        numbers = [v for v in _leaves(value) if isinstance(v, int | float) and not isinstance(v, bool)]
        bounds = cls.model_fields[info.field_name or ""].metadata
        ratio = any(isinstance(b, Gt) and float(str(b.gt)) < 0 for b in bounds)  # may be as near to nothing as it likes
        for number in numbers:
            if info.field_name not in cls.judged_later:
                check_number(number)
            if not ratio and 0 < abs(number) < LEAST:
                raise ValueError(f"{number:.3g} is beyond any physics; {LEAST:g} is the least that is not nothing")
        return value

    def __eq__(self, other: object) -> bool:
        """By the values of its keys alone: what is derived from them may hold arrays."""
        return type(self) is type(other) and isinstance(other, Model) and self._values() == other._values()

    def __hash__(self) -> int:
        return hash((type(self), *self._values()))

    def _values(self) -> tuple[Any, ...]:
        return tuple(self._table().values())

    def _table(self) -> dict[str, Any]:
        """The values by key, those of models as they are."""
        return {name: getattr(self, name) for name in type(self).model_fields}

    def replace(self, **changes: Any) -> Self:
        """The same with some values changed, in SI units or with a unit, validated like any other; raises UserError
        with one line a mistake, each with the key and the cure."""
        try:
            return type(self).model_validate(self._table() | changes)
        except ValidationError as error:
            raise mistakes(error, type(self).__name__.lower(), type(self)) from None

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, not validated; what is derived from values (cached properties) is derived anew."""
        copy = super().model_copy(update=update, deep=deep)
        for name in [name for name in copy.__dict__ if isinstance(getattr(type(copy), name, None), cached_property)]:
            vars(copy).pop(name)
        return copy

    def refuse_idle(self, kind: str, users: Mapping[str, Sequence[str]]) -> None:
        """Raise ValueError for a key that was given but has no effect on this kind; `users`: the kinds that use it."""
        used = [key for key, kinds in users.items() if kind in kinds]
        used = used or [key for key in type(self).model_fields if key not in users and key != "kind"]
        for key, kinds in users.items():
            value, default = getattr(self, key), type(self).model_fields[key].default
            if kind not in kinds and value is not None and value != default:
                raise ValueError(f"{key} has no effect on kind = '{kind}'{suggestion(key, used)}")


def _leaves(value: Any) -> list[Any]:
    """The values in a list of lists, or the value itself."""
    if isinstance(value, list | tuple):
        return [leaf for part in value for leaf in _leaves(part)]
    return [value]


def _converted(value: Any, wanted: str) -> Any:
    """A text with a unit, or texts in lists, as numbers in SI."""
    if isinstance(value, list | tuple):
        return [_converted(part, wanted) for part in value]
    return in_si(value, wanted)


def check_number(value: float) -> None:
    """Raise ValueError unless a number is finite and no larger than single precision can square."""
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"a finite number is wanted (got {value})")
    if abs(value) > LARGEST:
        size = f"{value:.3g}" if isinstance(value, float) or abs(value) < 10**300 else "a number of over 300 digits"
        raise ValueError(f"{size} is beyond any physics; {LARGEST:g} is the most that can be computed with")
