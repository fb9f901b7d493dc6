"""Evidence of sets of effects in a quadratic: against normal densities, integrals and fits, and under changes that keep it."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from hypothesis import given as each
from hypothesis import settings as run
from hypothesis import strategies as st
from scaled_records import ACCELEROMETER, GYRO, VANE, fitted, scaled_problem
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from airtruth.effects.effect import Prior
from airtruth.effects.registry import EFFECTS
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.causes import DERIVATIVES, Cause, DeclaredCauses
from airtruth.tracing.inference.optimise import initial_parameters
from airtruth.tracing.selection.best_first import best_first
from airtruth.tracing.selection.columns import EffectColumn
from airtruth.tracing.selection.evidence import Quadratic
from airtruth.tracing.selection.expansion import expanded
from airtruth.tracing.selection.set_table import SetTable

SAMPLES = 40
WIDE = Prior(0.4, -1e3, 1e3, shape=0.0, log_odds=-2.0)
CAUSES = tuple(
    EffectColumn(cause=Cause(f"c{k}", np.zeros(2), replace(WIDE, std=0.2 * (k + 1)))) for k in range(3)
)


def linear(columns=CAUSES, seed=3, truth=(0.1, -0.2, 0.3, 0.0, 0.0), temper=1.0):
    """Records y = A x + e, e of unit variance, x of two derivatives and the sizes; the quadratic, y and A."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((SAMPLES, 2 + len(columns)))
    y = a @ np.resize(truth, a.shape[1]) + rng.standard_normal(SAMPLES)
    q = Quadratic(0.5 * float(y @ y), -a.T @ y, a.T @ a, np.diag([0.3, 0.5]) ** 2, 2, tuple(columns), temper)
    return q, y, a


def log_density(y, a, covariance):
    """Logarithm of the density of y = A x + e over exp(-y'y/2) with x normal."""
    total = np.eye(len(y)) + a @ covariance @ a.T
    return multivariate_normal(np.zeros(len(y)), total).logpdf(y) + 0.5 * len(y) * np.log(2.0 * np.pi)


def test_the_evidence_of_normal_sizes_is_the_density_of_the_records():
    q, y, a = linear()
    found = [w for w in q.sets(3) if not w.declaration.wrong]
    assert len(found) == 8
    for w in found:
        std = np.array([CAUSES[i].cause.prior.std for i in w.columns])
        rows = [0, 1, *(2 + i for i in w.columns)]
        prior = np.diag([0.3, 0.5, *std]) ** 2
        exact = log_density(y, a[:, rows], prior) + WIDE.log_odds * len(std)
        assert w.log_evidence == pytest.approx(exact, abs=1e-8)


def test_a_wrong_declaration_is_a_wider_prior():
    q, y, a = linear()
    found = [w for w in q.sets(1) if w.declaration.wrong == (1,) and not w.columns]
    assert len(found) == len(CRITERION.wrong_by)
    further = np.exp(CRITERION.log_same_event)
    every = 2.0 * further + further**2  # either of two derivatives, or both
    for w, by in zip(found, CRITERION.wrong_by, strict=True):
        exact = log_density(y, a[:, :2], np.diag([0.3, 0.5 * by]) ** 2)
        assert w.log_evidence == pytest.approx(
            exact + CRITERION.log_wrong + CRITERION.log_same_event - np.log(2.0 * every), abs=1e-8
        )
        assert q.names(w) == (DERIVATIVES,)


def test_the_odds_of_all_wrong_declarations_together_are_those_stated():
    q, _, _ = linear()
    alone = [w.declaration for w in q.sets(1) if w.declaration.wrong and not w.columns]
    assert len(alone) == 3 * len(CRITERION.wrong_by)
    assert sum(np.exp(d.log_odds) for d in alone) == pytest.approx(np.exp(CRITERION.log_wrong), abs=1e-12)


