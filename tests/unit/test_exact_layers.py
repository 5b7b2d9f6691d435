"""What two layers on each other are judged by, on hand-made records."""

from types import SimpleNamespace

import pytest

from scenarios.analytic.laid_layers import CASE


def judged(area, matter, **measures):
    """The case's finding; errors of the answers as given."""
    answers = [
        SimpleNamespace(quantity=quantity, measured=1.0 + error, reference=1.0, error=error)
        for quantity, error in (("bead area [m^2]", area), ("bead matter [m^2]", matter))
    ]
    return CASE.evaluate({"wall": SimpleNamespace(record=SimpleNamespace(answers=answers, measures=measures))})


@pytest.mark.parametrize(("area", "matter", "packing"), [(0.03, 0.01, 0.98), (0.0, 0.04, 1.01), (0.01, 0.0, 0.93)])
def test_the_worst_of_section_matter_and_packing_counts(area, matter, packing):
    found = judged(area, matter, packing=packing)
    assert found.error == pytest.approx(max(area, matter, abs(packing - 1.0)))
    assert [number.measured for number in found.numbers] == pytest.approx([1.0 + area, 1.0 + matter, packing])


def test_beads_too_thin_to_tell_how_they_are_packed_are_judged_by_the_rest():
    found = judged(0.03, 0.01)
    assert found.error == pytest.approx(0.03) and len(found.numbers) == 2
