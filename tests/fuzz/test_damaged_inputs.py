"""A damaged input gives a result or one error of airtruth; `make fuzz` draws the same mutations in large numbers.

The suite turns warnings into errors, so no damage may cause a numerical warning either.
"""

import contextlib
import os
import tempfile
from pathlib import Path

import pytest
import strategies
from hypothesis import HealthCheck, given, settings

from airtruth.errors import AirtruthError
from airtruth.importers import MappingFile, import_log
from airtruth.reporting import report
from validation.fuzz import files, harness, logs, results
from validation.fuzz.__main__ import CASES


def examples(count):
    return settings(
        max_examples=count,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )


@contextlib.contextmanager
def folder_in_which_errors_are_foreseen():
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(AirtruthError):
        yield Path(folder)


@pytest.mark.slow
@examples(40)
@given(strategies.damaged_logs(), strategies.RANDOM)
def test_bytes_of_logs(content, rng):
    with folder_in_which_errors_are_foreseen() as folder:
        (folder / "log.parquet").write_bytes(content)
        logs.use(folder / "log.parquet", rng)


@pytest.mark.long
@examples(4)
@given(strategies.altered_logs(), strategies.RANDOM)
def test_contents_of_logs(content, rng):
    with folder_in_which_errors_are_foreseen() as folder:
        (folder / "log.parquet").write_bytes(content)
        logs.use(folder / "log.parquet", rng)


@pytest.mark.slow
@examples(60)
@given(strategies.foreign_files())
def test_foreign_files(file):
    name, content, mapping = file
    with folder_in_which_errors_are_foreseen() as folder:
        (folder / name).write_bytes(content)
        import_log(folder / name, MappingFile.model_validate(mapping), force=True)


@pytest.mark.slow
@examples(25)
@given(strategies.campaigns())
def test_campaigns(content):
    with folder_in_which_errors_are_foreseen() as folder:
        (folder / "c.toml").write_bytes(content)
        files.plan_campaign(folder / "c.toml")


@pytest.mark.slow
@examples(60)
@given(strategies.mappings())
def test_mappings(content):
    with folder_in_which_errors_are_foreseen() as folder:
        (folder / "m.toml").write_bytes(content)
        files.import_through(folder / "m.toml")


@examples(40)
@given(strategies.aircraft_files())
def test_aircraft_files(content):
    with folder_in_which_errors_are_foreseen() as folder:
        files.load_aircraft(content, folder)


@pytest.mark.slow
@examples(60)
@given(strategies.traces())
def test_traces(content):
    with folder_in_which_errors_are_foreseen() as folder:
        (folder / "trace.json").write_bytes(content)
        report(folder, folder / "page.html")


@examples(40)
@given(strategies.loops())
def test_loops(content):
    with folder_in_which_errors_are_foreseen() as folder:
        (folder / "loop.json").write_bytes(content)
        report(folder, folder / "page.html")


@pytest.mark.slow
@examples(30)
@given(strategies.estimates(), strategies.RANDOM)
def test_estimates(content, rng):
    with folder_in_which_errors_are_foreseen() as folder:
        results.lay_out(folder)
        (folder / "estimates.parquet").write_bytes(content)
        results.use_table(folder / "estimates.parquet", rng)


def end_somehow(rng, folder):
    kind = rng.randrange(5)
    if kind == 1:
        raise AirtruthError("a sentence")
    if kind == 2:
        raise ZeroDivisionError("by zero")
    if kind == 3:
        os._exit(9)
    while kind == 4:
        pass


@pytest.mark.slow
def test_the_harness_counts_every_ending_and_repeats_it(monkeypatch):
    monkeypatch.setattr(harness, "HANG_S", 0.2)
    case = harness.Case("self", 12, end_somehow)
    tally, again = (harness.run_cases(case, range(12), seed=1) for _ in range(2))
    assert sum(tally.endings.values()) == 12
    assert set(tally.endings) == set(harness.ENDINGS)
    assert tally.endings == again.endings
    assert {reason.split()[0] for reason in tally.bad} == {"ZeroDivisionError", "exit"}


def test_the_counts_of_the_issue():
    count = {case.name: case.count for case in CASES}
    assert count["log bytes"] >= 10_000
    assert count["log contents"] >= 5_000
    assert sum(n for name, n in count.items() if name.startswith("import")) >= 10_000
    assert count["campaign"] + count["mapping"] + count["aircraft"] >= 4_000
    results_ = ("trace.json", "loop.json", "estimates", "campaign.json", "manifest")
    assert sum(count[name] for name in results_) >= 2_000


pytestmark = pytest.mark.xdist_group("fuzz")  # the base flight is made once


@pytest.mark.slow
@pytest.mark.parametrize("name", ["import dialects", "import structs", "source words"])
def test_new_readers(name):
    """The first 120 cases of seed 2; `python -m validation.fuzz --only NAME` draws a thousand for each kind of file."""
    (case,) = [one for one in CASES if one.name == name]
    assert case.count >= 1000
    tally = harness.run_cases(case, range(120), seed=2)
    assert not tally.bad
    assert tally.endings["result"] > 0
