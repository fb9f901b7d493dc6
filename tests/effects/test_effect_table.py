"""The documented tables of effects and of the keys of trace.json are those of the package."""

import dataclasses
import re
from pathlib import Path

from airtruth.tracing.answer import TraceAnswer
from scripts.effects_table import PAGE, with_table

TRACE = Path(__file__).parents[2] / "docs" / "trace.md"


def test_the_page_of_effects_has_the_present_library():
    page = PAGE.read_text(encoding="utf-8")
    assert with_table(page) == page, "run `python -m scripts.effects_table`"


def test_every_key_of_the_answer_is_documented():
    text = TRACE.read_text(encoding="utf-8")
    table = text.split("### Keys of trace.json")[1].split("##")[0]
    listed = {
        key
        for row in re.findall(r"^\| (`[^|]*) \|", table, re.MULTILINE)
        for key in re.findall(r"`(\w+)`", row)
    }
    assert listed == {f.name for f in dataclasses.fields(TraceAnswer)} | {"shown_by"}
