"""The runner of documents sees what differs, and the README shows the way of a newcomer."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.readme import differs, run, steps, updated

ROOT = Path(__file__).resolve().parents[2]


def test_lines_are_compared_in_order():
    assert differs(["a", "b"], ["a", "b", ""]) == ""
    assert differs(["a", "..."], ["a", "b"]) == ""
    assert differs(["...", "c"], ["a", "b", "c"]) == ""
    assert differs(["...", "b"], ["a", "b", "c"]) == "(not shown) c"
    assert differs(["a", "c"], ["a", "b"]) == "c"
    assert differs(["...", "b", "a"], ["a", "b"]) == "a"
    assert differs(["a", "...", "1.67"], ["a", "1.68"]) == "1.67"
    assert differs([], ["a"]) == "(not shown) a"


def test_numbers_are_updated_and_words_are_not():
    shown = ["p = 1.0e-3, a", "...", "x   1.5 (0.2)", "gone 3"]
    printed = ["p = 2.5e-12, a", "more", "x  12.5 (0.3)", "other"]
    assert updated(shown, printed) == ["p = 2.5e-12, a", "...", "x  12.5 (0.3)", "gone 3"]


def test_steps_of_a_document():
    text = "```console\n$ airtruth a b\nout\n$ airtruth c\n```\n```python\nx = 1\n```\n"
    commands = list(steps(text))
    assert [(s.words, s.shown) for s in commands] == [(("a", "b"), ("out",)), (("c",), ()), ((), ())]
    assert commands[2].code == "x = 1\n"


def test_the_readme_leads_from_an_empty_folder_to_a_report():
    words = [step.words[0] for step in steps((ROOT / "README.md").read_text(encoding="utf-8")) if step.words]
    assert [w for w in words if w in ("new", "fly", "identify", "report")] == [
        "new",
        "fly",
        "identify",
        "report",
    ]
    assert words[:2] == ["example", "trace"]


@pytest.mark.slow
def test_a_wrong_line_is_reported(tmp_path):
    import os
    import sys

    page = tmp_path / "page.md"
    page.write_text("```console\n$ airtruth --version\n0.0.0\n$ airtruth bogus\n```\n", encoding="utf-8")
    wrong = run(page, Path(sys.executable), tmp_path, dict(os.environ))
    assert len(wrong) == 2
    assert wrong[0].startswith("airtruth --version: ")
    assert "exit code 2" in wrong[1]


@pytest.mark.long
def test_the_readme_prints_what_it_shows(tmp_path):
    import os
    import sys

    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    assert not run(ROOT / "README.md", Path(sys.executable), tmp_path, environment)
