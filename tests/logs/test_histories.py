"""Records beside simulations: the file gives back what was written, and a damaged one is refused by name."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from airtruth.errors import LogError, StoreError
from airtruth.logs.histories import KEY, Histories, History, read_histories, write_histories
from airtruth.logs.tables import KEY as METADATA

T = 0.02 * np.arange(5)


def history(run_id, floor=0.1):
    y = {c: np.sin(T + k) for k, c in enumerate(("alpha_rad", "az_m_s2"))}
    models = {m: {c: x * values for c, values in y.items()} for m, x in (("declared", 0.5), ("after", 0.9))}
    return History(
        run_id,
        "fitted",
        T,
        {"elevator_rad": -T},
        y,
        models,
        floor={"alpha_rad": floor},
        conditions={"mass_kg": 26.2},
    )


def two():
    return Histories((history("b"), history("a")), ("declared", "after"), "a", 7, {"x": [1, "y"]})


def test_a_file_gives_back_the_records(tmp_path):
    path = tmp_path / "records.parquet"
    write_histories(path, two())
    read = read_histories(path, "write it again")
    assert (read.models, read.shown, read.of_records, dict(read.facts)) == (
        ("declared", "after"),
        "a",
        7,
        {"x": [1, "y"]},
    )
    assert [r.run_id for r in read.records] == ["b", "a"]
    assert read.first.run_id == "a"
    for mine, stored in zip(two().records, read.records, strict=True):
        np.testing.assert_array_equal(stored.t_s, mine.t_s)
        np.testing.assert_array_equal(stored.controls_rad["elevator_rad"], mine.controls_rad["elevator_rad"])
        for c in mine.measured:
            np.testing.assert_array_equal(stored.measured[c], mine.measured[c])
            for m in mine.models:
                np.testing.assert_array_equal(stored.models[m][c], mine.models[m][c])
        assert (stored.group, stored.floor, stored.conditions) == (mine.group, mine.floor, mine.conditions)
        assert (stored.innovations, stored.effect) == ({}, {})


def test_the_error_of_a_model():
    """0.9 sin less sin: a tenth of the root mean square of sin."""
    own = history("a")
    assert own.rms("after", "alpha_rad") == pytest.approx(0.1 * np.sqrt(np.mean(np.sin(T) ** 2)), rel=1e-12)


def test_a_floor_without_a_number_is_left_out(tmp_path):
    path = tmp_path / "records.parquet"
    write_histories(path, Histories((history("a", np.nan),), ("declared", "after"), "a", 1))
    assert read_histories(path, "again").first.floor == {}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("models"), "models: field required"),
        (lambda d: d.update(models=["other"]), "no column 'alpha_rad_free_run_other'"),
        (lambda d: d.update(records={}), "holds no record"),
        (lambda d: d.update(records={"c": {"group": "", "floor": {}, "conditions": {}}}), "holds no record"),
        (lambda d: d.update(records=3), "records: input should be a valid dictionary"),
    ],
)
def test_a_damaged_description_is_refused(tmp_path, change, words):
    path = tmp_path / "records.parquet"
    write_histories(path, two())
    table = pq.read_table(path)
    document = json.loads(table.schema.metadata[METADATA])
    change(document[KEY])
    pq.write_table(table.replace_schema_metadata({METADATA: json.dumps(document)}), path)
    with pytest.raises(StoreError, match=words) as raised:
        read_histories(path, "run it again")
    assert "run it again" in str(raised.value)


def test_another_file_is_refused(tmp_path):
    path = Path(tmp_path / "records.parquet")
    path.write_bytes(b"PAR1 nothing")
    with pytest.raises((StoreError, LogError)):
        read_histories(path, "again")
