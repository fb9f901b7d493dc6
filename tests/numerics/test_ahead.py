"""Kernels that a child process compiles: when it starts, what it compiles, and what becomes of one that fails."""

import contextlib
import os
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest

from airtruth.cli.compilation import DYNAMIC, IDENTIFY, TRACE, compile_filter, compile_identification
from airtruth.cli.completion import METHOD_NAMES
from airtruth.isolation.interpreter import HOME, environment, module_command
from airtruth.numerics import ahead

LOG = Path(__file__).resolve().parents[2] / "data" / "undeclared" / "a.parquet"
COMMANDS = {
    IDENTIFY: ("identify", "--method", "iv-f1"),
    TRACE: ("trace", "--effect", "vane_lag"),
}
ENDED = {"stdout": (), "kill": lambda: None, "communicate": lambda: None}


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    return tmp_path


@pytest.fixture
def started(monkeypatch):
    """Processes that are started; each runs a module that does not exist."""
    processes = []
    start = subprocess.Popen

    def recorded(*args, **kwargs):
        processes.append(start(*args, **kwargs))
        return processes[-1]

    monkeypatch.setattr(ahead.subprocess, "Popen", recorded)
    monkeypatch.setattr(ahead, "_processors", lambda: 2)
    return processes


def index_of(kernel, cache, versions=2):
    """Write files with the names of numba's index of a kernel and of its versions."""
    module, _, name = kernel.rpartition(".")
    python = f"{sys.version_info.major}{sys.version_info.minor}"
    path = cache / "folder_0123" / f"{module.rpartition('.')[2]}.{name}-1.py{python}.nbi"
    path.parent.mkdir(exist_ok=True)
    for version in range(versions):
        path.with_suffix(f".{version + 1}.nbc").write_bytes(b"")
    path.write_bytes(b"")
    return path


def test_a_cache_lacks_a_kernel_without_an_index_as_new_as_its_source(empty_cache, monkeypatch):
    assert ahead.lacking(TRACE.last)
    path = index_of(TRACE.last, empty_cache)
    assert not ahead.lacking(TRACE.last)
    assert not ahead.lacking(TRACE.last, TRACE.versions)
    assert ahead.lacking(TRACE.last, TRACE.versions + 1)
    assert ahead.lacking(IDENTIFY.last)
    os.utime(path, (1.0, 1.0))
    assert ahead.lacking(TRACE.last)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert not ahead.lacking(TRACE.last)


