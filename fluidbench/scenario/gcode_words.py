"""What a line of G-code says: its commands, and the words of each, such as X10.5."""

import re
from itertools import pairwise

from ..errors import quoted
from .model import LARGEST

NUMBER = r"([+-]?(?:\d+\.?\d*|\.\d+))"
WORDS = re.compile(rf"(?:\s*[A-Za-z]\s*{NUMBER}?(?=[\sA-Za-z]|$))*\s*")
NUMBERED = re.compile(rf"(?:\s*[A-Za-z]\s*{NUMBER})+\s*")
UNCOMMANDED = re.compile(rf"(?:[XYZEFxyzef]\s*{NUMBER}\s*)+")
WORD = re.compile(rf"([A-Za-z])\s*{NUMBER}?")
DOUBTFUL = re.compile(r"[Ee][+-]?\d+")  # a word E, or an exponent, which has no point
SIGNED = re.compile(r"[Ee](?:\+\d+|-0\d+)")  # as Python and C write an exponent, and nobody a word
PYTHON = re.compile(r"e-\d\d+")


def commands_in(code: str) -> list[str]:
    """The commands of a line, in its order, where all of it is words such as X10.5; else the line, whose text may be
    anything (M117)."""
    return [part for part in re.split(r"(?=[GMTgmt]\s*\d)", code) if part] if NUMBERED.fullmatch(code) else [code]


def words_in(text: str) -> list[tuple[str, float | None]]:
    """The words that follow a command, as capitals and numbers, None for a capital alone.

    An E right behind a number may be its exponent, as Python writes it (`X1e-05`), or a word in a line without blanks
    (`G1X10E5`). Behind a blank, or with a point in its own number, it is a word. It is an exponent where it is a small
    letter behind a capital, or signed with + or as -05. It is a word where other words follow one another without a
    blank, too, unless a small letter has Python's -10. What is left, such as `G1 X10E5`, may be either.

    Raises ValueError for what is no words, for what may be either, and for a number beyond any physics.
    """
    if not WORDS.fullmatch(text):
        raise ValueError(f"{quoted(text.strip())} are no words such as X10.5")
    found = list(WORD.finditer(text))
    doubtful = {b.start() for a, b in pairwise(found) if a.end() == b.start() and a[2] and DOUBTFUL.fullmatch(b[0])}
    glued = any(w.start() not in doubtful and not text[w.start() - 1 : w.start()].isspace() for w in found)
    words: list[tuple[str, str | None]] = []
    for word in found:
        letter, number = words[-1] if words else ("", None)
        one = word.start() in doubtful and number is not None and "e" not in number.lower()
        if one and _is_exponent(word[0], letter, f"{letter}{number}", glued):
            words[-1] = (letter, f"{number}{word[0]}")
        else:
            words.append((word[1], word[2]))
    return [(letter.upper(), _read(letter, number)) for letter, number in words]


def _is_exponent(word: str, letter: str, before: str, glued: bool) -> bool:
    """Whether this E and its number are the exponent of the word before, of this letter, without a blank between."""
    if (word[0] == "e" and letter.isupper()) or SIGNED.fullmatch(word):
        return True
    if glued and not PYTHON.fullmatch(word):
        return False
    raise ValueError(
        f"{quoted(before + word)[1:-1]} may be {quoted(before)[1:-1]} and {word}, or one number with an exponent; "
        f"write a blank before the {word[0]}, or the number without an exponent"
    )


def _read(letter: str, number: str | None) -> float | None:
    value = None if number is None else float(number)
    if value is not None and abs(value) > LARGEST:
        raise ValueError(f"{quoted(letter + str(number))} is beyond any physics; {LARGEST:g} is the most that is read")
    return value
