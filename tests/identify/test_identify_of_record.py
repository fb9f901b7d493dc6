"""Constants that records state for themselves count in place of the aircraft's."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from linear_flight import GTM, as_log, fly

from airtruth import aircraft
from airtruth.errors import ConfigurationError, LogError
from airtruth.identify import identify_files, identify_log
from airtruth.identify.filter_method import sensor_noise
from airtruth.identify.of_record import of_run, with_constants
from airtruth.logs.flight_log import batches
from airtruth.logs.store import write_log
from airtruth.physics.short_period import PARAMETERS

METHODS = ["ls", "iv-f1", "frequency"]


@pytest.fixture(scope="module")
def log():
    return as_log(fly(runs=3, noise=1.0))


def stating(log, **facts):
    """The log, its middle run with facts of its own."""
    return replace(log, metadata={"record_constants": {log.run_ids[1]: facts}})


def by_run(table):
    return table.set_index(["run_id", "method"])


def test_a_run_is_identified_with_what_it_states_and_the_others_with_the_aircraft(log):
    """CL goes with the mass and Cm with the inertia, exactly: 1/m and 1/Iyy stand before all of them."""
    own = stating(log, mass_kg=2.0 * GTM.mass_kg, inertia_yy_kg_m2=3.0 * GTM.inertia_yy_kg_m2)
    plain, found = (by_run(identify_log(one, GTM, METHODS)) for one in (log, own))
    middle = log.run_ids[1]
    for name in PARAMETERS:
        factor = 2.0 if name.startswith("CL") else 3.0
        np.testing.assert_allclose(found.loc[middle, name], factor * plain.loc[middle, name], rtol=1e-9)
    others = [run for run in log.run_ids if run != middle]
    pd.testing.assert_frame_equal(found.loc[others], plain.loc[others])


def test_what_the_aircraft_says_equally_changes_no_byte(log):
    own = stating(log, mass_kg=GTM.mass_kg)
    pd.testing.assert_frame_equal(identify_log(own, GTM, METHODS), identify_log(log, GTM, METHODS))


def test_order_of_runs_and_rates_is_kept(log):
    mixed = as_log(fly(runs=2), fly(runs=2, rate_hz=100))
    own = replace(mixed, metadata={"record_constants": {mixed.run_ids[0]: {"mass_kg": 30.0}}})
    assert identify_log(own, GTM, ["ls"])["run_id"].tolist() == list(mixed.run_ids)
    assert sorted(len(b.run_ids) for b, _ in with_constants(own, GTM)) == [1, 1, 2]


def test_sensors_of_an_aircraft_are_kept():
    gtm = aircraft.load("gtm")
    batch = next(batches(as_log(fly())))
    own = of_run(gtm, {"record_constants": {"a": {"mass_kg": 30.0}}}, "a")
    assert (own.mass_kg, own.chord_m) == (30.0, gtm.chord_m)
    np.testing.assert_array_equal(sensor_noise(batch, own), sensor_noise(batch, gtm))


def test_joint_takes_what_all_runs_state_and_refuses_what_differs(log):
    every = {run: {"mass_kg": 2.0 * GTM.mass_kg} for run in log.run_ids}
    together = identify_log(replace(log, metadata={"record_constants": every}), GTM, ["ls"], joint=True)
    plain = identify_log(log, GTM, ["ls"], joint=True)
    np.testing.assert_allclose(together["CLalpha"], 2.0 * plain["CLalpha"], rtol=1e-9)
    np.testing.assert_allclose(together["Cmde"], plain["Cmde"], rtol=1e-12)
    with pytest.raises(ConfigurationError, match=r"--joint: mass_kg is 26\.195 in run .* and 30 in run"):
        identify_log(stating(log, mass_kg=30.0), GTM, ["ls"], joint=True)


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"mass": 3.0}, "mass_kg"),
        ({"mass_kg": -3.0}, "has to be above 0"),
        ({"mass_kg": "3"}, "has to be above 0"),
        ({"mass_kg": float("nan")}, "has to be above 0"),
    ],
)
def test_malformed_constants_are_named(log, facts, said):
    with pytest.raises(LogError, match=f"record_constants of run .*{said}"):
        identify_log(stating(log, **facts), GTM, ["ls"])


def test_files_say_so_once_per_constant(log, tmp_path):
    path = tmp_path / "a.parquet"
    write_log(path, stating(log, mass_kg=30.0, chord_m=GTM.chord_m), dtype="float64")
    said = []
    for joint in (False, True):
        said.clear()
        if joint:
            with pytest.raises(ConfigurationError):
                identify_files([path], GTM, ["ls"], joint=True, say=said.append)
            continue
        identify_files([path], GTM, ["ls"], say=said.append)
        assert len(said) == 1
        assert said[0].startswith("mass_kg of run")
        assert said[0].endswith("30, not the aircraft's 26.195")


def test_the_command_uses_and_says_it(log, tmp_path):
    path = tmp_path / "a.parquet"
    facts = {run: {"inertia_yy_kg_m2": 12.628} for run in log.run_ids}
    write_log(path, replace(log, metadata={"record_constants": facts}), dtype="float64")
    command = [sys.executable, "-m", "airtruth", "identify", path, "--aircraft", "gtm", "--method", "ls"]
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, check=True)
    assert (
        f"inertia_yy_kg_m2 of run '{log.run_ids[0]}' and 2 more as the log states it: 12.628" in done.stderr
    )
    own = identify_log(log, replace(GTM, inertia_yy_kg_m2=12.628), ["ls"])
    rows = json.loads(done.stdout)
    np.testing.assert_allclose([r["Cmde"] for r in rows], own["Cmde"], rtol=2e-3)  # GTM's S, c are rounded
