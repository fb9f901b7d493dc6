"""The lateral pages of the gallery name the effect that they flew, with its size within 10 %."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

GALLERY = Path(__file__).resolve().parents[2] / "docs" / "gallery"

pytestmark = pytest.mark.long


def run(page: str) -> dict:
    """Names that the cells of a page leave, without its figures."""
    names: dict = {}
    text = (GALLERY / f"{page}.md").read_text(encoding="utf-8")
    for cell in re.findall(r"```\{code-cell\} ipython3\n(.*?)```", text, re.DOTALL):
        if "glue" in cell:
            continue
        for line in re.findall(r"^!airtruth (.*)$", cell, re.MULTILINE):
            subprocess.run([sys.executable, "-m", "airtruth", *shlex.split(line)], check=True)
        lines = [x for x in cell.splitlines() if not x.startswith(("!", "%", "traced.plot"))]
        exec("\n".join(lines), names)
    return names


@pytest.mark.parametrize(
    ("page", "key", "truth"),
    [
        ("late_rudder", "rudder_delay", 0.080),
        ("lost_fin", "fin_effectiveness", 0.35),
        ("nose_boom", "vane_arm:beta_rad", 1.2),
    ],
)
def test_a_page_names_what_it_flew(page, key, truth, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = run(page)["traced"].answer
    assert [e.key for e in answer.effects] == [key]
    (size,) = answer.effects[0].parameters.values()
    assert size.value == pytest.approx(truth, rel=0.1)
