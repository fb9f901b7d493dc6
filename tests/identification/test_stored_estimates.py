"""A file of estimates that airtruth did not write as it is, is refused by name before a merge, and replaced by force."""

import json
import threading
from dataclasses import replace

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from airtruth.errors import ConfigurationError, StoreError
from airtruth.identification import identify, write_estimates
from airtruth.identification.stored import read_stored
from airtruth.logs.store import write_log
from airtruth.simulation.new_aircraft import estimated_derivatives
from validation.linear_flight import GTM, as_log, fly


@pytest.fixture(scope="module")
def result():
    return identify(as_log(fly(runs=2, noise=0.1)), GTM, ["ls"])


def column(name, change):
    def damage(table):
        values = [change(value) for value in table.column(name).to_pylist()]
        return table.set_column(table.column_names.index(name), name, pa.array(values))

    return damage


def record(change):
    def damage(table):
        facts = json.loads(table.schema.metadata[b"airtruth"])
        change(facts["estimates"]["ls"])
        return table.replace_schema_metadata({b"airtruth": json.dumps(facts).encode()})

    return damage


DAMAGES = [
    (column("Cmq", str), "column 'Cmq' holds .*, not a number in each row"),
    (column("run_id", lambda v: None), "column 'run_id' holds .*, not a text in each row"),
    (column("run_id", lambda v: "a"), "has two rows of run 'a' by method 'ls'"),
    (column("converged", float), "column 'converged' holds float64, not a flag in each row"),
    (lambda table: table.append_column("Cmq", table.column("Cmq")), "column 'Cmq' occurs more than once"),
    (lambda table: table.drop_columns(["method"]), "is not a file of estimates"),
    (
        record(lambda r: r.pop("constants")),
        r"the record of its options is damaged \(ls.constants: field required",
    ),
    (record(lambda r: r.update(sources=7)), r"the record of its options is damaged \(ls.sources"),
]


def test_estimates_of_all_runs_jointly_are_not_mixed_with_those_of_each(tmp_path):
    log, path = as_log(fly(runs=2, noise=0.1)), tmp_path / "estimates.parquet"
    write_estimates(path, identify(log, GTM, ["ls"], joint=True))
    each = identify(log, GTM, ["iv-f1"])
    with pytest.raises(
        StoreError, match="holds estimates of ls of all runs jointly, and these are run by run"
    ):
        write_estimates(path, each)
    write_estimates(path, each, force=True)
    assert set(read_stored(path)[1]) == {"iv-f1"}


def test_estimates_need_a_parquet_name(tmp_path):
    with pytest.raises(StoreError, match=r"estimates are a Parquet file; name it e\.parquet"):
        write_estimates(tmp_path / "e", identify(as_log(fly(runs=1, noise=0.1)), GTM, ["ls"]))


def test_logs_of_one_name_are_both_sources(tmp_path):
    path = tmp_path / "estimates.parquet"
    for number, folder in enumerate(("a", "b")):
        (tmp_path / folder).mkdir()
        log = as_log(fly(runs=1, noise=0.1, seed=number))
        write_log(tmp_path / folder / "log.parquet", replace(log, run_ids=(folder,)))
        write_estimates(path, identify(tmp_path / folder / "log.parquet", GTM, ["ls"]))
    frame, records = read_stored(path)
    assert list(frame["run_id"]) == ["a", "b"]
    assert [name for name, _, _ in records["ls"]["sources"]] == ["log.parquet", "log.parquet"]


def test_two_commands_merge_into_one_file(tmp_path):
    """Each waits for the other between reading the file and replacing it."""
    log, path = as_log(fly(runs=2, noise=0.1)), tmp_path / "estimates.parquet"
    found = [identify(log, GTM, [method]) for method in ("ls", "iv-f1", "iv-f2", "frequency")]
    threads = [threading.Thread(target=write_estimates, args=(path, one)) for one in found]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(read_stored(path)[1]) == {"ls", "iv-f1", "iv-f2", "frequency"}


@pytest.mark.parametrize(("damage", "words"), DAMAGES)
def test_a_damaged_file_of_estimates(result, tmp_path, damage, words):
    path = tmp_path / "estimates.parquet"
    write_estimates(path, result)
    pq.write_table(damage(pq.read_table(path)), path)
    with pytest.raises(StoreError, match=rf"estimates\.parquet: {words}.*; .*"):
        write_estimates(path, result)
    write_estimates(path, result, force=True)
    write_estimates(path, result)


@pytest.mark.parametrize(
    ("damage", "error", "words"),
    [
        (column("Cmq", lambda v: v * 1e300), ConfigurationError, "Cmq of ls is .* choose another method"),
        (column("Cmq_std", str), StoreError, "column 'Cmq_std' holds"),
        (lambda table: table.slice(0, 0), ConfigurationError, "the table has no rows"),
        (lambda table: table.drop_columns(["method"]), StoreError, "no column 'method'"),
    ],
)
def test_an_aircraft_of_damaged_estimates(result, tmp_path, damage, error, words):
    path = tmp_path / "estimates.parquet"
    write_estimates(path, result)
    pq.write_table(damage(pq.read_table(path)), path)
    with pytest.raises(error, match=words):
        estimated_derivatives(path)
