"""Reading a campaign: what comes out, and the message for each thing that can be wrong."""

import json

import numpy as np
import pytest
import report_synthetic as synthetic

from airtruth.errors import LogError, StoreError
from airtruth.reporting import FlownCampaign, read_campaign, stored_campaign
from airtruth.reporting.description import describe


@pytest.fixture
def pieces():
    """Truth and estimates of six runs, of which run 2 failed, by two methods."""
    values = synthetic.draw_paper("table1", ("ls", "iv-lowpass"), 6, seed=1)
    return (
        synthetic.truth_columns(6, failed=(2,)),
        synthetic.estimate_columns(values, failed=(2,), status={("ls", 4): "maximum iterations"}),
        values,
    )


def without(columns, keep):
    index = [i for i in range(len(columns["run_id"])) if keep(i)]
    return {name: [values[i] for i in index] for name, values in columns.items()}


def test_arrays_follow_the_runs_of_the_truth(tmp_path, pieces):
    truth, estimates, values = pieces
    shuffled = without(estimates, lambda i: True)
    order = np.random.default_rng(0).permutation(len(estimates["run_id"]))
    shuffled = {name: [column[i] for i in order] for name, column in shuffled.items()}
    c = read_campaign(synthetic.write_campaign(tmp_path / "calm", truth, shuffled))
    assert c.run_ids == tuple(synthetic.run_names(6))
    assert (c.name, c.title, c.gust) == ("calm", "calm", "")
    assert c.flown.tolist() == [True, True, False, True, True, True]
    np.testing.assert_array_equal(c.truth[0], synthetic.TRUTH)
    for method in ("ls", "iv-lowpass"):
        e = c.estimates[method]
        assert np.isnan(e.values[2]).all()
        np.testing.assert_array_equal(e.values[c.flown], values[method][c.flown])
        np.testing.assert_allclose(e.upper[c.flown] - e.lower[c.flown], 0.2, rtol=1e-9)
    assert c.estimates["ls"].converged.tolist() == [True, True, False, True, False, True]
    assert c.estimates["ls"].status[4] == "maximum iterations"
    assert c.estimates["iv-lowpass"].iterations[1] == 4.0


def test_status_of_the_estimates_may_be_absent(tmp_path, pieces):
    truth, estimates, _ = pieces
    del estimates["status"]
    c = read_campaign(synthetic.write_campaign(tmp_path / "c", truth, estimates))
    assert c.estimates["ls"].status[0] == "not converged"


def test_description_names_the_campaign(tmp_path, pieces):
    description = {"name": "light", "title": "Light turbulence", "gust": {"level": "light"}}
    c = read_campaign(synthetic.write_campaign(tmp_path / "c", *pieces[:2], description))
    assert (c.name, c.title, c.gust) == ("light", "Light turbulence", "level light")


def test_a_campaign_without_a_title_has_its_name(tmp_path):
    """`fly` writes the empty title of such a campaign."""
    (tmp_path / "campaign.json").write_text(json.dumps({"name": "light", "title": ""}))
    assert describe(tmp_path).title == "light"


def test_runs_that_the_truth_lacks_are_not_overlooked(tmp_path, pieces):
    folder = synthetic.write_campaign(tmp_path / "c", *pieces[:2], {"name": "light", "runs": 8})
    with pytest.raises(LogError, match=r"holds 6 of the 8 runs that campaign\.json plans; `airtruth fly"):
        read_campaign(folder)


@pytest.mark.parametrize(
    "text", ['{"name": ', '["light"]', '{"name": "a/b"}', '{"name": 3}', '{"runs": "six"}']
)
def test_a_bad_description_is_refused(tmp_path, pieces, text):
    folder = synthetic.write_campaign(tmp_path / "c", *pieces[:2])
    (folder / "campaign.json").write_text(text)
    with pytest.raises(StoreError, match=r"campaign\.json"):
        read_campaign(folder)


def test_deeply_nested_settings_are_refused(tmp_path, pieces):
    folder = synthetic.write_campaign(tmp_path / "c", *pieces[:2])
    (folder / "campaign.json").write_text('{"gust": {"level": ' + "[" * 100_000 + "]" * 100_000 + "}}")
    with pytest.raises(StoreError, match="not valid JSON: nested too deeply"):
        read_campaign(folder)


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("Cmq", ["-41"] * 11, "column 'Cmq' holds string, not double"),
        ("converged", [1.0] * 11, "column 'converged' holds double, not bool"),
        ("converged", [None, *[True] * 10], "column 'converged' has empty cells"),
        ("method", [1] * 11, "column 'method' holds int64, not string"),
    ],
)
def test_a_column_of_another_type_is_refused(tmp_path, pieces, column, values, message):
    truth, estimates, _ = pieces
    rows = len(estimates["run_id"])
    with pytest.raises(LogError, match=message):
        read_campaign(synthetic.write_campaign(tmp_path / "c", truth, {**estimates, column: values[:rows]}))