@pytest.mark.parametrize("effect", [VANE, EFFECTS["vane_lag"]], ids=["two-sided", "one-sided"])
def test_the_evidence_of_a_log_uniform_size_is_its_integral(effect):
    """Laplace's method against a quadrature, for a size of thirty standard errors."""
    first = effect.parameters[0]
    size, std = 6.0 * first.material, 0.2 * first.material
    q = Quadratic(
        0.5 * (size / std) ** 2,
        np.array([0.0, -size / std**2]),
        np.diag([1.0, std**-2]),
        np.eye(1),
        1,
        (EffectColumn(effect),),
    )
    low, high = first.material, max(abs(end) for end in first.reach)
    sides = 1.0 if first.one_sided else 2.0

    def density(s):
        return np.exp(-0.5 * ((s - size) / std) ** 2) / (sides * np.log(high / low) * s)

    integral = quad(density, low, min(high, size + 12.0 * std), points=[size], epsabs=0.0)[0]
    without, alone = (
        next(w for w in q.sets(1) if w.columns == c and not w.declaration.wrong) for c in ((), (0,))
    )
    assert alone.sizes == pytest.approx([size])
    expected = np.log(integral) + 0.5 * (size / std) ** 2 + Prior.log_odds
    assert alone.log_evidence - without.log_evidence == pytest.approx(expected, abs=2e-3)


def test_an_effect_of_the_wrong_sign_or_an_immaterial_size_explains_nothing():
    lag = EFFECTS["vane_lag"]
    material = lag.parameters[0].material
    for size in (-5.0 * material, 0.2 * material):
        std = 0.05 * material
        q = Quadratic(
            0.0, np.array([0.0, -size / std**2]), np.diag([1.0, std**-2]), np.eye(1), 1, (EffectColumn(lag),)
        )
        plain = {w.columns: w.log_evidence for w in q.sets(1) if not w.declaration.wrong}
        assert (0,) not in plain or plain[0,] < plain[()]


def test_a_ratio_of_variances_divides_the_likelihood():
    q, _, _ = linear(temper=4.0)
    plain = Quadratic(
        q.offset / 4.0, q.slope / 4.0, q.information / 4.0, q.declared, q.derivatives, q.columns
    )
    ours, theirs = ({w.columns: w.log_evidence for w in x.sets(2)} for x in (q, plain))
    assert ours == pytest.approx(theirs)


@run(max_examples=20, deadline=None)
@each(st.permutations(range(3)), st.integers(0, 50))
def test_the_order_of_the_effects_changes_nothing(order, seed):
    q, _, _ = linear(seed=seed)
    rows = [0, 1, *(2 + i for i in order)]
    other = replace(
        q,
        slope=q.slope[rows],
        information=q.information[np.ix_(rows, rows)],
        columns=tuple(q.columns[i] for i in order),
    )
    ours, theirs = (
        {
            (x.names(w), w.declaration.wrong, float(np.trace(w.declaration.spread))): w.log_evidence
            for w in x.sets(3)
        }
        for x in (q, other)
    )
    shared = ours.keys() & theirs.keys()
    assert len(shared) >= 8
    for key in shared:
        assert ours[key] == pytest.approx(theirs[key], abs=1e-8)


@run(max_examples=20, deadline=None)
@each(st.floats(1e-3, 1e3), st.integers(0, 50))
def test_the_unit_of_a_size_changes_nothing(unit, seed):
    """A log-uniform prior of a size in another unit, with the same limits in that unit."""
    q, _, _ = linear((EffectColumn(VANE),), seed)
    first = VANE.parameters[0]
    scaled = replace(
        first,
        low=first.neutral + unit * (first.low - first.neutral),
        high=first.neutral + unit * (first.high - first.neutral),
        material=unit * first.material,
    )
    turn = np.array([1.0, 1.0, 1.0 / unit])
    other = replace(
        q,
        slope=q.slope * turn,
        information=q.information * np.outer(turn, turn),
        columns=(EffectColumn(replace(VANE, parameters=(scaled,))),),
    )
    ours, theirs = ([w.log_evidence for w in x.sets(1)] for x in (q, other))
    assert ours == pytest.approx(theirs, abs=1e-6)


