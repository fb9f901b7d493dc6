"""Commands that are killed or lack a resource; `make robustness` has 200 kills of every command."""

import resource
import subprocess
import sys

import pytest

from validation.robustness.kills import (
    MODES,
    ROOT,
    Verb,
    command,
    ended,
    kill_trial,
    prepared_verbs,
    start,
    undisturbed,
)
from validation.robustness.trees import digests

pytestmark = pytest.mark.slow

# Runs a command under a limit of its own: name of the limit and value.
LIMITED = """
import resource, sys
name, value, *arguments = sys.argv[1:]
resource.setrlimit(getattr(resource, name), (int(value), int(value)))
sys.argv = ["airtruth", *arguments]
from airtruth.cli import main
main()
"""


@pytest.fixture(scope="module")
def verbs(tmp_path_factory):
    prepared = prepared_verbs(tmp_path_factory.mktemp("kills"), ["fly", "identify"])
    return {verb.name: verb for verb in prepared}


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    """A campaign of six runs."""
    folder = tmp_path_factory.mktemp("few")
    file = ROOT / "data" / "campaigns" / "light.toml"
    verb = Verb(
        "fly", ("fly", "light.toml", "--out", "out", "--runs", "6", "--jobs", "2", "--quiet"), (file,)
    )
    return undisturbed(verb, folder / "whole")


@pytest.mark.long
@pytest.mark.parametrize(("name", "seed"), [("fly", 2), ("identify", 3)])
def test_a_killed_command_ends_with_the_files_of_an_undisturbed_one(verbs, tmp_path, name, seed):
    mode, _, fault = kill_trial(verbs[name], tmp_path / "trial", seed)
    assert mode in MODES
    assert fault == ""


@pytest.mark.parametrize(
    ("limit", "value"),
    [
        ("RLIMIT_NOFILE", 9),
        pytest.param("RLIMIT_AS", 800_000 * 1024, marks=pytest.mark.long),
        pytest.param("RLIMIT_AS", 1_100_000_000, marks=pytest.mark.long),
        pytest.param("RLIMIT_FSIZE", 20_000, marks=pytest.mark.long),
    ],
)
def test_a_lack_of_a_resource_is_one_sentence_and_tears_nothing(few, tmp_path, limit, value):
    verb = few
    folder = tmp_path / "trial"
    start(verb, folder)
    assert hasattr(resource, limit)
    done = subprocess.run(
        [sys.executable, "-P", "-c", LIMITED, limit, str(value), *verb.arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode in (0, 2, 70), done.stderr  # 70: out of memory
    assert done.stderr.count("\n") == (1 if done.returncode else 0), done.stderr
    assert limit != "RLIMIT_AS" or "airtruth needs 1.5 GB; raise the limit with `ulimit -v" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(folder.rglob(".*.tmp"))
    assert ended(command(verb, folder))[0] == 0
    assert digests(folder) == dict(verb.files)
