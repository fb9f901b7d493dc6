"""Causes of both motions: combination of the sizes, contradiction, and one updated aircraft."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from airtruth import aircraft as planes
from airtruth.aircraft.write import Corrections
from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.terms import Change, DeclaredTerm, SensorTerm
from airtruth.tracing import TraceOptions, joint, trace
from airtruth.tracing.inference.posterior import Priors, prior_cost
from airtruth.tracing.joint import Told, combined, jointly, sentences
from airtruth.tracing.model.parameters import SHORT_PERIOD, Parameters
from airtruth.tracing.update import Revision, write_update
from validation.damage import CASES, flights
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import log_of

MASS = EFFECTS["mass_error"]


@dataclass(frozen=True)
class Stated:
    """A search that names some effects, and what its records tell of the mass."""

    motion: object
    tells: Told
    named: tuple = ()
    repeats: tuple = ()
    steps: list = field(default_factory=list)

    @property
    def case(self):
        layout = SimpleNamespace(motion=self.motion)
        return SimpleNamespace(effects=(MASS,), fitted=SimpleNamespace(layout=layout))

    @property
    def rounds(self):
        return [SimpleNamespace(null=SimpleNamespace(hypothesis=SimpleNamespace(effects=self.named)))]

    def refitted(self, effects):
        return self._with("refitted", effects, tuple(effects.values()))

    def repeated(self, effects, required=()):
        step, named = ("required", tuple(effects.values())) if required else ("repeated", self.repeats)
        return self._with(step, effects, named)

    def _with(self, step, effects, named):
        self.steps.append((step, effects["mass_error"].parameters[0]))
        return replace(self, named=named)


def names(search):
    return {e.key for e in search.named}


@pytest.fixture
def told(monkeypatch):
    monkeypatch.setattr(joint, "told_by", lambda search, key: search.tells)


def test_sizes_combine_by_precision():
    both = combined([Told(0.12, 0.03), Told(0.10, 0.04)])
    assert both.size == pytest.approx((0.12 / 9.0 + 0.10 / 16.0) / (1.0 / 9.0 + 1.0 / 16.0))
    assert both.std == pytest.approx(0.03 * 0.04 / 0.05)


def test_a_prior_contains_what_the_cause_gains_in_the_other_motion():
    """(x - b)^2/(2 s^2) - b^2/(2 s^2): zero without the cause, and at b what the other motion gains."""
    size, std = 0.12, 0.03
    common = np.zeros(SHORT_PERIOD.common.size)
    priors = Priors(np.zeros((common.size, common.size)), np.array([std**-2]), np.array([size * std**-2]), ())

    def cost(x):
        own = np.zeros((0, SHORT_PERIOD.per_record.size))
        return prior_cost(priors, Parameters(common, own, np.array([x])))

    assert cost(0.0) == 0.0
    for x in (-0.1, 0.05, size):
        assert cost(x) == pytest.approx(0.5 * ((x - size) ** 2 - size**2) / std**2)


@pytest.mark.usefixtures("told")
def test_a_cause_that_one_motion_names_is_one_of_both():
    first = Stated(LONGITUDINAL, Told(0.12, 0.03), (MASS,))
    second = Stated(LATERAL, Told(0.10, 0.04))
    pair, (cause,) = jointly([first, second])
    assert not cause.refused
    assert cause.statistic == pytest.approx((0.02 / 0.05) ** 2)
    assert [names(s) for s in pair] == [{"mass_error"}] * 2
    ((refit, own),) = first.steps
    ((begin, other),) = second.steps
    assert (refit, own.prior_mean) == ("refitted", pytest.approx(0.10))
    assert own.prior_std == pytest.approx(0.04)
    assert (begin, other.prior_mean) == ("required", pytest.approx(0.12))
    assert other.prior_std == pytest.approx(0.03)
    (sentence,) = sentences([cause])
    assert "one cause of both motions" in sentence
    assert "1.12 +- 0.03 by the longitudinal records, 1.1 +- 0.04 by the lateral records" in sentence


@pytest.mark.usefixtures("told")
@pytest.mark.parametrize("insists", [True, False])
def test_sizes_that_contradict_each_other_are_not_averaged(insists):
    first = Stated(LONGITUDINAL, Told(0.20, 0.02), (MASS,), (MASS,) if insists else ())
    second = Stated(LATERAL, Told(0.0, 0.02))
    pair, causes = jointly([first, second])
    assert [step for step, _ in first.steps] == ["repeated"]
    assert not second.steps
    assert names(pair[1]) == set()
    if not insists:  # another cause of its motion explains the records of both
        assert names(pair[0]) == set()
        assert not causes
        return
    assert pair[0] is first
    assert causes[0].refused
    (sentence,) = sentences(causes)
    assert "contradict" in sentence
    assert "1.2 +- 0.02" in sentence


@pytest.mark.usefixtures("told")
def test_a_cause_of_one_motion_stays_there():
    fin = EFFECTS["fin_effectiveness"]
    pair = [Stated(LONGITUDINAL, Told(0.0, 1.0)), Stated(LATERAL, Told(0.0, 1.0), (fin,))]
    assert jointly(pair) == (tuple(pair), ())


def revision(motion, change, increment):
    trim = dict.fromkeys((s.name for s in motion.signals), 0.0)
    corrections = Corrections({increment: 0.01}, trim, {increment: 0.002}, motion)
    return Revision(change, {}, corrections, ("mass_error",), (), f"records of {motion.name}", (), True)


def test_one_aircraft_holds_the_changes_of_both_motions(tmp_path):
    gtm = planes.load("gtm")
    heavy = Change(declared=(DeclaredTerm("mass", 1.1),))
    late = Change(sensors=(SensorTerm("beta_rad", "lag", 0.05),))
    both = [revision(LONGITUDINAL, heavy, "Cmalpha"), revision(LATERAL, late, "Cnbeta")]
    folder = write_update(both, gtm, tmp_path)
    updated = planes.load(folder)
    assert updated.constants.mass_kg == pytest.approx(1.1 * gtm.constants.mass_kg)
    assert updated.file.sensors["beta_rad"].errors().lag_s == pytest.approx(0.05)
    for name in ("Cmalpha", "Cnbeta"):
        if name in gtm.file.derivatives:
            moved = updated.file.derivatives[name].value - gtm.file.derivatives[name].value
            assert moved == pytest.approx(0.01)
    text = (tmp_path / "aircraft" / "gtm" / "gtm.xml").read_text()
    assert "records of longitudinal" in text
    assert "records of lateral" in text


@pytest.mark.slow
def test_an_airspeed_error_has_one_size_in_both_motions(tmp_path):
    """An airspeed that reads 8 % high: the motions read the same channel in records of their own."""
    keys = ("mass_error", "cg_shift", "airspeed_scale", "vane_lag", "accelerometer_scale", "gyro_scale")
    log = log_of(*(f.reading("airspeed_m_s", scale=1.08) for f in flights(CASES["none"], 1)))
    result = trace([log], lateral_aircraft(tmp_path / "gtm"), TraceOptions(effects=keys))
    assert [[e.key for e in a.effects] for a in result.answers] == [["airspeed_scale"]] * 2
    found = [a.effects[0].parameters["factor"] for a in result.answers]
    assert found[0] == found[1]
    assert found[0].value == pytest.approx(1.08, abs=3.0 * found[0].std)
