"""Flights of the GTM's tables in JSBSim: errors of joint estimates and coverage, against the limits of the project."""

import numpy as np
import pytest

from airtruth.aircraft import load
from airtruth.identification import Options, identify_batch
from airtruth.logs.store import read_table
from airtruth.physics.motion import LATERAL
from studies import lateral_flights as study

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("lateral-flights")]

RUNS = 60
MOST_PCT = {
    **dict.fromkeys(("Clbeta", "Clp", "Clda", "Cnbeta", "Cndr"), 2.0),
    **dict.fromkeys(("CYbeta", "CYdr"), 3.0),
    "Cnr": 5.0,
    "Cldr": 7.0,
    "Clr": 10.0,
    **dict.fromkeys(("Cnp", "CYr"), 15.0),
}
"""RMSE of an estimate from four doublets at 3 deg in light turbulence [% of the truth]."""
GTM = load(study.ROOT / "aircraft" / "gtm")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = study.fly("light-3", tmp_path_factory.mktemp("flown"), RUNS, 1)
    truth = read_table(folder / "truth.parquet")[list(LATERAL.parameters)].iloc[0].to_numpy()
    return study.records(folder), truth


@pytest.mark.parametrize("terms", [(), ("alpha", "beta")], ids=["linear", "terms"])
@pytest.mark.parametrize("method", ["ls", "iv-lowpass", "frequency", "filter-error"])
def test_joint_estimates_are_within_the_limits(flown, method, terms):
    own, truth = flown
    error, _ = study.errors(list(study.joint(own, GTM, method, Options(terms=terms), 4)), truth)
    assert len(error) == RUNS // 4
    rmse = dict(zip(LATERAL.parameters, np.sqrt((error**2).mean(axis=0)), strict=True))
    assert not {name: rmse[name] for name, most in MOST_PCT.items() if rmse[name] > most}


def test_a_multisine_gives_the_derivatives_at_the_trim_by_filter_error(tmp_path):
    """It flies at .3 deg below the trim."""
    folder = study.fly("multisine", tmp_path, 16, 1)
    truth = read_table(folder / "truth.parquet")[list(LATERAL.parameters)].iloc[0].to_numpy()
    error, hits = study.errors(
        [identify_batch(one, GTM, "filter-error", motion=LATERAL) for one in study.records(folder)], truth
    )
    rmse = dict(zip(LATERAL.parameters, np.sqrt((error**2).mean(axis=0)), strict=True))
    assert not {name: rmse[name] for name, most in MOST_PCT.items() if rmse[name] > most}
    assert hits.mean() > 0.85


@pytest.mark.parametrize("method", ["ls", "iv-lowpass", "iv-f1", "frequency", "filter-error"])
def test_intervals_with_terms_hold_the_truth(flown, method):
    own, truth = flown
    options = Options(terms=("alpha", "beta"))
    _, hits = study.errors([identify_batch(one, GTM, method, options, LATERAL) for one in own], truth)
    assert hits.mean() > 0.9
