"""The first screen of README.md is short, and README defines a term where it first occurs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

TEXT = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
FIRST_WORDS = 120
"""Words before the first command, pictures and links left out."""
DEFINITIONS = {
    "record": r"A \*record\* is",
    "declared aircraft": r"The \*declared aircraft\* is",
    "held-out": r"A \*held-out\* record takes",
    "increment": r"an \*increment\*, a\s+curve",
    "provisional": r"An answer is \*provisional\* if",
    "GTM": r"NASA's 5\.5 % Generic\s+Transport Model \(GTM\)",
    "derivatives": r"stability and control derivatives",
    "estimators": r"fourteen estimators",
    "ATTAS": r"DLR's research aircraft ATTAS",
    "Cmalpha": r"Cmalpha, the change of the pitching\s+moment with angle of attack",
    "+-": r"number after \+- is a standard error",
}
"""Term -> where README defines it. Words of the first screen in their everyday sense are no terms."""
UNDEFINED = ("RelErr", "lambda", "Holm", "innovation", "nuisance", "regressor", "Dryden", "mac", "trim")
"""Terms of the glossary that README does without."""


def prose() -> str:
    """README without code blocks, pictures and link targets."""
    text = re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL)
    text = re.sub(r"^    .*$", "", text, flags=re.MULTILINE)
    return re.sub(r"\]\([^)]*\)", "]", re.sub(r"^!\[.*$", "", text, flags=re.MULTILINE))


def test_the_first_screen_is_short() -> None:
    before = re.sub(r"^!\[.*$", "", TEXT.split("```console")[0], flags=re.MULTILINE)
    words = re.sub(r"\]\([^)]*\)", "]", before).split()
    assert 0 < len(words) <= FIRST_WORDS


@pytest.mark.parametrize("term", DEFINITIONS)
def test_a_term_is_defined_where_it_first_occurs(term: str) -> None:
    """The sentence of the first occurrence, after the first screen, is the definition."""
    text = prose().split("In this example,")[1]
    first = re.search(rf"(?<!\w){re.escape(term)}", text)
    defined = re.search(DEFINITIONS[term], text)
    assert first is not None
    assert defined is not None
    assert defined.start() <= first.start() < defined.end()


@pytest.mark.parametrize("term", UNDEFINED)
def test_terms_of_the_glossary_are_not_used(term: str) -> None:
    assert not re.search(rf"(?<!\w){term}(?!\w)", prose())
