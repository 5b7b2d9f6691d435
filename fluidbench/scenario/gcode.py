"""G-code as slicers write it: where the nozzle goes, how fast, and how much it extrudes on the way.

A reader of our own, strict where gcodeparser 0.3 is not: that one cannot read `X10.`, takes an X in the text of a
message for a move, and `X1O` for X1. Its words and their exponents: gcode_words.
"""

import math
import re
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import quoted
from .gcode_words import UNCOMMANDED, commands_in, words_in

COMMAND = re.compile(r"([GMTgmt])(\d+(?:\.\d+)?)(?=\W|[A-Za-z]|$)(.*)", re.DOTALL)
COMMENT = re.compile(r"\([^)]*\)|;.*")
ENVELOPE = re.compile(r"^\s*(?:N\d+\s*)?(.*?)\s*(?:\*\d+)?\s*$", re.DOTALL)  # line number, checksum
LARGEST = 2**26  # bytes of a file
SAGITTA = 2e-5  # by which the chords of an arc miss it [m]
INCH, MINUTE = 0.0254, 60.0
LETTERS = {"G0": "XYZEFS", "G1": "XYZEFS", "G2": "XYZEFIJRPS", "G3": "XYZEFIJRPS"}
MODES = {"G17", "G20", "G21", "G90", "G91", "M82", "M83"}
UNREADABLE = {"G18": "arcs in other planes", "G19": "arcs in other planes", "G5": "splines", "G93": "inverse time"}


@dataclass
class Program:
    """What a file of G-code says, of n moves. `ignored`: each code that has no effect, and in which lines."""

    points: np.ndarray  # (n + 1, 3): where move i begins, and move i - 1 ends [m]
    seconds: np.ndarray  # (n,)
    fed: np.ndarray  # (n,): of E, in the unit of the move
    unit: np.ndarray  # (n,): of lengths [m]
    prints: np.ndarray  # (n,): whether it is none of G0
    ignored: dict[str, list[int]]


@dataclass
class _Machine:
    """The state that lines of G-code change."""

    unit: float = 1e-3
    absolute: bool = True
    extruder_absolute: bool = True
    at: np.ndarray = field(default_factory=lambda: np.zeros(3))  # [m], in the machine's own frame
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))  # of what the file calls its origin
    extruder: float = 0.0  # as the file counts [file's unit]
    owed: float = 0.0  # drawn back, and not yet given again
    feed: float = 0.0  # [m/s]
    speed_factor: float = 1.0
    flow_factor: float = 1.0
    moves: list[tuple[float, ...]] = field(default_factory=list)
    ignored: dict[str, list[int]] = field(default_factory=dict)


def read(path: Path) -> Program:
    """The moves in a file; raises ValueError naming the line that cannot be understood, or the file."""
    try:
        if path.stat().st_size > LARGEST:
            raise ValueError(f"{path.name}: {path.stat().st_size} bytes; {LARGEST} at most are read")
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise ValueError(f"{quoted(str(path))}: {error.strerror}") from None
    return understand(text, path.name)


def understand(text: str, name: str = "G-code") -> Program:
    """The moves in a text; raises ValueError naming the line that cannot be understood."""
    machine = _Machine()
    for number, line in enumerate(text.splitlines(), 1):
        found = ENVELOPE.match(COMMENT.sub(" ", line))
        code = "" if found is None else found[1].strip()
        if code and code != "%":
            try:
                for command in commands_in(code):
                    _obey(machine, command, number)
            except ValueError as error:
                raise ValueError(f"{name}, line {number}: {error}") from None
    if not machine.moves:
        raise ValueError(f"{name}: no line of it moves anything")
    table = np.array(machine.moves, dtype=float)
    points = np.concatenate([np.zeros((1, 3)), table[:, :3]])
    return Program(points, table[:, 3], table[:, 4], table[:, 5], table[:, 6] > 0, machine.ignored)


