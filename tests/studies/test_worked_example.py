"""The worked example of docs/measured.md gives what the page states."""

import json
import re
from pathlib import Path

import pytest

from studies import worked_example

ROOT = Path(__file__).resolve().parents[2]


BLOCKS = {"file", "guess", "refused", "imported", "checked", "identified", "traced"}

pytestmark = pytest.mark.xdist_group("worked-example")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return worked_example.make(tmp_path_factory.mktemp("example"))


@pytest.mark.long
def test_the_page_shows_every_block_and_its_commands_are_what_was_run(made):
    page = worked_example.PAGE.read_text(encoding="utf-8")
    marked = dict(re.findall(r"<!-- example: ([\w-]+) -->\n```\n(.*?)\n```", page, re.DOTALL))
    assert set(marked) == set(made.blocks) == BLOCKS
    for name, block in made.blocks.items():
        # figures may differ in a last digit from machine to machine: the first line may not
        assert marked[name].splitlines()[0] == block.splitlines()[0], name
    shown, got = (re.sub(r"p = [\d.e-]+", "p", b["traced"].splitlines()[1]) for b in (marked, made.blocks))
    assert shown == got
    assert marked["refused"] == made.blocks["refused"]


@pytest.mark.long
def test_the_guess_is_refused_and_the_settled_mapping_goes_through(made):
    assert made.codes.pop("refused") == 2
    assert set(made.codes.values()) == {0}


@pytest.mark.long
def test_the_undeclared_arm_is_traced(made):
    answer = json.loads((made.folder / "traced" / "trace.json").read_text(encoding="utf-8"))
    assert answer["verdict"] == "traced"
    assert [e["name"] for e in answer["effects"]] == ["vane_arm"]
    low, high = answer["effects"][0]["parameters"]["x_m"]["ci95"]
    assert low < 0.8 < high  # CAMPAIGN's x_m
    assert (made.folder / "traced" / "aircraft" / "gtm" / "gtm.xml").is_file()
    before, after = (answer["error"][s]["held_out"]["free_run"]["alpha_rad"] for s in ("before", "after"))
    assert after < 0.8 * before


def test_only_marked_blocks_are_rewritten(tmp_path):
    path = tmp_path / "a.md"
    path.write_text("x\n<!-- example: one -->\n```\nold\n```\n```\nkept\n```\n", encoding="utf-8")
    page = worked_example.Page(tmp_path, {"one": r"new \1"})
    assert worked_example.write(page, path) == (
        "x\n<!-- example: one -->\n```\nnew \\1\n```\n```\nkept\n```\n"
    )
