"""The documented table of effects is that of the package."""

from scripts.effects_table import PAGE, with_table


def test_the_page_of_effects_has_the_present_library():
    page = PAGE.read_text(encoding="utf-8")
    assert with_table(page) == page, "run `python -m scripts.effects_table`"
