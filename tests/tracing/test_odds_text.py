"""The posterior of an answer in words."""

from types import SimpleNamespace

import pytest

from airtruth.tracing.answer import Alternative
from airtruth.tracing.presentation.odds import odds_lines

NOTHING = (Alternative((), 0.97), Alternative(("cg_shift",), 0.03))


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("none", "Posterior of no missing effect: 97 %."),
        (
            "unexplained",
            "Among the sets of the library, none of which explains these records, no missing effect has 97 %.",
        ),
    ],
)
def test_an_unexplained_answer_gives_no_posterior_to_an_aircraft_that_it_refutes(verdict, words):
    answer = SimpleNamespace(effects=(), alternatives=NOTHING, verdict=verdict)
    first, wider = odds_lines(answer)
    assert first == words
    assert wider == "A wider set adds cg_shift: 3 %, 1 to 32 against the simpler one."
