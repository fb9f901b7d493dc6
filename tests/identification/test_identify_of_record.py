"""Constants that records state replace those of the aircraft."""

import json
import subprocess
import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from tiers import sampled

from airtruth import aircraft
from airtruth.errors import ConfigurationError, LogError
from airtruth.identification import identify
from airtruth.identification.likelihood.method import sensor_noise
from airtruth.identification.record_constants import of_run, with_constants
from airtruth.logs.flight_log import batches
from airtruth.logs.store import write_log
from airtruth.physics.composition import cg_transfer
from airtruth.physics.motion import LONGITUDINAL
from validation.linear_flight import GTM, THETA, as_log, fly

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
    plain, found = (by_run(identify(one, GTM, METHODS).to_frame()) for one in (log, own))
    middle = log.run_ids[1]
    for name in LONGITUDINAL.parameters:
        factor = 2.0 if name.startswith("CL") else 3.0
        np.testing.assert_allclose(found.loc[middle, name], factor * plain.loc[middle, name], rtol=1e-9)
    others = [run for run in log.run_ids if run != middle]
    pd.testing.assert_frame_equal(found.loc[others], plain.loc[others])


def test_what_the_aircraft_says_equally_changes_no_byte(log):
    own = stating(log, mass_kg=GTM.mass_kg)
    pd.testing.assert_frame_equal(
        identify(own, GTM, METHODS).to_frame(), identify(log, GTM, METHODS).to_frame()
    )


def test_order_of_runs_and_rates_is_kept(log):
    mixed = as_log(fly(runs=2), fly(runs=2, rate_hz=100))
    own = replace(mixed, metadata={"record_constants": {mixed.run_ids[0]: {"mass_kg": 30.0}}})
    assert identify(own, GTM, ["ls"]).run_ids == mixed.run_ids
    assert sorted(len(b.run_ids) for b in (p.batch for p in with_constants(own, GTM))) == [1, 1, 2]


def test_sensors_of_an_aircraft_are_kept():
    gtm = aircraft.load("gtm")
    batch = next(batches(as_log(fly())))
    own = of_run(gtm, {"record_constants": {"a": {"mass_kg": 30.0}}}, "a")
    assert (own.mass_kg, own.chord_m) == (30.0, gtm.chord_m)
    np.testing.assert_array_equal(sensor_noise(batch, own), sensor_noise(batch, gtm))


def test_joint_takes_what_all_runs_state_and_refuses_other_reference_lengths(log):
    every = {run: {"mass_kg": 2.0 * GTM.mass_kg} for run in log.run_ids}
    together = identify(
        replace(log, metadata={"record_constants": every}), GTM, ["ls"], joint=True
    ).to_frame()
    plain = identify(log, GTM, ["ls"], joint=True).to_frame()
    np.testing.assert_allclose(together["CLalpha"], 2.0 * plain["CLalpha"], rtol=1e-9)
    np.testing.assert_allclose(together["Cmde"], plain["Cmde"], rtol=1e-12)
    with pytest.raises(ConfigurationError, match=r"--joint: chord_m is 0\.27898 in run .* and 0.3 in run"):
        identify(stating(log, chord_m=0.3), GTM, ["ls"], joint=True)
    with pytest.raises(ConfigurationError, match=r"--joint: run .* states no cg_mac and others do"):
        identify(stating(log, cg_mac=0.3), GTM, ["ls"], joint=True)


BURN = {"one": (1.0, 1.0, 0.25), "two": (0.9, 0.96, 0.27), "three": (0.8, 0.9, 0.29)}
"""Run -> mass and inertia over those of the aircraft, and centre of gravity, as fuel is burnt."""
JOINT = ["ls", "iv-f1", "iv-refined", "frequency", "output-error"]


def burnt(cg, **flight):
    """Records of one aircraft with a mass, an inertia and (if ``cg``) a centre of gravity of their own."""
    parts, facts = [], {}
    for number, (run, (mass, inertia, at)) in enumerate(BURN.items()):
        theta = cg_transfer(at - 0.27) @ THETA if cg else THETA.copy()
        theta[:3] /= mass
        theta[3:] /= inertia
        part = fly(theta=theta, seed=10 + number, **flight)
        parts.append(replace(part, run_ids=(run,)))
        run = f"b{number}-{run}"  # the name that as_log gives
        facts[run] = {"mass_kg": mass * GTM.mass_kg, "inertia_yy_kg_m2": inertia * GTM.inertia_yy_kg_m2}
        facts[run] |= {"cg_mac": at} if cg else {}
    return replace(as_log(*parts), metadata={"record_constants": facts})


