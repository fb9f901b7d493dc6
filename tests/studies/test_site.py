"""The site: its examples are code, its requirements are locked, and its notebook runs as a reader runs it.

`make docs` builds the site and executes every page; these tests need no Sphinx.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from typer.main import get_command

import airtruth
from airtruth.cli import app

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
GALLERY = DOCS / "gallery"
NOTEBOOK = GALLERY / "closing_the_loop.ipynb"
FEWEST_EXAMPLES = 8

RUNNER = """
import ast, json, sys
shown, names = [], {}
for source in json.load(open(sys.argv[1]))["cells"]:
    if source["cell_type"] != "code":
        continue
    tree = ast.parse("".join(line for line in source["source"] if not line.startswith("%")))
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if last is not None:
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        if value is not None:
            shown.append([type(value).__name__, getattr(value, "_repr_html_", str)()])
json.dump(shown, open("shown.json", "w"))
"""
"""Runs the cells as a kernel does: the value of a last expression displays itself."""


def pages() -> list[Path]:
    listed = re.search(
        r"```\{toctree\}\n(?::\w+:.*?\n)+\n(.*?)```", (GALLERY / "index.md").read_text(), re.DOTALL
    )
    assert listed
    names = listed[1].split()
    return [next(p for p in (GALLERY / f"{n}.md", GALLERY / f"{n}.ipynb") if p.is_file()) for n in names]


def cells(page: Path) -> list[str]:
    if page.suffix == ".ipynb":
        document = json.loads(page.read_text(encoding="utf-8"))
        return ["".join(c["source"]) for c in document["cells"] if c["cell_type"] == "code"]
    return re.findall(r"```\{code-cell\} ipython3\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def test_every_example_of_the_gallery_is_listed_and_runs_code():
    listed = pages()
    assert len(listed) >= FEWEST_EXAMPLES
    assert {p.stem for p in listed} == {
        p.stem for p in GALLERY.iterdir() if p.suffix in (".md", ".ipynb")
    } - {"index"}
    assert all(cells(page) for page in listed)


def test_every_example_of_the_gallery_has_a_card_with_its_picture():
    index = (GALLERY / "index.md").read_text()
    cards = re.findall(r":link: (\w+)\n(?::.*\n)+\n```\{glue\} (\w+)\n:doc: (\S+)\n```\n\n(.+)\n", index)
    assert {link for link, *_ in cards} == {p.stem for p in pages()}
    for link, key, document, words in cards:
        assert document.split(".")[0] == link
        assert any(f'glue("{key}"' in cell for cell in cells(GALLERY / document))
        assert len(words) > 20


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda p: p.relative_to(DOCS).as_posix())
def test_cells_of_pages_are_python(page):
    """A page with cells begins with the lines by which the site recognises it; its cells parse."""
    text = page.read_text(encoding="utf-8")
    if "{code-cell}" not in text:
        return
    assert text.startswith("---\nfile_format: mystnb\n")
    for cell in cells(page):
        ast.parse(
            "\n".join(
                re.sub(r"^\s*[!%].*", "pass", line) for line in cell.splitlines() if not line.startswith(":")
            )
        )


def test_the_reference_shows_every_command_and_every_public_name():
    def leaves(command, words: tuple[str, ...]) -> list[str]:
        children = getattr(command, "commands", None)
        return (
            [" ".join(words)]
            if not children
            else [n for k, c in children.items() for n in leaves(c, (*words, k))]
        )

    commands = (DOCS / "commands.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^## (airtruth .*)$", commands, re.MULTILINE)) == set(
        leaves(get_command(app), ("airtruth",))
    )
    shown = re.findall(
        r"^\.\. auto\w+:: airtruth\.(\w+)$", (DOCS / "api.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert set(shown) == set(airtruth.__all__) - {"__version__", "Logs", "Result"}


def test_every_page_is_in_the_navigation():
    """A page in no toctree is a warning of the site, and a warning ends its build."""
    listed = {"index"}
    for page in DOCS.rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        for block in re.findall(r"```\{toctree\}\n(.*?)```", text, re.DOTALL):
            names = [line.strip() for line in block.splitlines() if line.strip() and not line.startswith(":")]
            listed |= {(page.parent / name).relative_to(DOCS).as_posix() for name in names}
    pages = {
        p.relative_to(DOCS).with_suffix("").as_posix()
        for p in DOCS.rglob("*")
        if p.suffix in (".md", ".ipynb")
    }
    assert pages == listed


def test_the_notebook_holds_no_outputs():
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    assert cells
    for cell in cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


def test_the_locks_hold_what_pyproject_asks_for():
    """`make lock` was run after the last change of the dependencies, and the three locks agree."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = {
        "requirements.lock": [*project["dependencies"], *extras["build"]],
        "requirements-dev.lock": [*project["dependencies"], *extras["build"], *extras["dev"]],
        "requirements-docs.lock": [*project["dependencies"], *extras["build"], *extras["docs"]],
    }
    locked = {name: locks(ROOT / name) for name in asked}
    assert all(locked.values())
    for name, wanted in asked.items():
        for requirement in wanted:
            package = re.match(r"[A-Za-z0-9_.-]+", requirement)[0].lower().replace("_", "-")
            assert package == "airtruth" or package in locked[name], (
                f"{package} is not in {name}: run make lock"
            )
    for name in ("requirements.lock", "requirements-docs.lock"):
        for package, versions in locked[name].items():
            assert locked["requirements-dev.lock"].get(package, versions) == versions


def locks(path: Path) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for package, version in re.findall(
        r"^([A-Za-z0-9_.-]+)==(\S+)", path.read_text(encoding="utf-8"), re.MULTILINE
    ):
        found.setdefault(package.lower(), set()).add(version)
    return found


@pytest.mark.long
def test_the_notebook_closes_the_loop(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", RUNNER, str(NOTEBOOK)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src"), "MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    shown = dict(json.loads((tmp_path / "shown.json").read_text(encoding="utf-8")))
    assert set(shown) == {"FlightLog", "IdentificationResult", "LoopResult", "TraceResult", "Figure"}
    assert "vane_arm" in shown["LoopResult"]
    assert float(re.search(r"vane ([\d.]+) m ahead", done.stdout)[1]) == pytest.approx(1.6, abs=0.3)
