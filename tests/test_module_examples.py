"""Examples in the docstrings of modules run as written; those of the public functions are the matter of tests/api."""

from __future__ import annotations

import doctest
from importlib import import_module
from pathlib import Path

import pytest

import airtruth

SOURCE = Path(airtruth.__file__).parent
LAYERS = ("aircraft", "effects", "physics", "simulation")
MODULES = sorted(
    "airtruth." + ".".join(path.relative_to(SOURCE).with_suffix("").parts)
    for layer in LAYERS
    for path in (SOURCE / layer).rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("name", MODULES)
def test_examples(name: str) -> None:
    failed, tried = doctest.testmod(import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert tried > 0
    assert failed == 0