@pytest.mark.parametrize(("method", "cg"), sampled(product(JOINT, (False, True)), 3))
def test_joint_estimates_of_records_that_burn_fuel(method, cg):
    """Without noise the joint estimate has the error of the single records, which discretisation makes."""
    log = burnt(cg, noise=0.02)
    made = identify(log, GTM, [method], joint=True)
    single = identify(as_log(fly(noise=0.02, seed=10)), GTM, [method]).to_frame()
    found, alone = made.to_frame(), single[list(LONGITUDINAL.parameters)].to_numpy(dtype=float)[0]
    assert found["converged"].all()
    values = found[list(LONGITUDINAL.parameters)].to_numpy(dtype=float)[0]
    stds = found[[f"{n}_std" for n in LONGITUDINAL.parameters]].to_numpy(dtype=float)[0]
    allowed = 2.0 * np.abs(alone - THETA) + 4.0 * stds + 0.01 * np.abs(THETA)
    assert (np.abs(values - THETA) < allowed).all()
    assert any("cg_mac 0.2700" in note for note in made.notes) == cg


def test_ignoring_the_fuel_would_be_wrong():
    """The means of the factors are 0.9 and 0.95: CLalpha and Cmde of the aircraft's own mass are off by that."""
    log = replace(burnt(False, noise=0.02), metadata={})
    found = identify(log, GTM, ["ls"], joint=True).to_frame()
    assert found["CLalpha"][0] > 1.05 * THETA[0]


@pytest.mark.slow
def test_coverage_of_a_joint_estimate_over_centres_of_gravity():
    """z of 60 joint estimates of three records in gusts; each standard deviation within a third."""
    z = []
    for seed in range(60):
        parts, facts = [], {}
        for number, (run, (_, _, at)) in enumerate(BURN.items()):
            theta = cg_transfer(at - 0.27) @ THETA
            part = fly(theta=theta, noise=0.3, gust=0.3, seed=1000 + 10 * seed + number, duration_s=10.0)
            parts.append(replace(part, run_ids=(run,)))
            facts[f"b{number}-{run}"] = {"cg_mac": at}
        log = replace(as_log(*parts), metadata={"record_constants": facts})
        row = identify(log, GTM, ["iv-f1"], joint=True, force=True).to_frame().iloc[0]
        z.append(
            [(row[n] - t) / row[f"{n}_std"] for n, t in zip(LONGITUDINAL.parameters, THETA, strict=True)]
        )
    spread = np.std(z, axis=0)
    assert (spread > 0.67).all()
    assert (spread < 1.5).all()


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"mass": 3.0}, "mass_kg"),
        ({"mass_kg": -3.0}, "must be above 0"),
        ({"mass_kg": "3"}, "must be above 0"),
        ({"mass_kg": float("nan")}, "must be above 0"),
    ],
)
def test_malformed_constants_are_named(log, facts, said):
    with pytest.raises(LogError, match=f"record_constants of run .*{said}"):
        identify(stating(log, **facts), GTM, ["ls"])


def test_files_say_so_once_per_constant(log, tmp_path):
    path = tmp_path / "a.parquet"
    write_log(path, stating(log, mass_kg=30.0, chord_m=GTM.chord_m), dtype="float64")
    (note,) = identify(path, GTM, ["ls"], joint=True).notes
    assert identify(path, GTM, ["ls"]).notes == (note,)
    assert note.startswith("mass_kg of run")
    assert note.endswith("30, not the aircraft's 26.195")


@pytest.mark.slow
def test_the_command_uses_and_says_it(log, tmp_path):
    path = tmp_path / "a.parquet"
    facts = {run: {"inertia_yy_kg_m2": 12.628} for run in log.run_ids}
    write_log(path, replace(log, metadata={"record_constants": facts}), dtype="float64")
    command = [sys.executable, "-m", "airtruth", "identify", path, "--aircraft", "gtm", "--method", "ls"]
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, check=True)
    assert (
        f"inertia_yy_kg_m2 of run '{log.run_ids[0]}' and 2 more as the log states it: 12.628" in done.stderr
    )
    own = identify(log, replace(GTM, inertia_yy_kg_m2=12.628), ["ls"]).to_frame()
    rows = json.loads(done.stdout)
    np.testing.assert_allclose([r["Cmde"] for r in rows], own["Cmde"], rtol=2e-3)  # GTM's S, c are rounded
