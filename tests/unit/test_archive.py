"""What studies that are put side by side say of the code that made them."""

from fluidbench.runs.archive import of_other_code

from .made import finished


def study(sources, day):
    return [finished(code={"sources": s}, machine={"time": f"{day}T10:00:00+0000"}) for s in sources]


def test_studies_of_other_code_than_the_newest_are_named():
    studies = {
        "CPU": study(["a"], "2026-11-24"),
        "H100": study(["b", "b"], "2026-11-25"),
        "H100, seed 1": study(["b"], "2026-11-25"),
        "H200": study(["a", "b"], "2026-11-25"),
    }
    told = of_other_code(studies)
    assert [line.split(" was made")[0] for line in told] == ["CPU (2026-11-24)", "H200 (2026-11-25)"]
    assert all("by other code than H100 (2026-11-25): what differs may" in line for line in told)


def test_studies_of_one_code_say_nothing():
    assert of_other_code({"CPU": study(["a"], "2026-11-24"), "H100": study(["a"], "2026-11-25")}) == []
    assert of_other_code({"CPU": study(["a"], "2026-11-24")}) == of_other_code({}) == of_other_code({"CPU": []}) == []
