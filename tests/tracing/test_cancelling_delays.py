"""Two delays of one surface cancel each other: the search has to find that one of them is enough."""

import pytest

from airtruth import aircraft
from airtruth.tracing import TraceOptions
from airtruth.tracing.run import trace
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import log_of, trial


@pytest.mark.slow
def test_a_late_aileron_is_named_beside_all_candidates(tmp_path):
    """88.5 ms: a delay of 200 ms with a sensor 111 ms late fitted as well, and 30 refits of larger sets found nothing better."""
    hidden = trial("lateral-model", 7500009)
    declared = aircraft.load(lateral_aircraft(tmp_path / "declared"))
    options = TraceOptions(motion="lateral", increments=False)
    answer = trace([log_of(*hidden.flights)], declared, options).answer
    (effect,) = answer.effects
    assert effect.key == "aileron_delay"
    delay = effect.parameters["delay_s"]
    assert abs(delay.value - hidden.effects["aileron_delay"]) < 2.0 * delay.std
    assert delay.value == pytest.approx(0.0885, abs=0.003)
