"""Ten-hertz records of a jet that is flown by hand, with instruments of which nothing is declared."""

import numpy as np
import pytest

from airtruth.physics.expected import EXPECTED
from airtruth.tracing import TraceOptions, trace
from airtruth.units import DEG
from validation import jet_records as jet

TRUTH = dict(
    zip(
        ("CLalpha", "CLq", "CLde", "Cmalpha", "Cmq", "Cmde"),
        (*jet.JET.lift[1:], *jet.JET.moment[1:]),
        strict=True,
    )
)


def answer(tmp_path, **how):
    return trace([jet.flight_log(**how)], jet.declared(tmp_path), TraceOptions()).to_dict()


def test_the_airspeed_of_a_dive_varies_by_a_fifth():
    log = jet.flight_log(1, dive_rad=10.0 * DEG)
    speed = [log.channels["airspeed_m_s"][log.rows(run)] for run in range(jet.RECORDS)]
    varies = [np.ptp(v) / v.mean() for v in speed]
    assert min(varies) > 0.1
    assert max(varies) > 0.18


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "dive_deg"), [(31, 0.0), (42, 10.0)])
def test_nothing_is_named_or_learned_where_nothing_is_missing(tmp_path, seed, dive_deg):
    """Smooth inputs at 10 Hz, and an airspeed that varies by 15 to 20 %; the derivatives are those of the truth."""
    found = answer(tmp_path, seed=seed, dive_rad=dive_deg * DEG)
    assert found["verdict"] == "none"
    for name, true in TRUTH.items():
        error = found["derivatives"]["after"][name] - true
        assert abs(error) < 3.0 * found["derivatives"]["after_std"][name], name


@pytest.mark.slow
def test_lags_of_every_channel_are_no_answer_without_reservation(tmp_path):
    """No derivative has a sign that no aircraft has, and the names are provisional."""
    found = answer(tmp_path, seed=53, late=True)
    assert found["provisional"] or found["verdict"] == "unexplained"
    for name, (sign, _) in EXPECTED["longitudinal"].signs.items():
        after, std = (found["derivatives"][key][name] for key in ("after", "after_std"))
        assert sign * after > -2.0 * std, name