def _obey(m: _Machine, code: str, number: int) -> None:
    """One command, without comments."""
    found = COMMAND.fullmatch(code)
    if found is None:
        if UNCOMMANDED.fullmatch(code):
            raise ValueError(f"{quoted(code)} has no command; write G1 before it")
        m.ignored.setdefault(code.upper(), []).append(number)  # macros of a firmware, such as SET_PRESSURE_ADVANCE
        return
    name = found[1].upper() + (found[2].lstrip("0") or "0")
    if name in UNREADABLE:
        raise ValueError(f"{name}: {UNREADABLE[name]} cannot be read; G0, G1, G2 and G3 in the plane can")
    act = ACTIONS.get(name)
    if act is None and name not in MODES:
        m.ignored.setdefault(code.upper(), []).append(number)
        return
    words = _words(name, found[3])
    if name in MODES:
        _switch(m, name)
    elif act is not None:
        act(m, words)


def _words(name: str, text: str) -> dict[str, float | None]:
    """The words of a command by their letters. Of two speeds the last counts, as it does for printers; slicers write
    such lines (`G1 X267 F18000 F8000`)."""
    words: dict[str, float | None] = {}
    for letter, value in words_in(text):
        if letter in "GMT":
            raise ValueError(f"{name} and a second command, {letter}, beside words without a number; write two lines")
        if letter not in LETTERS.get(name, letter):
            raise ValueError(f"{name} has no word {quoted(letter)}; it has {', '.join(LETTERS[name])}")
        if letter in words and letter != "F":
            twice = " and ".join(letter if v is None else f"{letter}{v:g}" for v in (words[letter], value))
            raise ValueError(f"{letter} is there twice, {twice}; a command may have it once")
        words[letter] = value
    return words


def _switch(m: _Machine, name: str) -> None:
    if name in ("G20", "G21"):
        m.unit = INCH if name == "G20" else 1e-3
    elif name in ("G90", "G91"):
        m.absolute = name == "G90"
    elif name in ("M82", "M83"):
        m.extruder_absolute = name == "M82"


def _move(m: _Machine, words: dict[str, float | None], prints: bool = True) -> None:
    """G0, G1: straight to a point."""
    _feed(m, words)
    _go(m, [_target(m, words)], _fed(m, words), prints)


def _travel(m: _Machine, words: dict[str, float | None]) -> None:
    _move(m, words, prints=False)


def _arc(m: _Machine, words: dict[str, float | None], clockwise: bool) -> None:
    """G2, G3: along a circle about (I, J) from the start, or of radius R, by chords."""
    _feed(m, words)
    end, start = _target(m, words), m.at
    if _number(words, "P", 1.0) > 1.0:
        raise ValueError("P: arcs of more than one turn cannot be read")
    if "R" in words:
        centre = _centre(start, end, _number(words, "R") * m.unit, clockwise)
    elif "I" in words or "J" in words:
        centre = start[:2] + m.unit * np.array([_number(words, "I", 0.0), _number(words, "J", 0.0)])
    else:
        raise ValueError("an arc needs I and J, or R")
    arms = start[:2] - centre, end[:2] - centre
    radius = float(np.hypot(*arms[0]))
    if radius == 0 or abs(float(np.hypot(*arms[1])) - radius) > max(0.02 * radius, 5e-5):
        raise ValueError("start and end of the arc are not as far from its centre")
    first, last = (math.atan2(arm[1], arm[0]) for arm in arms)
    turn = (first - last if clockwise else last - first) % (2.0 * math.pi) or 2.0 * math.pi
    chords = max(2, math.ceil(turn / (2.0 * math.acos(max(1.0 - SAGITTA / radius, 0.0)))))
    share = np.arange(1, chords + 1) / chords
    angle = first + (-turn if clockwise else turn) * share
    places = np.stack([*(centre[:, None] + radius * np.array([np.cos(angle), np.sin(angle)])), angle], axis=1)
    places[:, 2] = start[2] + (end[2] - start[2]) * share
    places[-1] = end
    _go(m, list(places), _fed(m, words))


def _centre(start: np.ndarray, end: np.ndarray, radius: float, clockwise: bool) -> np.ndarray:
    """Of the arc of this radius, the longer one where it is negative."""
    half = 0.5 * (end[:2] - start[:2])
    length = float(np.hypot(*half))
    if length == 0 or abs(radius) < length * (1.0 - 1e-6):
        raise ValueError("R is shorter than half the way of the arc")
    side = (-1.0 if clockwise else 1.0) * math.copysign(1.0, radius)
    rise = math.sqrt(max(radius**2 - length**2, 0.0))
    return start[:2] + half + side * rise * np.array([-half[1], half[0]]) / length


