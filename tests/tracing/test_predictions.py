"""Predictions of sets without a refit, by quadratics that are stated in these tests."""

from types import SimpleNamespace

import pytest

from airtruth.tracing.selection.predictions import Predictions


def quadratic_about(effects, told):
    """An expansion about the fit of some effects, which tells the log-evidence of sets of letters."""
    sets = [SimpleNamespace(key=frozenset(letters), log_evidence=log) for letters, log in told.items()]
    tells = SimpleNamespace(
        sets=lambda most: list(sets), grown=lambda own: [], in_filter=lambda weighed: weighed.key
    )
    return SimpleNamespace(
        effects_of_fit=frozenset(effects),
        last=SimpleNamespace(hypothesis=SimpleNamespace(effects=tuple(effects))),
        quadratic=lambda *arguments: tells,
    )


@pytest.fixture
def predictions():
    """Those of the null, which promises much to all that contains A and B."""
    made = Predictions(SimpleNamespace(problem=None), (), True)
    made.add(
        quadratic_about("", {"": 0.0, "A": 10.0, "B": 10.0, "C": 5.0, "AB": 90.0, "AC": 12.0, "ABC": 100.0})
    )
    return made


def logs(predictions):
    return {"".join(sorted(key)): p.weighed.log_evidence for key, p in predictions.by_effects.items()}


def test_a_refitted_part_predicts_the_sets_that_contain_it(predictions):
    predictions.add_part(quadratic_about("AB", {"AB": 20.0, "ABC": 21.0, "AC": -50.0}))
    told = logs(predictions)
    assert told["ABC"] == 21.0
    assert told["AC"] == 12.0, "it contains no B"
    assert told["AB"] == 90.0, "its own refit tells of it"


def test_a_set_that_the_part_neglects_is_not_predicted(predictions):
    predictions.add_part(quadratic_about("AB", {"AB": 20.0}))
    assert "ABC" not in logs(predictions)


def test_a_fit_that_led_predicts_what_is_nearest_to_it(predictions):
    predictions.add(quadratic_about("AC", {"AC": 40.0, "ABC": 41.0, "C": 30.0, "B": 99.0}))
    assert logs(predictions) == {
        "": 0.0,
        "A": 10.0,
        "B": 10.0,
        "C": 30.0,
        "AB": 90.0,
        "AC": 40.0,
        "ABC": 41.0,
    }


def test_the_part_to_expand_has_more_effects_than_the_fit_that_predicts(predictions):
    at = predictions.by_effects[frozenset("ABC")]
    assert predictions.part_to_add(
        at, [frozenset(), frozenset("A"), frozenset("AB"), frozenset("AD")]
    ) == frozenset("AB")
    predictions.add_part(quadratic_about("AB", {"AB": 20.0, "ABC": 21.0}))
    at = predictions.by_effects[frozenset("ABC")]
    assert predictions.part_to_add(at, [frozenset("A"), frozenset("AB")]) is None


def test_an_exchange_is_left_to_the_fit_that_led(predictions):
    """The quadratic about AD predicts AB, whose part A was refitted: that from A to AB may be the longer way."""
    predictions.add(quadratic_about("AD", {"AD": 95.0, "ABD": 96.0, "ABC": 94.0}))
    at = predictions.by_effects[frozenset("ABD")]
    assert at.expansion.effects_of_fit == frozenset("AD")
    assert predictions.part_to_add(at, [frozenset("A"), frozenset("AB")]) is None
