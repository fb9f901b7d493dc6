"""docs/trace_keys.md and docs/theory/trace_rules.md are those of the code."""

from __future__ import annotations

from dataclasses import fields

import pytest

from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.criterion import CRITERION
from scripts.trace_tables import CLASSES, KEYS_PAGE, PAGES, attributes, keys, rules, with_part


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_page_is_current(page) -> None:
    text = page.read_text(encoding="utf-8")
    assert with_part(text, PAGES[page]()) == text, "run `python -m scripts.trace_tables`"


@pytest.mark.parametrize("documented", CLASSES.values(), ids=lambda c: c.__name__)
def test_every_key_is_described(documented) -> None:
    described = {name for names, _ in attributes(documented) for name in names.split(", ")}
    assert described == {f.name for f in fields(documented)}


def test_keys_and_rules_have_their_rows() -> None:
    assert all(f"`{f.name}`" in keys() for f in fields(TraceAnswer))
    assert "`shown_by`" in KEYS_PAGE.read_text(encoding="utf-8")
    assert f"| `many` | {CRITERION.many} | number of separate causes" in rules()


def test_a_class_without_attributes_is_refused() -> None:
    with pytest.raises(ValueError, match="no section Attributes"):
        attributes(int)
