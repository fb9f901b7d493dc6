"""A campaign flown, degraded and exported like a real flight passes through the verbs without hand work.

`python -m studies.real_rows` traces every row with the whole library.
"""

import json

import pytest
from tiers import sampled

from airtruth.logs.sources import named_logs
from airtruth.logs.store import log_paths
from studies.real_rows import ROWS, exported, imported, run, traced


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Row -> its folder of imported logs, made once."""
    made = {}

    def of(name, runs=2):
        if name not in made:
            folder = tmp_path_factory.mktemp(name)
            made[name] = imported(exported(ROWS[name], folder, runs=runs), folder), folder
        return made[name]

    return of


@pytest.mark.parametrize("name", sampled(ROWS, 5))
def test_a_row_is_imported_and_identified(name, logs):
    folder, _ = logs(name)
    joined = [log for _, log in named_logs(folder)]
    runs = [run_id for log in joined for run_id in log.run_ids]
    assert runs == ["tp1", "tp2"]
    rate = 1.0 / (joined[0].t_s[1] - joined[0].t_s[0])
    assert rate == pytest.approx(ROWS[name].log_hz, rel=1e-3)
    assert "density_kg_m3" not in joined[0].channels  # zero throughout, or not recorded
    rows = json.loads(run("identify", folder, "--aircraft", "gtm", "--method", "iv-f1", "--json", "--quiet"))
    assert len(rows) == 2
    assert all(row["converged"] for row in rows)
    assert all(-3.0 < row["Cmalpha"] < -0.8 for row in rows)
    if name == "two":
        (moved,) = joined[0].metadata["alignment"]
        assert moved["offset_s"] == pytest.approx(20.0 - 700.125, abs=0.004)
        assert moved["std_s"] < 0.004


@pytest.mark.long
def test_two_recorders_and_a_slow_vane_end_in_the_right_class(logs):
    folder, place = logs("two")
    assert len(log_paths(folder)) == 2
    wanted = ("vane_lag", "vane_arm", "elevator_delay", "sensor_delay:alpha_rad")
    options = [word for name in wanted for word in ("--effect", name)]
    answer = traced(folder, place, "--model", "linear", *options)
    (effect,) = answer["effects"]
    assert "vane_lag" in (effect["name"], *effect["indistinguishable_from"])