def test_a_missing_folder_names_the_command(tmp_path):
    with pytest.raises(StoreError, match=r"airtruth fly CAMPAIGN\.toml --out .*nowhere"):
        read_campaign(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("file", "command"),
    [("truth.parquet", "airtruth fly"), ("estimates.parquet", "airtruth identify")],
)
def test_a_missing_or_broken_file_names_the_command_that_makes_it(tmp_path, pieces, file, command):
    folder = synthetic.write_campaign(tmp_path / "c", *pieces[:2])
    content = (folder / file).read_bytes()
    (folder / file).write_bytes(content[: len(content) // 2])
    with pytest.raises(StoreError, match=rf"{file}: not a readable Parquet file .*{command}"):
        read_campaign(folder)
    (folder / file).unlink()
    with pytest.raises(StoreError, match=rf"{file}: missing; `{command}"):
        read_campaign(folder)


def test_missing_columns_are_all_named_with_the_nearest(tmp_path, pieces):
    truth, estimates, _ = pieces
    estimates["Cmq_uper"] = estimates.pop("Cmq_upper")
    del estimates["iterations"]
    with pytest.raises(LogError) as caught:
        read_campaign(synthetic.write_campaign(tmp_path / "c", truth, estimates))
    assert "column 'Cmq_upper' is missing (there is 'Cmq_uper')" in str(caught.value)
    assert "column 'iterations' is missing" in str(caught.value)


def change(columns, name, row, value):
    columns[name] = list(columns[name])
    columns[name][row] = value


def test_truth_problems(tmp_path, pieces):
    truth, estimates, _ = pieces
    for column, row, value, message in (
        ("status", 1, "fine", "status 'fine' of run 'r00001'; .*allowed: failed, ok"),
        ("run_id", 1, "r00000", "run 'r00000' listed more than once"),
        ("Cmq", 3, np.nan, "run 'r00003' flew, but the truth is not a finite number"),
    ):
        bad = {name: list(values) for name, values in truth.items()}
        change(bad, column, row, value)
        with pytest.raises(LogError, match=message):
            read_campaign(synthetic.write_campaign(tmp_path / column, bad, estimates))
    none = {**truth, "status": ["failed"] * 6}
    with pytest.raises(LogError, match="none of the 6 runs flew"):
        read_campaign(synthetic.write_campaign(tmp_path / "none", none, estimates))
    with pytest.raises(LogError, match="holds no run"):
        read_campaign(
            synthetic.write_campaign(tmp_path / "empty", without(truth, lambda i: False), estimates)
        )


def test_runs_must_match(tmp_path, pieces):
    truth, estimates, _ = pieces
    foreign = {name: list(values) for name, values in estimates.items()}
    change(foreign, "run_id", 0, "all")
    with pytest.raises(LogError, match=r"run 'all' not in truth\.parquet.*no --joint"):
        read_campaign(synthetic.write_campaign(tmp_path / "foreign", truth, foreign))

    gone = without(estimates, lambda i: i not in (1, 2))
    with pytest.raises(LogError, match=r"'ls': runs 'r00001', 'r00003' flew .* has no estimate"):
        read_campaign(synthetic.write_campaign(tmp_path / "gone", truth, gone))

    twice = {name: [*values, values[0]] for name, values in estimates.items()}
    with pytest.raises(LogError, match="'ls': run 'r00000' has more than one estimate"):
        read_campaign(synthetic.write_campaign(tmp_path / "twice", truth, twice))

    grounded = {**truth, "status": ["failed", *truth["status"][1:]]}
    with pytest.raises(LogError, match=r"'ls': run 'r00000' did not fly .* but has an estimate"):
        read_campaign(synthetic.write_campaign(tmp_path / "grounded", grounded, estimates))

    with pytest.raises(LogError, match="holds no estimate"):
        read_campaign(synthetic.write_campaign(tmp_path / "e", truth, without(estimates, lambda i: False)))


def test_many_wrong_runs_are_summed_up(tmp_path):
    values = synthetic.draw_paper("table1", ("ls",), 40, seed=1)
    truth = synthetic.truth_columns(40)
    few = without(synthetic.estimate_columns(values), lambda i: i < 10)
    with pytest.raises(LogError, match="runs 'r00010', 'r00011', 'r00012' and 27 more flew"):
        read_campaign(synthetic.write_campaign(tmp_path / "c", truth, few))


def test_a_campaign_in_parts_is_that_of_the_whole(tmp_path, monkeypatch):
    """Parts of seven runs in files whose row groups have ten rows; some runs failed, others did not converge."""
    monkeypatch.setattr(stored_campaign, "RUNS_PER_PART", 7)
    failed = (2, 13, 14, 39)
    values = synthetic.draw_paper("table1", ("ls", "iv-lowpass"), 40, seed=1)
    truth = synthetic.truth_columns(40, failed=failed)
    estimates = synthetic.estimate_columns(values, failed=failed, status={("ls", 4): "maximum iterations"})
    order = np.lexsort(
        (np.arange(len(estimates["run_id"])), estimates["run_id"])
    )  # run by run, as identify writes
    folder = synthetic.write_campaign(
        tmp_path / "c", truth, {name: [column[i] for i in order] for name, column in estimates.items()}
    )
    opened, whole = stored_campaign.open_campaign(folder), read_campaign(folder)
    assert isinstance(opened, stored_campaign.StoredCampaign)
    parts = list(opened.parts())
    assert [part.runs for part in parts] == [7, 7, 7, 7, 7, 5]
    assert (opened.runs, opened.methods) == (40, whole.methods)
    assert sum((part.run_ids for part in parts), ()) == whole.run_ids
    for method in whole.methods:
        for name in ("truth", "flown", "values", "lower", "upper", "converged", "iterations"):
            joined = np.concatenate([getattr(part.sample(method), name) for part in parts])
            np.testing.assert_array_equal(joined, getattr(whole.sample(method), name))
        assert sum((part.sample(method).status for part in parts), ()) == whole.sample(method).status


def test_estimates_in_another_order_are_read_as_a_whole(tmp_path, pieces):
    truth, estimates, _ = pieces  # method by method
    folder = synthetic.write_campaign(tmp_path / "c", truth, estimates)
    opened = stored_campaign.open_campaign(folder)
    assert isinstance(opened, FlownCampaign)
    assert opened.run_ids == tuple(synthetic.run_names(6))
