"""What studies that are put side by side say of the code that made them."""

from fluidbench.runs.archive import of_other_code

from .made import finished


def study(sources, day):
    return [finished(code={"sources": s}, machine={"time": f"{day}T1{i}:00:00"}) for i, s in enumerate(sources)]


def test_studies_of_other_code_than_the_newest_are_named():
    studies = {
        "CPU": study(["a"], "2026-11-24"),
        "H100": study(["b", "b"], "2026-11-25"),
        "H100, seed 1": study(["b"], "2026-11-25"),
        "H200": study(["a", "b"], "2026-11-25"),
    }
    assert of_other_code(studies) == [
        "CPU was made by other code (2026-11-24) than the newest here (2026-11-25)",
        "H200 was in part made by other code (2026-11-25 10:00) than the newest here (2026-11-25 11:00)",
    ]


def test_on_one_day_the_hour_tells():
    old, new = study(["a"], "2026-11-24"), study(["a", "b"], "2026-11-24")[1:]
    assert of_other_code({"old": old, "new": new}) == of_other_code({"new": new, "old": old})
    assert "old was made" in of_other_code({"old": old, "new": new})[0]


def test_studies_of_one_code_say_nothing():
    assert of_other_code({"CPU": study(["a"], "2026-11-24"), "H100": study(["a"], "2026-11-25")}) == []
    assert of_other_code({"CPU": study(["a"], "2026-11-24")}) == of_other_code({}) == of_other_code({"CPU": []}) == []
    refused = [finished(verdict="refused", code={}, machine={})]
    assert of_other_code({"CPU": study(["a"], "2026-11-24"), "H100": refused}) == []
