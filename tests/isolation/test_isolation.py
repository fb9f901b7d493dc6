"""A task in a disposable process replies, or ends in one error of a known kind; its caller goes on."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from airtruth.errors import StoreError
from airtruth.isolation import client
from airtruth.isolation.interpreter import environment
from airtruth.isolation.limits import LEAST_MEMORY_BYTES, ProcessLimits, limits_of
from airtruth.isolation.protocol import IsolatedError, Task, UnforeseenError

HERE = Path(__file__).parent
SHORT = ProcessLimits(seconds=1.0, memory_bytes=LEAST_MEMORY_BYTES)


@pytest.fixture(autouse=True)
def tasks(monkeypatch):
    """A server that can import the tasks of this folder."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")]))
    client.close()
    yield
    client.close()


@pytest.fixture(params=["forked", "started"])
def way(request, monkeypatch):
    """With fork, and as on a system without it."""
    if request.param == "started":
        monkeypatch.delattr("socket.send_fds")


def call(name, limits=SHORT, **arguments):
    return client.call(Task(f"isolated_tasks:{name}", arguments, limits))


@pytest.mark.slow
@pytest.mark.usefixtures("way")
def test_a_reply_keeps_facts_and_arrays():
    reply = call("echo", word="größe", value=float("inf"))
    assert reply.facts == {"word": "größe", "value": float("inf")}
    np.testing.assert_array_equal(reply.arrays[0], np.arange(6.0).reshape(2, 3))
    assert reply.arrays[1].tolist() == ["a", "bc"]
    assert reply.arrays[2].shape == (0, 2)


@pytest.mark.slow
@pytest.mark.usefixtures("way")
@pytest.mark.parametrize(
    ("name", "kind", "detail"),
    [
        ("die", "crash", "SIGABRT"),
        ("hang", "time", "1 s"),
        ("fill", "memory", ""),
        ("half", "crash", "incomplete"),
    ],
)
def test_an_ending_without_a_reply_has_a_kind_and_the_next_call_works(name, kind, detail):
    with pytest.raises(IsolatedError) as caught:
        call(name)
    assert caught.value.kind == kind
    assert detail in caught.value.detail
    assert call("echo", n=1).facts == {"n": 1}


@pytest.mark.slow
@pytest.mark.usefixtures("way")
def test_exceptions_arrive():
    with pytest.raises(StoreError, match=r"f\.csv: is refused"):
        call("refuse")
    with pytest.raises(UnforeseenError, match=r"isolated_tasks.py(.|\n)*ZeroDivisionError"):
        call("fail")


def test_the_callers_clock_ends_a_process_that_ignores_its_own(monkeypatch):
    monkeypatch.setattr(client, "PATIENCE_S", -0.9)
    start = time.monotonic()
    with pytest.raises(IsolatedError, match="time"):
        call("sleep")
    assert time.monotonic() - start < 5.0
    monkeypatch.setattr(client, "PATIENCE_S", 60.0)
    assert call("echo").facts == {}


def test_an_interrupted_call_does_not_spoil_the_next():
    def interrupt(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            call("sleep", ProcessLimits(30.0, LEAST_MEMORY_BYTES))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert call("echo", n=2).facts == {"n": 2}


def test_a_server_that_died_is_an_error_and_is_started_again():
    server = call("surroundings").facts["process"]
    os.kill(server, signal.SIGKILL)
    with pytest.raises(IsolatedError, match="start"):
        call("echo")
    assert call("echo").facts == {}


def test_a_forked_caller_has_a_server_of_its_own():
    server = call("surroundings").facts["process"]
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(writing, str(call("surroundings").facts["process"]).encode())
        client.close()
        os._exit(0)
    os.waitpid(child, 0)
    assert int(os.read(reading, 20)) != server
    os.close(reading)
    os.close(writing)
    assert call("surroundings").facts["process"] == server


def test_the_working_folder_is_not_on_the_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["", ".", str(tmp_path), str(HERE)]))
    (tmp_path / "isolated_tasks.py").write_text("raise SystemExit('code of a stranger')")
    client.close()
    facts = call("surroundings").facts
    assert facts["folder"] != str(tmp_path)
    assert not {"", ".", str(tmp_path)} & set(facts["path"])
    assert str(tmp_path) not in environment()["PYTHONPATH"]


def test_the_server_ends_with_its_caller(tmp_path):
    code = (
        "from airtruth.isolation.client import call\nfrom airtruth.isolation.limits import limits_of\n"
        "from airtruth.isolation.protocol import Task\nimport os, signal\n"
        "print(call(Task('isolated_tasks:surroundings', {}, limits_of(0))).facts['process'], flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    server = int(done.stdout)
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline:
        if not Path(f"/proc/{server}").exists() or "Z" in Path(f"/proc/{server}/stat").read_text().split()[2]:
            return
        time.sleep(0.02)
    raise AssertionError("the server outlived its caller")


def test_limits_grow_with_the_file():
    small, large = limits_of(0), limits_of(10**9)
    assert small.seconds < 20.0
    assert large.seconds > 400.0
    assert large.memory_bytes > 10 * 10**9