def test_causes_of_one_event_come_together():
    """Two causes of an event have better odds than two of their own."""
    loading = tuple(EffectColumn(cause=replace(c.cause, event="loading")) for c in CAUSES)
    apart, together = (linear(columns)[0] for columns in (CAUSES, loading))
    ours, theirs = (
        {w.columns: w.log_evidence for w in x.sets(3) if not w.declaration.wrong} for x in (apart, together)
    )
    assert theirs[0, 1] - ours[0, 1] == pytest.approx(1.0)
    assert theirs[0, 1, 2] - ours[0, 1, 2] == pytest.approx(2.0)
    assert theirs[0,] == pytest.approx(ours[0,])


def test_no_set_has_two_variants_of_an_effect_but_delays_of_two_channels():
    delays = [EffectColumn(EFFECTS[f"sensor_delay:{c}"]) for c in ("q_rad_s", "az_m_s2")]
    curves = [EffectColumn(EFFECTS[f"cm_alpha_nonlinear:{v}"]) for v in ("break", "quadratic")]
    assert delays[0].may_join(delays[1])
    assert not curves[0].may_join(curves[1])
    assert not delays[0].may_join(delays[0])


@pytest.fixture(scope="module")
def problem():
    return scaled_problem(1.2, 1.2)


def test_a_quadratic_about_a_fit_has_its_optimum_there(problem):
    """The derivatives and sizes of the fit are those where the quadratic and the declared prior are least together."""
    own = fitted(problem, VANE, GYRO)
    q = expanded(problem, own).quadratic(problem, ())
    common = problem.layout.common
    declared = q.most_probable(np.zeros((6, 6)), own.point.sizes)
    std = own.common_std[common.derivatives]
    assert declared[:6] / std == pytest.approx(own.point.common[common.derivatives] / std, abs=0.1)
    _, slope, information = q.given(np.zeros((6, 6)))
    sizes = -np.linalg.solve(information, slope)
    assert sizes == pytest.approx(own.point.sizes, abs=0.1 * own.size_std(0))
    assert np.linalg.inv(information)[0, 0] == pytest.approx(own.size_std(0) ** 2, rel=1e-3)


def test_the_predicted_point_of_a_set_is_near_its_optimum(problem):
    """From the fit of the wrong effect, one step leads to the sizes of the right two."""
    expansion = expanded(problem, fitted(problem, ACCELEROMETER), (VANE, GYRO))
    at = [e.key for e in expansion.effects].index
    chosen = [at("vane_scale"), at("gyro_scale")]
    point = expansion.point(chosen, np.array([0.2, 0.2]), {0: 0.5})
    assert point.sizes == pytest.approx([0.2, 0.2])
    assert point.common[0] == pytest.approx(0.5)


@pytest.mark.slow
def test_best_first_names_two_effects_that_imitate_another(problem):
    """Vane and gyro read 1.2 of the truth; the order of the effects and of the records, and a record twice, change no name."""
    effects = (ACCELEROMETER, VANE, GYRO, EFFECTS["vane_arm"], EFFECTS["gyro_lag"])
    twice = replace(problem, records=(*problem.records, problem.records[0]))
    turned = replace(problem, records=problem.records[::-1])
    found = []
    for case, library in ((problem, effects), (problem, effects[::-1]), (turned, effects), (twice, effects)):
        start = initial_parameters(case, tr.NOTHING)
        found.append(best_first(SetTable(case), tr.NOTHING, start, library, DeclaredCauses()))
    for one in found:
        assert one.simplest == ("gyro_scale", "vane_scale")
        assert next(iter(one.weights)) == one.simplest
        assert sum(one.weights.values()) == pytest.approx(1.0)
        assert one.refits <= 12
    assert found[1].weights[found[1].simplest] == pytest.approx(found[0].weights[found[0].simplest], abs=0.02)


@pytest.mark.slow
def test_best_first_names_nothing_where_nothing_is_missing():
    case = scaled_problem(1.0, 1.0)
    start = initial_parameters(case, tr.NOTHING)
    found = best_first(SetTable(case), tr.NOTHING, start, (ACCELEROMETER, VANE, GYRO), DeclaredCauses())
    assert found.simplest == ()
    assert found.refits <= 5
