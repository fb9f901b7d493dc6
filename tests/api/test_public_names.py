"""The public names: what `import airtruth` costs, and that no module hides a function."""

from __future__ import annotations

import ast
import inspect
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import airtruth as at

HEAVY = ("numpy", "scipy", "pandas", "pyarrow", "numba", "jsbsim", "matplotlib", "pydantic", "typer")
VERBS = (
    "load_aircraft",
    "fly",
    "plan",
    "read_log",
    "import_log",
    "find_manoeuvres",
    "check",
    "identify",
    "trace",
    "report",
)


def python(script: str) -> str:
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_the_import_loads_nothing_heavy() -> None:
    loaded = python(f"import sys, airtruth; print(*sorted({set(HEAVY)!r} & set(sys.modules)))")
    assert loaded == ""


def test_every_public_name_exists_and_is_listed() -> None:
    for name in at.__all__:
        assert getattr(at, name) is not None
    assert set(at.__all__) <= set(dir(at))
    assert set(VERBS) <= set(at.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'airtruth' has no attribute 'idenfity'"):
        at.idenfity  # noqa: B018


def test_the_stubs_for_type_checkers_name_what_is_loaded() -> None:
    """Each lazy name is imported under TYPE_CHECKING from the module that defines it."""
    tree = ast.parse(Path(at.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    stubs = {
        alias.asname or alias.name: f"{node.module}:{alias.name}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    lazy = {name: path if ":" in path else f"{path}:{name}" for name, path in at._LAZY.items()}
    assert stubs == lazy
    assert set(lazy) < set(at.__all__)


def test_no_module_has_the_name_of_a_public_function() -> None:
    """Python binds an imported submodule to its name in the package, over a function of that name."""
    modules = {module.name for module in pkgutil.iter_modules(at.__path__)}
    functions = {name for name in at.__all__ if inspect.isfunction(getattr(at, name))}
    assert not modules & functions


@pytest.mark.slow
def test_functions_survive_the_import_of_every_room() -> None:
    script = (
        "import airtruth as at, airtruth.cli, airtruth.reporting, airtruth.tracing, airtruth.design\n"
        "print(all(callable(getattr(at, n)) for n in at.__all__ if n[0].islower() and n[0] != '_'))"
    )
    assert python(script) == "True"


def test_a_name_loads_its_own_rooms_alone() -> None:
    script = (
        "import sys, airtruth as at; at.read_log; at.FlightLog; print({'numba', 'jsbsim'} & set(sys.modules))"
    )
    assert python(script) == "set()"
