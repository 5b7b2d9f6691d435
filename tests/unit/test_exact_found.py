"""What planted errors have brought to light."""

import pytest

from fluidbench.errors import UserError
from fluidbench.paper import rows as module
from fluidbench.paper.rows import VARIANTS
from fluidbench.paper.table2 import table2
from fluidbench.study import stability_report as stability_page

from ..conftest import scenario
from .made import working


def test_rows_of_the_tower_are_called_by_their_variant(tmp_path, monkeypatch):
    """study/table2.py, table2(): the inner loop takes `variant` for the job's, so every row is called `pictures`, and
    no claim that compares variants is ever judged."""
    working(monkeypatch)
    rows = table2(["mpm"], pools=[None, 400_000], repeats=2, quick=True, out=tmp_path, progress=False).rows
    assert [r.variant for r in rows] == ["plain", *VARIANTS]
    assert len(module.claims(rows)) == 4


def test_a_block_that_could_not_be_measured_is_a_row_of_the_page():
    """report/stability.py, _blocks(): such a block has a reason and no dt_limit_s; the page dies of a KeyError."""
    (row,) = stability_page._blocks([{"kind": "acoustic", "method": "mpm", "reason": "it died"}]).rows
    assert row[:2] == ["acoustic", "mpm"] and set(row[2:]) <= {"-", "it died"}


def test_a_domain_that_is_too_large_says_what_would_be_right():
    """library.py, _short(): 200 characters end before `use a larger spacing or a smaller domain`."""
    with pytest.raises(UserError, match="use a larger spacing or a smaller domain"):
        scenario(domain={"lower": [0, 0, 0], "upper": [9e3] * 3})
