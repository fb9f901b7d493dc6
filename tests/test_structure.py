"""Bounds on the structure of the package: sizes, arguments, documented constants, no private imports."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src" / "airtruth"
FILES = sorted(SOURCE.rglob("*.py"))
LONGEST_FUNCTION = 80
LONGEST_FILE = 400
MOST_POSITIONAL = 10


def name_of(path: Path) -> str:
    return path.relative_to(SOURCE).as_posix()


def functions(tree: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    return (n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef))


def is_command(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether typer reads the function: each of its arguments is an option of the command line."""
    return any("command" in ast.unparse(d) or "callback" in ast.unparse(d) for d in function.decorator_list)


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_sizes(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LONGEST_FILE
    long = {
        f.name: f.end_lineno - f.lineno + 1
        for f in functions(ast.parse(text))
        if not is_command(f) and f.end_lineno - f.lineno + 1 > LONGEST_FUNCTION
    }
    assert not long


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_arguments(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    many = {
        f.name: len(f.args.posonlyargs) + len(f.args.args)
        for f in functions(tree)
        if not is_command(f) and len(f.args.posonlyargs) + len(f.args.args) > MOST_POSITIONAL
    }
    calls = [
        f"line {n.lineno}: {ast.unparse(n.func)}"
        for n in ast.walk(tree)
        if isinstance(n, ast.Call) and len(n.args) > MOST_POSITIONAL
    ]
    assert not many
    assert not calls


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_constants_have_docstrings(path):
    """A module constant states its unit and its source; a family of constants may share one docstring."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    bare = []
    for node, following in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.AnnAssign) or "Final" not in ast.unparse(node.annotation):
            continue
        documented = (
            isinstance(following, ast.Expr)
            and isinstance(following.value, ast.Constant)
            and isinstance(following.value.value, str)
        )
        if not documented:
            bare.append(ast.unparse(node.target))
    assert not bare


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_no_private_imports(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    private = [
        f"{n.module}.{a.name}"
        for n in ast.walk(tree)
        if isinstance(n, ast.ImportFrom) and (n.module or "").startswith("airtruth")
        for a in n.names
        if a.name.startswith("_") and not a.name.startswith("__")
    ]
    assert not private


def test_the_tracer_needs_no_type_ignore():
    lines = [
        f"{name_of(path)}:{number}"
        for path in FILES
        if name_of(path).startswith("tracing/")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if "type: ignore" in line
    ]
    assert not lines


@pytest.mark.slow
def test_no_untyped_dictionary_travels_between_modules():
    """dict[str, Any] is for the borders: files, JSON, keyword arguments of other libraries."""
    public = [
        f"{name_of(path)}: {f.name}"
        for path in FILES
        for f in functions(ast.parse(path.read_text(encoding="utf-8")))
        if not f.name.startswith("_") and f.name not in BORDERS and "dict[str, Any]" in annotations(f)
    ]
    assert not public


BORDERS = {"to_dict", "from_dict", "as_dict", "keys_to_si"}
"""Functions that are a border to JSON, or to TOML before it is validated."""


def annotations(function: ast.FunctionDef | ast.AsyncFunctionDef) -> str:
    arguments = [a.annotation for a in (*function.args.args, *function.args.kwonlyargs) if a.annotation]
    returned = [function.returns] if function.returns else []
    return " ".join(ast.unparse(a) for a in (*arguments, *returned))


def test_frozen_dataclasses_hold_no_cache():
    """What is computed from a value is kept beside it (`airtruth.numerics.kept`), or is a cached property."""
    hidden = [
        f"{name_of(path)}: {c.name}.{ast.unparse(field.target)}"
        for path in FILES
        for c in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(c, ast.ClassDef) and any("frozen=True" in ast.unparse(d) for d in c.decorator_list)
        for field in c.body
        if isinstance(field, ast.AnnAssign) and field.value and "init=False" in ast.unparse(field.value)
    ]
    assert not hidden


def test_nothing_before_the_search_imports_it():
    rooms = (
        "tracing/model/",
        "tracing/inference/",
        "tracing/calibration/",
        "tracing/prepare.py",
        "tracing/conditions.py",
    )
    upward = [
        name_of(path)
        for path in FILES
        if name_of(path).startswith(rooms)
        and "airtruth.tracing.selection" in path.read_text(encoding="utf-8")
    ]
    assert not upward


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_docstrings_begin_with_a_noun_or_a_verb(path):
    """A docstring names its subject: no noun clause (What the filter reads) and no bare genitive (Of a problem)."""
    clauses = re.findall(r'"""(?:What|Of) [^\n]*', path.read_text(encoding="utf-8"))
    assert not clauses