def _wait(m: _Machine, words: dict[str, float | None]) -> None:
    """G4: P milliseconds or S seconds."""
    seconds = _number(words, "S", 0.0) + 1e-3 * _number(words, "P", 0.0)
    if seconds < 0:
        raise ValueError("a wait of less than nothing")
    if seconds:
        m.moves.append((*m.at, seconds, 0.0, m.unit, False))


def _home(m: _Machine, words: dict[str, float | None]) -> None:
    """G28: to nothing on the axes named, or on all."""
    named = [axis in words for axis in "XYZ"]
    home = np.where(named if any(named) else True, 0.0, m.at)
    m.shift = np.where(named if any(named) else True, 0.0, m.shift)
    if m.feed > 0:
        _go(m, [home], 0.0, prints=False)
    m.at = home


def _rename(m: _Machine, words: dict[str, float | None]) -> None:
    """G92: the present place is called so."""
    for axis, letter in enumerate("XYZ"):
        if letter in words:
            m.shift[axis] = m.at[axis] - m.unit * _number(words, letter)
    if "E" in words or not words:
        m.extruder = _number(words, "E", 0.0)


def _speed_factor(m: _Machine, words: dict[str, float | None]) -> None:
    """M220: all speeds by S per cent."""
    m.speed_factor = _positive(words, "S", 100.0) / 100.0


def _flow_factor(m: _Machine, words: dict[str, float | None]) -> None:
    """M221: all that is extruded by S per cent."""
    m.flow_factor = _positive(words, "S", 100.0) / 100.0


def _volumetric(m: _Machine, words: dict[str, float | None]) -> None:
    """M200: E as a volume."""
    if _number(words, "D", 0.0) > 0:
        raise ValueError('M200: E is a volume from here on; take the line out and set toolpath.extrusion = "volume"')


def _feed(m: _Machine, words: dict[str, float | None]) -> None:
    if "F" in words:
        m.feed = _positive(words, "F") * m.unit / MINUTE


def _target(m: _Machine, words: dict[str, float | None]) -> np.ndarray:
    """Where a move leads [m]."""
    to = m.at.copy()
    for axis, letter in enumerate("XYZ"):
        if letter in words:
            given = m.unit * _number(words, letter)
            to[axis] = given + m.shift[axis] if m.absolute else m.at[axis] + given
    return to


def _fed(m: _Machine, words: dict[str, float | None]) -> float:
    """What a move extrudes, in the file's own unit, beyond what was drawn back before; drawn back counts as owed."""
    if "E" not in words:
        return 0.0
    given = _number(words, "E")
    step = given - m.extruder if m.extruder_absolute and m.absolute else given
    m.extruder += step
    m.owed -= step
    fed, m.owed = max(-m.owed, 0.0), max(m.owed, 0.0)
    return fed * m.flow_factor


def _go(m: _Machine, places: list[np.ndarray], fed: float, prints: bool = True) -> None:
    """Through these places one after the other, extruding evenly."""
    legs = [float(np.linalg.norm(b - a)) for a, b in pairwise([m.at, *places])]
    way = sum(legs)
    if way == 0 and fed == 0:
        return
    if m.feed <= 0:
        raise ValueError("a move before any F, the speed")
    speed = m.feed * m.speed_factor
    if way == 0:
        m.moves.append((*m.at, fed * m.unit / speed, fed, m.unit, prints))
    for place, leg in zip(places, legs, strict=True):
        if leg:
            m.moves.append((*place, leg / speed, fed * leg / way, m.unit, prints))
    m.at = places[-1]


def _number(words: dict[str, float | None], letter: str, default: float | None = None) -> float:
    value = words.get(letter, default)
    if value is None:
        raise ValueError(f"{letter} without a number")
    return value


def _positive(words: dict[str, float | None], letter: str, default: float | None = None) -> float:
    value = _number(words, letter, default)
    if value <= 0:
        raise ValueError(f"{letter}{value:g}: a positive number is wanted")
    return value


ACTIONS: dict[str, Any] = {
    "G0": _travel,
    "G1": _move,
    "G2": lambda m, words: _arc(m, words, True),
    "G3": lambda m, words: _arc(m, words, False),
    "G4": _wait,
    "G28": _home,
    "G92": _rename,
    "M200": _volumetric,
    "M220": _speed_factor,
    "M221": _flow_factor,
}