def test_a_package_that_is_read_only_keeps_its_kernels_elsewhere(monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert not ahead.lacking(TRACE.last)


@pytest.mark.parametrize("plan", [IDENTIFY, TRACE], ids=lambda plan: plan.module)
def test_names_are_those_of_kernels_that_wait(plan):
    names = [name for name, _ in import_module(plan.module).KERNELS]
    assert names[-1] == plan.last
    for name in names:
        module, _, kernel = name.rpartition(".")
        waiting = getattr(import_module(module), kernel)
        assert f"{waiting.__module__}.{waiting.__name__}" == name
        assert waiting.__code__ is ahead.awaited(lambda: None).__code__


@pytest.mark.parametrize(
    ("methods", "cluster", "plans"),
    [
        (["ls", "iv-f1"], None, [IDENTIFY]),
        (["iv-f2"], None, [IDENTIFY]),
        (["ls", "iv-lowpass"], None, []),
        (["iv-f1"], "local:2", []),
    ],
)
def test_the_methods_choose_the_kernels(methods, cluster, plans, monkeypatch):
    chosen = []
    monkeypatch.setattr("airtruth.cli.compilation.compiling", lambda plan: plan)
    context = SimpleNamespace(with_resource=chosen.append)
    compile_identification(context, methods, cluster)
    assert chosen == plans
    compile_filter(context, cluster)
    assert chosen == [*plans, *([] if cluster else [TRACE])]
    assert set(DYNAMIC) <= set(METHOD_NAMES)


def test_a_child_that_fails_costs_nothing_but_its_time(empty_cache, started, capfd):
    def kernel(x):
        return x + 1.0

    with ahead.compiling(ahead.Ahead("airtruth.numerics.none_such", TRACE.last)):
        assert ahead.awaited(kernel)(1.0) == 2.0
        assert len(started) == 1
    assert started[0].returncode not in (None, 0)
    assert capfd.readouterr() == ("", "")
    assert ahead.awaited(kernel)(2.0) == 3.0  # no child any more


def test_a_child_has_the_names_of_the_caller(started, tmp_path, monkeypatch):
    """A cache in a relative folder, and a package behind a link."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "cache")
    (tmp_path / "link").symlink_to(HOME)
    monkeypatch.setattr(ahead, "HOME", tmp_path / "link")
    given = {}
    monkeypatch.setattr(
        ahead.subprocess, "Popen", lambda *args, **more: given.update(more) or SimpleNamespace(**ENDED)
    )
    with ahead.compiling(TRACE):
        pass
    assert given["env"]["NUMBA_CACHE_DIR"] == str(tmp_path / "cache")
    assert given["env"]["PYTHONPATH"].split(os.pathsep)[0] == str(tmp_path / "link")


def test_an_error_ends_the_child(empty_cache, started):
    with contextlib.suppress(ValueError), ahead.compiling(TRACE):
        raise ValueError
    assert started[0].returncode is not None


def test_one_processor_a_full_cache_and_a_lack_of_processes_start_none(empty_cache, started, monkeypatch):
    monkeypatch.setattr(ahead, "_processors", lambda: 1)
    with ahead.compiling(TRACE):
        pass
    monkeypatch.setattr(ahead, "_processors", lambda: 2)
    index_of(TRACE.last, empty_cache)
    with ahead.compiling(TRACE):
        pass
    assert not started

    def refused(*args, **kwargs):
        raise BlockingIOError

    monkeypatch.setattr(ahead.subprocess, "Popen", refused)
    with ahead.compiling(IDENTIFY):
        pass


def child(plan, cache):
    return subprocess.Popen(
        module_command("airtruth.numerics.ahead", plan.module),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=HOME,
        env=environment(NUMBA_CACHE_DIR=str(cache)),
    )


@pytest.mark.slow
def test_a_child_ends_with_its_caller(tmp_path):
    process = child(TRACE, tmp_path)
    time.sleep(1.0)
    process.communicate(timeout=10.0)
    assert not list(tmp_path.glob("*/filter._innovations-*.nbi"))


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("plan", [IDENTIFY, TRACE], ids=lambda plan: plan.module)
def test_the_first_run_has_the_bytes_of_the_second(plan, tmp_path):
    names = [name for name, _ in import_module(plan.module).KERNELS]
    assert result(plan, tmp_path / "cache", tmp_path / "out") == result(
        plan, tmp_path / "cache", tmp_path / "out"
    )
    with child(plan, tmp_path / "cache") as process:
        assert process.stdout.read().decode().split() == names
        assert process.wait() == 0
        assert process.stderr.read() == b""
    for name in names:  # the command and the child compile them for the same types
        module, _, kernel = name.rpartition(".")
        (index,) = tmp_path.glob(f"cache/*/{module.rpartition('.')[2]}.{kernel}-*.nbi")
        assert len(list(index.parent.glob(f"{index.stem}.*.nbc"))) == names.count(name)


def result(plan, cache, out):
    """Bytes of the files of a command."""
    verb, *options = COMMANDS[plan]
    target = out if verb == "trace" else out / "estimates.parquet"
    out.mkdir(exist_ok=True)
    command = module_command("airtruth", verb, str(LOG), "--aircraft", "gtm", *options)
    subprocess.run(
        [*command, "--quiet", "--force", "--out", str(target)],
        check=True,
        stdout=subprocess.DEVNULL,
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
    )
    return {
        path.relative_to(out): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file() and path.suffix in (".json", ".parquet", ".csv", ".xml", ".toml")
    }
