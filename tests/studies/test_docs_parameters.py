"""Parameters on the pages of the API have descriptions, and no descriptions as types."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("sphinx")
FILE = Path(__file__).resolve().parents[2] / "docs" / "_ext" / "parameters.py"
SPEC = importlib.util.spec_from_file_location("parameters", FILE)
assert SPEC is not None
parameters = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(parameters)


def test_a_description_is_below_its_name():
    lines = [
        "Fly.",
        "",
        "Parameters",
        "----------",
        "runs, seed : number of runs,",
        "    and seed.",
        "out : folder.",
    ]
    assert parameters.described(lines) == [
        *("Fly.", "", "Parameters", "----------"),
        *("runs, seed", "    number of runs,", "    and seed.", "out", "    folder."),
    ]


def test_two_entries_of_a_line_are_divided():
    lines = ["Attributes", "----------", "a : first [m]; b, c : others [-]."]
    assert parameters.described(lines)[2:] == ["a", "    first [m]", "b, c", "    others [-]."]


def test_other_sections_and_prose_are_left_alone():
    lines = [
        "It has x : y.",
        "",
        "Raises",
        "------",
        "StoreError",
        "    If a : b fails.",
        "",
        "Notes",
        "-----",
        "a : b",
    ]
    assert parameters.described(lines) == lines
