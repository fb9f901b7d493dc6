"""`identify` answers the motions that the records excite: estimates, files, JSON and messages of both."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from airtruth import identification
from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.identification import answers, identify, quantities
from airtruth.identification.estimates import estimates_table
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from validation.affine_lateral import GTM, NAMES, THETA, fly, log_of, pitching

LOG = log_of(fly(q=pitching, runs=3, gust=0.4, seed=2))


def test_records_of_the_lateral_surfaces_are_answered_by_the_lateral_motion():
    (one,), notes = answers(LOG, GTM)
    assert (one.motion, one.methods, one.excited, notes) == (LATERAL, ("iv-lowpass",), True, ())
    (one,), _ = answers(LOG, GTM, ["ls"], "longitudinal")
    assert (one.motion, one.methods, one.excited) == (LONGITUDINAL, ("ls",), False)


def test_a_log_of_both_kinds_of_records_is_answered_by_both():
    pitch = log_of(fly(q=pitching, runs=2, degrees=0.0, seed=4), elevator_degrees=2.0)
    pitch = FlightLog(pitch.metadata, ("p0", "p1"), pitch.offsets, pitch.t_s, pitch.channels)
    both = FlightLog.concat([pitch, LOG])
    asked, _ = answers(both, GTM, ["ls", "iv-f2"])
    assert [(a.motion.name, a.methods) for a in asked] == [
        ("longitudinal", ("ls", "iv-f2")),
        ("lateral", ("ls",)),
    ]
    lateral = identify(both, GTM, ["ls"], motion=LATERAL, excited=True)
    assert lateral.run_ids == ("r0", "r1", "r2")
    pd.testing.assert_frame_equal(lateral.to_frame(), identify(LOG, GTM, ["ls"], motion=LATERAL).to_frame())


def test_an_aircraft_without_inertias_names_the_lacking_one():
    with pytest.raises(ConfigurationError, match=r"inertia_xx_kg_m2.*state inertia_xx under \[mass\]"):
        identify(LOG, replace_constant("inertia_xx_kg_m2", 0.0), ["ls"], motion=LATERAL)
    with pytest.raises(ConfigurationError, match="inertia_xz"):
        identify(LOG, replace_constant("inertia_xz_kg_m2", 9.0), ["ls"], motion=LATERAL)


def replace_constant(name, value):
    return type(GTM)(**{**vars(GTM), name: value})


def test_a_log_without_sideslip_bank_and_heading_is_refused():
    names = [n for n in LOG.channels if n not in ("beta_rad", "phi_rad")]
    with pytest.raises(LogError, match="beta_rad, or phi_rad or psi_rad"):
        identify(LOG.select(channels=names), GTM, ["ls"], motion=LATERAL)
    names = [n for n in LOG.channels if n != "rudder_rad"]
    with pytest.raises(LogError, match="lateral motion needs the channel rudder_rad"):
        identify(LOG.select(channels=names), GTM, ["ls"], motion=LATERAL)


def test_methods_of_the_other_motion_are_refused_by_name():
    with pytest.raises(ConfigurationError, match="does not exist for the lateral motion"):
        identify(LOG, GTM, ["iv-f2"], motion=LATERAL)
    with pytest.raises(ConfigurationError, match="motion 'pitch' does not exist"):
        answers(LOG, GTM, None, "pitch")


def test_estimates_have_the_columns_of_the_contract():
    result = identify(LOG, GTM, ["ls", "iv-f1"], motion=LATERAL)
    frame = result.to_frame()
    names = [*NAMES, "dutch_roll_wn_rad_s", "dutch_roll_zeta", "roll_1_s", "spiral_1_s"]
    ends = ("", "_std", "_lower", "_upper")
    expected = [
        "run_id",
        "method",
        "converged",
        "iterations",
        *(n + e for n in names for e in ends),
        "status",
    ]
    assert [c for c in frame.columns if "_corr" not in c][: len(expected)] == expected
    assert frame[frame["converged"]][names].notna().all().all()
    assert any("do not determine CYp" in note for note in result.notes)
    assert "dutch_roll_zeta" in result.summary()
    assert result.settings.to_dict()["motion"] == "lateral"


def test_joint_intervals_are_narrower_and_hold_the_truth():
    made = identify(LOG, GTM, ["ls"], motion=LATERAL, joint=True).of("ls")
    single = identify(LOG, GTM, ["ls"], motion=LATERAL).of("ls")
    q = quantities(made)
    assert (q.std[0] < quantities(single).std.mean(axis=0)).all()
    assert (np.abs(q.value[0, :15] - THETA) < 4.0 * q.std[0, :15]).all()


def test_files_of_both_motions_do_not_mix(tmp_path):
    path = tmp_path / "estimates-lateral.parquet"
    result = identify(LOG, GTM, ["ls"], motion=LATERAL)
    identification.write_estimates(path, result)
    identification.write_estimates(path, identify(LOG, GTM, ["iv-f1"], motion=LATERAL))
    stored = pd.read_parquet(path)
    assert set(stored["method"]) == {"ls", "iv-f1"}
    np.testing.assert_array_equal(
        stored[stored["method"] == "ls"][NAMES].to_numpy(), result.to_frame()[NAMES].to_numpy()
    )
    other = identification.settings_of(GTM, identification.Options(), False)
    with pytest.raises(StoreError, match="of the lateral motion, and these are of the longitudinal motion"):
        identification.require_mergeable(path, ["ls"], other)


def test_a_pickled_estimate_keeps_its_motion():
    made = identify(LOG, GTM, ["ls"], motion=LATERAL).of("ls")
    again = pickle.loads(pickle.dumps(made))
    assert again.motion is LATERAL
    pd.testing.assert_frame_equal(estimates_table(again), estimates_table(made))
    assert replace(made, method="x").motion is LATERAL


def test_results_in_json_are_numbers():
    rows = json.loads("".join(identification.json_of(identify(LOG, GTM, ["ls"], motion=LATERAL).frames())))
    assert [row["run_id"] for row in rows] == ["r0", "r1", "r2"]
    assert isinstance(rows[0]["Cnbeta"], float)
