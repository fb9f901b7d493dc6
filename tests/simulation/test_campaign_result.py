"""The Python entry of a campaign and the result that it returns."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from fly_campaigns import channel, results, write

from airtruth.errors import ConfigurationError, LogError
from airtruth.logs import store
from airtruth.result import Result
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign.result import CampaignResult
from airtruth.simulation.campaign.run import fly

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> CampaignResult:
    """Eight runs; some draw an airspeed at which the GTM cannot be trimmed."""
    folder = tmp_path_factory.mktemp("campaign")
    eas = {"choose": [75.0, 75.0, 75.0, 20.0]}
    path = write(folder / "campaign.toml", condition={"eas_kt": eas, "altitude_ft": 7000.0}, seed=5, runs=8)
    return fly(path, folder / "out")


@pytest.mark.slow
def test_it_is_a_result(flown: CampaignResult) -> None:
    assert isinstance(flown, Result)
    assert "<table" in flown._repr_html_()


@pytest.mark.slow
def test_one_row_per_run_with_its_plan_and_its_end(flown: CampaignResult) -> None:
    frame = flown.to_frame()
    assert list(frame["run_id"]) == [f"small-{k:06d}" for k in range(8)]
    slow = frame["eas_m_s"] < 15.0
    assert 0 < slow.sum() < 4
    np.testing.assert_array_equal(frame["status"] == "failed", slow)
    assert all("cannot be trimmed" in reason for reason in frame["reason"][slow])
    assert [f.run_id for f in flown.failures] == list(frame["run_id"][slow])


def test_summary_and_facts(flown: CampaignResult) -> None:
    failed = len(flown.failures)
    headline, *reasons = flown.summary().splitlines()
    assert headline == f"8 runs in {flown.folder} (8 flown now, {failed} failed)"
    assert len(reasons) == 1
    assert reasons[0].startswith(f"{failed} failed: gtm cannot be trimmed")
    facts = json.loads(json.dumps(flown.to_dict()))
    assert facts["aircraft"] == "gtm"
    assert len(facts["failures"]) == failed


@pytest.mark.slow
def test_a_run_is_drawn_as_it_was_logged(flown: CampaignResult) -> None:
    good = next(o.run_id for o in flown.outcomes if o.status == "ok")
    figure = flown.plot()
    alpha = next(ax for ax in figure.axes if ax.get_ylabel() == "alpha [rad]")
    logs = [store.read_log(p, columns=["alpha_rad"]) for p in store.log_paths(flown.folder)]
    log = next(log for log in logs if good in log.run_ids)
    expected = log.channels["alpha_rad"][log.rows(log.run_ids.index(good))]
    np.testing.assert_array_equal(alpha.lines[0].get_ydata(), expected)
    with pytest.raises(LogError, match="was not flown"):
        flown.plot(flown.failures[0].run_id)


@pytest.mark.long
@pytest.mark.slow
def test_a_file_a_campaign_and_a_plan_fly_the_same(tmp_path: Path) -> None:
    path = write(tmp_path / "campaign.toml")
    by_file = fly(path, tmp_path / "file", seed=4, runs=2)
    parsed = campaign_file.read(path)
    fly(parsed, tmp_path / "parsed", seed=4, runs=2)
    fly(plan.make(path, 4, 2), str(tmp_path / "plan"))
    assert results(tmp_path / "file") == results(tmp_path / "parsed") == results(tmp_path / "plan")
    assert channel(tmp_path / "file", "alpha_rad").shape == (2, 101)
    again = fly(path, tmp_path / "file", seed=4, runs=2)
    assert (by_file.flown_now, again.flown_now, again.runs) == (2, 0, 2)


def test_what_cannot_be_asked_of_it(tmp_path: Path) -> None:
    path = write(tmp_path / "campaign.toml")
    with pytest.raises(ConfigurationError, match="plan already has its seed and runs"):
        fly(plan.make(path), tmp_path / "out", runs=3)
    with pytest.raises(ConfigurationError, match="runs: Input should be greater than or equal to 1"):
        fly(campaign_file.read(path), tmp_path / "out", runs=0)
    assert not (tmp_path / "out").exists()


def test_the_digest_of_a_plan_is_that_of_what_is_read(tmp_path: Path) -> None:
    folder = tmp_path / "gtm"
    shutil.copytree(ROOT / "aircraft" / "gtm", folder)
    file = write(tmp_path / "campaign.toml", aircraft=folder)
    digest = plan.make(file).digest
    (folder / "notes.txt").write_text("unread")
    (folder / "empty.xml").mkdir()
    assert plan.make(file).digest == digest
    assert plan.make(write(tmp_path / "more.toml", aircraft=folder, runs=9)).digest == digest
    model = folder / "aircraft.toml"
    model.write_text(model.read_text() + "\n# a comment\n")
    assert plan.make(file).digest != digest
