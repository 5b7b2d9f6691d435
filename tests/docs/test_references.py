"""What is cited can be followed: every name with a year, and every section, stands in docs/references.md."""

import re
from pathlib import Path

import pytest

from fluidbench.paper import PAPER
from fluidbench.study.case import cases

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "references.md").read_text()
WORK = re.compile(r"([A-Z][a-z]+)(?:(?:,| &| and|) [A-Z][a-z]+)*(?: et al\.)?,? \(?(1[89]\d\d|20[012]\d)\b(?![-.])")
SECTION = re.compile(r"references\.md, ([A-Z])\b")
SOURCES = [
    path
    for folder in ("fluidbench", "solvers", "scenarios", "examples", "docs")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in (".py", ".csv", ".md")
    if path.name not in ("references.md", "known_answers.csv")
]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_what_a_file_cites_is_listed(path):
    text = path.read_text()
    lines = [line for line in PAGE.splitlines() if line.startswith("- <span")]
    for name, year in WORK.findall(text):
        assert any(name in line.split("*")[0] and year in line.split("*")[0] for line in lines), (name, year)
    for letter in SECTION.findall(text):
        assert f"{{#{letter}}}" in PAGE, letter
    assert not re.search(r"\bvalidation [A-M]\b", text)


def test_the_page_has_the_formula_of_every_case():
    assert [name for name in cases() if f"**{name}**" not in PAGE] == []


def test_the_paper_is_named_once():
    assert PAPER in PAGE


def published(name):
    lines = (ROOT / "scenarios" / "reference" / f"{name}.csv").read_text().splitlines()
    return [line.split(",") for line in lines if not line.startswith("#")][1:]


def test_the_published_tables_are_shown_as_they_are_kept():
    shown = [[cell.strip() for cell in line.split("|")[1:-1]] for line in PAGE.splitlines() if line.startswith("|")]
    for row in published("table1_published"):
        assert [cell or "-" for cell in row] in shown, row
    for variant, particles, *figures, _ in published("table2_published"):
        pairs = [f"{mean} ± {sd}" for mean, sd in zip(figures[::2], figures[1::2], strict=True)]
        assert [variant.replace("_", " + "), f"{int(particles):,}", *pairs] in shown, variant
