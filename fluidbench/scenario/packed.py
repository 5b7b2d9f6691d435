"""Arrays in a scenario: frozen, compared by value, and held by JSON without loss."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from pydantic import GetCoreSchemaHandler
from pydantic_core import core_schema

from .model import LARGEST


class Packed:
    """Float64 numbers of some shape. Made from anything that NumPy takes as an array, or from what `as_json` gave."""

    def __init__(self, values: Any) -> None:
        if isinstance(values, dict):
            raw = base64.b64decode(values["float64"], validate=True)
            self.array = np.frombuffer(raw, "<f8").reshape(values["shape"])
        else:
            if np.ma.isMaskedArray(values) or np.iscomplexobj(values):
                raise ValueError("masked and complex numbers are none of a scenario's")
            self.array = np.array(values, "<f8")
        self.array.setflags(write=False)

    def as_json(self) -> dict[str, Any]:
        return {"float64": base64.b64encode(self.array.tobytes()).decode(), "shape": list(self.array.shape)}

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.array, dtype=dtype, copy=copy)

    def __len__(self) -> int:
        return len(self.array)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Packed) and np.array_equal(self.array, other.array)

    def __hash__(self) -> int:
        return hash((self.array.shape, self.array.tobytes()))

    def __repr__(self) -> str:
        return f"Packed{self.array.shape}"

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def read(value: Any) -> Packed:
            try:
                found = value if isinstance(value, Packed) else cls(value)
            except (ValueError, TypeError, KeyError):
                raise ValueError("an array of numbers is wanted") from None
            if not np.isfinite(found.array).all() or (np.abs(found.array) > LARGEST).any():
                raise ValueError(f"finite numbers up to {LARGEST:g} are wanted")
            return found

        written = core_schema.plain_serializer_function_ser_schema(lambda found: found.as_json(), when_used="json")
        return core_schema.no_info_plain_validator_function(read, serialization=written)
