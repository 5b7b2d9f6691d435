"""A first scenario of one's own, from five answers: a commented file with the material of a shipped one, and with its
numerics, without which the same print comes out otherwise."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from ..errors import UserError, quoted, suggestion
from ..registry import get_method
from ..scenario import Scenario
from ..scenario.library import find, load
from ..scenario.material import Material
from ..scenario.units import amount, in_si
from .estimate import estimate
from .workplace import methods_of

PATIENCE = 600.0  # seconds of a run, as estimated, from which its limit of 900 may be short

MATERIALS = {"paste": "line_bead", "concrete": "concrete_wall", "melt": "melt_line", "foam": "foam_wall"}
"""What is printed, and the shipped scenario whose material and numerics it takes."""
ACROSS = {"preview": 6, "balance": 8, "accuracy": 12}
"""What matters, and the particles across the nozzle that it takes."""
BESIDE, ABOVE, REST = 3.0, 2.5, 0.1  # nozzle diameters of room; share of the path's time that a run goes on after it


@dataclass(frozen=True)
class Question:
    """What is asked, and an answer that does."""

    key: str
    text: str
    default: str


QUESTIONS = (
    Question("material", f"What is printed: {', '.join(MATERIALS)}?", "paste"),
    Question("nozzle", "The nozzle's bore, and the gap below it?", "12 mm, 10 mm"),
    Question("speeds", "The speed of the nozzle, and of what leaves it?", "100 mm/s, 100 mm/s"),
    Question("layers", "How many layers, and how long a line?", "1, 90 mm"),
    Question("goal", f"What matters: {', '.join(ACROSS)}?", "balance"),
)


def suited(material: str) -> dict[str, str]:
    """Answers that suit a material, from the shipped scenario that it is of."""
    s = load(MATERIALS[chosen("material", material, MATERIALS)])
    assert s.nozzle is not None and s.toolpath is not None
    size = f"{1e3 * s.nozzle.diameter:g} mm, {1e3 * s.nozzle.standoff:g} mm"
    speeds = f"{1e3 * s.toolpath.speed:g} mm/s, {1e3 * s.nozzle.speed:g} mm/s"
    return {"nozzle": size, "speeds": speeds, "layers": f"{s.toolpath.layers}, {1e3 * s.toolpath.length():g} mm"}


def chosen(key: str, answer: str, known: dict) -> str:
    """One of the words known; raises UserError for another."""
    word = answer.strip().lower()
    if word not in known:
        raise UserError(f"{key}: no {quoted(answer)} here{suggestion(word, known)}")
    return word


def pair(key: str, answer: str, units: tuple[str, str]) -> tuple[float, float]:
    """Two positive numbers in SI, separated by a comma, lengths and speeds in millimetres where they have no unit of
    their own; raises UserError for anything else."""
    parts = [part.strip() for part in answer.split(",")]
    example = next(q.default for q in QUESTIONS if q.key == key)
    try:
        if len(parts) != 2:
            raise ValueError("two values are wanted")
        first, second = (_amount(part, unit) for part, unit in zip(parts, units, strict=True))
        if not (0 < first < math.inf and 0 < second < math.inf):
            raise ValueError("positive numbers are wanted")
    except ValueError as error:
        raise UserError(f"{key}: {error}, such as {example} (got {quoted(answer)})") from None
    return first, second


def _amount(text: str, unit: str) -> float:
    """A number with a unit, or in millimetres."""
    plain = bool(unit) and not isinstance(in_si(text, unit), float)
    return (1e-3 if plain else 1.0) * amount(text, unit)


def check(key: str, answer: str) -> None:
    """Raise UserError for an answer that cannot be understood."""
    if key == "material":
        chosen(key, answer, MATERIALS)
    elif key == "goal":
        chosen(key, answer, ACROSS)
    elif key == "layers":
        layers, _ = pair(key, answer, ("", "m"))
        if layers != int(layers) or layers > 10_000:
            raise UserError(f"layers: a whole number of layers is wanted (got {quoted(answer)})")
    else:
        pair(key, answer, ("m", "m") if key == "nozzle" else ("m/s", "m/s"))


def scenario_text(answers: dict[str, str], name: str) -> str:
    """A commented scenario as TOML; raises UserError for an answer that cannot be understood."""
    for key, answer in answers.items():
        check(key, answer)
    material = chosen("material", answers["material"], MATERIALS)
    bore, gap = pair("nozzle", answers["nozzle"], ("m", "m"))
    travel, exit_speed = pair("speeds", answers["speeds"], ("m/s", "m/s"))
    layers, length = pair("layers", answers["layers"], ("", "m"))
    across = ACROSS[chosen("goal", answers["goal"], ACROSS)]
    shipped = load(MATERIALS[material]).material
    swell = 1.0 if shipped.expansion is None else shipped.expansion.ratio ** (1.0 / 3.0)
    time = (layers * length + (layers - 1) * gap) / travel
    pressed = travel / exit_speed * (gap / bore) ** 2 < 1.0
    return _template().render(
        name=name,
        material=material,
        block=tables_of(MATERIALS[material], "material"),
        shipped=MATERIALS[material],
        numerics=tables_of(MATERIALS[material], "numerics"),
        bore=bore,
        gap=gap,
        rise=gap,
        travel=travel,
        exit_speed=exit_speed,
        rate=exit_speed * math.pi * bore**2 / 4.0,
        layers=int(layers),
        length=length,
        across=across,
        swollen=swell > 1.0,
        spacing=bore * swell / across,
        time=time,
        duration=_upwards((1.0 + REST) * time + _latest(shipped)),
        side=BESIDE * bore * swell,
        top=gap + (layers - 1) * gap + ABOVE * bore * swell,
        speed_ratio=travel / exit_speed,
        gap_ratio=gap / bore,
        laid=f"a round strand is {'thicker' if pressed else 'thinner'} than the gap",
    )


def outlook(scenario: Scenario) -> list[str]:
    """What a scenario warns of, and what each method will need for it."""
    lines = [f"warning: {line}" for line in scenario.warnings()]
    for method in methods_of(None):
        needs = estimate(scenario, get_method(method))
        if needs.refusal:
            lines.append(f"  {method} refuses: {needs.refusal}")
        elif needs.wall_s is not None:
            late = f": give --wall-limit {2 * needs.wall_s:.0f}" if needs.wall_s > PATIENCE else ""
            lines.append(f"  {method}: {needs.particles} particles, about {needs.wall_s:.2g} s on one core{late}")
    return lines


def _template() -> Any:
    from jinja2 import Environment, PackageLoader

    made = Environment(loader=PackageLoader("fluidbench.study"), keep_trailing_newline=True)
    made.filters["mm"] = _mm
    return made.get_template("print.toml")


def _mm(value: float) -> str:
    return f"{1e3 * value:.6g} mm"


def _upwards(value: float) -> float:
    """To two digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / step - 1e-9) * step:.6g}")


def tables_of(name: str, table: str) -> str:
    """A table of a shipped scenario with the tables in it, as TOML with its comments; nothing where it has none."""
    text = find(name).read_text(encoding="utf-8")
    found = re.findall(rf"^\[{table}(?:\.[^\]]*)?\].*?(?=^\[|\Z)", text, re.DOTALL | re.MULTILINE)
    return "".join(found).rstrip() + "\n" if found else ""


def _latest(material: Material) -> float:
    """How long the last of it expands and cures, to 95 % [s]."""
    growing = 0.0 if material.expansion is None else material.expansion.last_event + 3.0 * material.expansion.time
    return max(growing, 0.0 if material.cure is None else material.cure.age_at(0.95) + material.cure.jitter)
