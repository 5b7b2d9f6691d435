"""Quantities as people write them: "20 mm", "1.3 kPa", "15 Pa s", "2100 kg/m^3"; plain numbers are SI.

A table of our own: pint takes 0.7 s to import, longer than everything else that reads a scenario.
"""

import math
import re
from typing import Any

from ..errors import quoted, suggestion

Dimension = tuple[float, float, float]  # powers of metre, kilogram and second
NONE: Dimension = (0, 0, 0)
UNITS: dict[str, tuple[float, Dimension]] = {
    "m": (1.0, (1, 0, 0)),
    "in": (0.0254, (1, 0, 0)),
    "g": (1e-3, (0, 1, 0)),
    "t": (1e3, (0, 1, 0)),
    "s": (1.0, (0, 0, 1)),
    "min": (60.0, (0, 0, 1)),
    "h": (3600.0, (0, 0, 1)),
    "Hz": (1.0, (0, 0, -1)),
    "rad": (1.0, NONE),
    "deg": (math.pi / 180.0, NONE),
    "rpm": (math.pi / 30.0, (0, 0, -1)),
    "%": (0.01, NONE),
    "l": (1e-3, (3, 0, 0)),
    "L": (1e-3, (3, 0, 0)),
    "N": (1.0, (1, 1, -2)),
    "Pa": (1.0, (-1, 1, -2)),
    "bar": (1e5, (-1, 1, -2)),
    "psi": (6894.757293168361, (-1, 1, -2)),
    "P": (0.1, (-1, 1, -1)),
    "St": (1e-4, (2, 0, -1)),
    "J": (1.0, (2, 1, -2)),
}
"""Unit -> its size in SI and its dimension."""
PREFIXED = ("m", "g", "s", "Hz", "l", "L", "N", "Pa", "bar", "P", "St", "J", "t")
PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "k": 1e3, "M": 1e6, "G": 1e9}
AMOUNT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?:\s*\*\s*|\s*)(.*?)\s*", re.DOTALL)
FACTOR = re.compile(r"([A-Za-zµμ%]+)(?:\^?([+-]?\d+(?:\.\d+)?))?")
RAISED = str.maketrans({"²": "^2", "³": "^3", "·": " ", "×": " "})


def unit(text: str) -> tuple[float, Dimension]:
    """(size in SI, dimension) of a unit such as `kg/m^3`, `Pa s` or `mm/s`; raises ValueError for what is none.

    Factors are joined by a blank, `*` or `·`; all behind a `/` divides, up to the next one.
    """
    size, powers = 1.0, [0.0, 0.0, 0.0]
    for i, part in enumerate(text.translate(RAISED).split("/")):
        words = part.replace("**", "^").replace("*", " ").split()
        if not words or (i == 0 and words == ["1"]):
            if i or not words:
                raise ValueError(f"{quoted(text)} is no unit")
            continue
        for word in words:
            found = FACTOR.fullmatch(word)
            if found is None:
                raise ValueError(f"{quoted(word)} is no unit")
            power = float(found[2] or 1) * (-1 if i else 1)
            factor, dimension = _named(found[1])
            size *= factor**power
            powers = [p + power * q for p, q in zip(powers, dimension, strict=True)]
    return size, (powers[0], powers[1], powers[2])


def _named(name: str) -> tuple[float, Dimension]:
    """One unit by its name, with a prefix or without."""
    if name in UNITS:
        return UNITS[name]
    for prefix, factor in PREFIXES.items():
        if name.startswith(prefix) and name[len(prefix) :] in PREFIXED:
            size, dimension = UNITS[name[len(prefix) :]]
            return factor * size, dimension
    raise ValueError(f"{quoted(name)} is no unit{suggestion(name, [*UNITS, 'mm', 'kg', 'kPa', 'MPa', 'ml', 'cP'])}")


def in_si(value: Any, wanted: str) -> Any:
    """The number that a text such as "20 mm" means in the SI unit `wanted`; anything but such a text as it is. A
    `wanted` that ends in ^n leaves the power of its last unit, seconds, open.

    Raises ValueError for a unit that is none, or of another kind than `wanted`.
    """
    if not isinstance(value, str):
        return value
    found = AMOUNT.fullmatch(value)
    if found is None or not found[2]:
        return value
    size, dimension = unit(found[2])
    kind = unit(wanted.removesuffix("^n"))[1] if wanted else NONE
    rheological = dimension[:2] == kind[:2] and dimension[2] > kind[2] - 1.0  # Pa s^n with n > 0
    alike = rheological if wanted.endswith("^n") else dimension == kind
    if not alike:
        raise ValueError(f"{quoted(value)} is of another kind than {wanted or 'a plain number'}")
    return float(f"{float(found[1]) * size:.15g}")  # the same number as 0.02, whatever 20 * 1e-3 is rounded to


def amount(value: Any, wanted: str) -> float:
    """The same as a number; raises ValueError for what is none, too."""
    found = in_si(value, wanted)
    try:
        return float(found)
    except (TypeError, ValueError):
        raise ValueError(f"{quoted(value)} is no number, with its unit or in {wanted or 'none'}") from None
