"""The Levenberg-Marquardt solver on published least-squares problems, and its rules one by one."""

from dataclasses import dataclass

import numpy as np
import pytest

from airtruth.numerics.levenberg_marquardt import SolverStatus, minimise
from airtruth.numerics.levenberg_marquardt_options import Damping, SolverOptions, Stopping
from airtruth.numerics.normal_equations import scaled_inverse, scaled_step

T_MEYER = 45.0 + 5.0 * np.arange(1, 17)
Y_MEYER = np.array(
    [34780, 28610, 23650, 19630, 16370, 13720, 11540, 9744, 8261, 7030, 6005, 5147, 4427, 3820, 3307, 2872]
)


def meyer(x):
    """Problem 10 of J. J. More, B. S. Garbow and K. E. Hillstrom, ACM TOMS 7 (1981) 17-41."""
    model = x[0] * np.exp(x[1] / (T_MEYER + x[2]))
    slope = model / (T_MEYER + x[2])
    return model - Y_MEYER, np.column_stack([model / x[0], slope, -slope * x[1] / (T_MEYER + x[2])])


def rosenbrock(x):
    """Problem 1 there: minimum 0 at (1, 1)."""
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]), np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])


@dataclass
class At:
    cost: float
    gradient: np.ndarray
    jacobian: np.ndarray


class LeastSquares:
    """Half the sum of squares of a function that returns residuals and their Jacobian; counts its evaluations."""

    def __init__(self, function, limits=None):
        self.function, self.limits, self.reused = function, limits, 0

    def evaluate(self, x, index, near):
        found = []
        for row in range(len(index)):
            r, jacobian = self.function(x[row])
            if near is not None:
                self.reused += 1
                jacobian = near[row].jacobian
            found.append(At(0.5 * float(r @ r), jacobian.T @ r, jacobian) if np.isfinite(r).all() else None)
        return found

    def step(self, x, at, damping, index):
        gradient = np.array([a.gradient for a in at])
        information = np.array([a.jacobian.T @ a.jacobian for a in at])
        steps = scaled_step(gradient, information, damping)
        curved = np.einsum("ni,nij,nj->n", steps, information, steps)
        return steps, -(gradient * steps).sum(axis=1) - 0.5 * curved

    def move(self, x, step, index):
        moved = x + step
        return moved if self.limits is None else np.clip(moved, *self.limits)


def test_meyers_problem():
    """Published minimum: sum of squares 87.9458. The valley is narrow: small factors follow it best."""
    damping = Damping(rejected=2.0, poor=2.0, good=1.0 / 3.0)
    options = SolverOptions(500, damping, Stopping(undamped=1e-8))
    found = minimise(LeastSquares(meyer), np.array([[0.02, 4000.0, 250.0]]), options)
    assert found.status == (SolverStatus.CONVERGED,)
    assert 2.0 * found.at[0].cost == pytest.approx(87.9458, abs=1e-4)
    np.testing.assert_allclose(found.x[0], [0.00560964, 6181.35, 345.224], rtol=1e-5)


@pytest.mark.parametrize("reuse", [False, True])
def test_rosenbrocks_valley(reuse):
    options = SolverOptions(300, stopping=Stopping(promised=1e-14), reuse=reuse, stale=1e-2, chords=3 * reuse)
    problems = LeastSquares(rosenbrock)
    found = minimise(problems, np.array([[-1.2, 1.0]]), options)
    assert found.status == (SolverStatus.CONVERGED,)
    np.testing.assert_allclose(found.x[0], 1.0, atol=1e-6)
    assert (problems.reused > 0) == reuse


def test_side_by_side_is_one_by_one():
    """Each problem has a damping, a status and a count of its own."""
    starts = np.array([[-1.2, 1.0], [3.0, -2.0], [0.5, 0.5], [np.nan, 0.0]])
    options = SolverOptions(60, stopping=Stopping(1e-14))
    together = minimise(LeastSquares(rosenbrock), starts, options)
    assert together.status == (*[SolverStatus.CONVERGED] * 3, SolverStatus.FAILED)
    for i in range(3):
        alone = minimise(LeastSquares(rosenbrock), starts[i : i + 1], options)
        np.testing.assert_allclose(alone.x[0], together.x[i], rtol=1e-12)
        assert alone.iterations[0] == together.iterations[i]
    assert together.at[3] is None


def test_a_quadratic_takes_one_undamped_step():
    """Normal equations; the last step of a search is undamped."""
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((8, 3)), rng.standard_normal(8)
    problems = LeastSquares(lambda x: (a @ x - b, a))
    found = minimise(problems, np.zeros((1, 3)), SolverOptions(10, stopping=Stopping(undamped=1e9)))
    np.testing.assert_allclose(found.x[0], np.linalg.lstsq(a, b, rcond=None)[0], rtol=1e-10)
    assert found.iterations == (1,)


def test_bounds_are_those_of_the_caller():
    found = minimise(
        LeastSquares(rosenbrock, (-2.0, 0.5)),
        np.array([[0.0, 0.0]]),
        SolverOptions(50, stopping=Stopping(decrease=1e-12)),
    )
    assert found.x[0, 0] == 0.5


def test_no_step_lowers_the_cost():
    """Steps of the wrong sign: the damping rises to its limit."""

    class Wrong(LeastSquares):
        def step(self, x, at, damping, index):
            steps, promised = super().step(x, at, damping, index)
            return -steps, promised

    found = minimise(Wrong(rosenbrock), np.array([[-1.2, 1.0]]), SolverOptions(100, Damping(most=1e3)))
    assert found.status == (SolverStatus.STALLED,)
    np.testing.assert_array_equal(found.x[0], [-1.2, 1.0])


def test_a_step_that_cannot_be_computed_ends_its_search_alone():
    class Singular(LeastSquares):
        def step(self, x, at, damping, index):
            steps, promised = super().step(x, at, damping, index)
            steps[index == 1] = np.nan
            return steps, promised

    found = minimise(
        Singular(rosenbrock),
        np.array([[-1.2, 1.0], [2.0, 2.0]]),
        SolverOptions(60, stopping=Stopping(decrease=1e-14)),
    )
    assert found.status == (SolverStatus.CONVERGED, SolverStatus.SINGULAR)


def test_a_rival_out_of_reach_ends_a_search():
    options = SolverOptions(100, stopping=Stopping(1e-14), outrun=1e-3)
    found = minimise(LeastSquares(meyer), np.array([[0.02, 4000.0, 250.0]]), options, rival=-1e30)
    assert found.status == (SolverStatus.OUTRUN,)


def test_a_step_with_renewed_derivatives_may_have_a_margin_of_its_own():
    """Every step of a search without reuse has renewed derivatives."""
    options = SolverOptions(100, stopping=Stopping(1e-14), outrun_renewed=1e-3)
    found = minimise(LeastSquares(meyer), np.array([[0.02, 4000.0, 250.0]]), options, rival=-1e30)
    assert found.status == (SolverStatus.OUTRUN,)


@pytest.mark.parametrize("renewed", [False, True])
def test_a_search_that_a_rival_ends_need_not_renew_its_derivatives(renewed):
    """Its end is the same."""
    start = np.array([[0.02, 4000.0, 250.0]])
    near = [At(np.nan, np.empty(0), meyer(start[0])[1])]
    options = SolverOptions(100, reuse=True, outrun=1e-3, renewed_outrun=renewed)
    found = minimise(LeastSquares(meyer), start, options, rival=-1e30, near=near)
    (at,), (x,) = found.at, found.x
    assert found.status == (SolverStatus.OUTRUN,)
    assert np.array_equal(at.jacobian, meyer(x)[1]) == renewed
    assert at.cost == 0.5 * float(meyer(x)[0] @ meyer(x)[0])


def test_derivatives_that_promise_too_much_are_renewed():
    """The slope of exp(x) at its start is that of a far steeper curve at the end: steps with it creep."""

    def exponential(x):
        return np.array([np.exp(x[0]) - 1e-3]), np.array([[np.exp(x[0])]])

    counts = {}
    for creeping in (0.0, 0.5):
        problems = LeastSquares(exponential)
        options = SolverOptions(
            1000, stopping=Stopping(promised=1e-14), reuse=True, stale=1e-6, creeping=creeping
        )
        found = minimise(problems, np.array([[3.0]]), options)
        assert found.x[0, 0] == pytest.approx(np.log(1e-3), abs=1e-3)
        counts[creeping] = problems.reused
    assert counts[0.5] < 0.5 * counts[0.0]


class Line:
    """A linear function that counts how often it is evaluated."""

    def __init__(self):
        rng = np.random.default_rng(2)
        self.a, self.b, self.calls = rng.standard_normal((8, 3)), rng.standard_normal(8), 0
        self.best = np.linalg.lstsq(self.a, self.b, rcond=None)[0]

    def __call__(self, x):
        self.calls += 1
        return self.a @ x - self.b, self.a


NEARBY = SolverOptions(30, stopping=Stopping(promised=1e-12), reuse=True, stale=1e-9)


def test_a_search_may_begin_with_derivatives_from_nearby():
    """Those that are 5 % off lead to the solution, and are renewed before the search ends."""
    line = Line()
    problems = LeastSquares(line)
    near = [At(np.nan, np.empty(0), 1.05 * line.a)]
    found = minimise(problems, np.zeros((1, 3)), NEARBY, near=near)
    assert found.status == (SolverStatus.CONVERGED,)
    np.testing.assert_allclose(found.x[0], line.best, rtol=1e-5)
    assert 0 < problems.reused < line.calls


@pytest.mark.parametrize("at_near", [False, True])
def test_derivatives_at_the_start_itself_need_no_renewal(at_near):
    line = Line()
    problems = LeastSquares(line)
    near = [At(np.nan, np.empty(0), line.a)]
    found = minimise(problems, line.best[None, :], NEARBY, near=near, at_near=at_near)
    assert found.status == (SolverStatus.CONVERGED,)
    assert (line.calls == problems.reused) == at_near


def test_the_damping_follows_the_gain_ratio():
    """Down where the quadratic model is good, up where it is poor; a rejected step restarts it."""
    d = Damping(initial=1.0, least=0.05, poor=3.0, fair=1.0, good=0.1, rejected=10.0, restart=40.0)
    assert [d.after(1.0, r) for r in (0.1, 0.5, 0.9)] == [3.0, 1.0, 0.1]
    assert d.after(0.1, 0.9) == 0.05
    assert d.after(1.0, None) == 40.0
    assert d.after(100.0, None) == 1000.0


def test_scaled_step_and_inverse():
    """Against the unscaled equations (H + damping diag H) step = -g."""
    rng = np.random.default_rng(2)
    root = rng.standard_normal((4, 6, 3)) * [1.0, 1e3, 1e-4]
    h, g = np.einsum("nki,nkj->nij", root, root), rng.standard_normal((4, 3))
    damping = np.array([0.0, 0.1, 1.0, 10.0])
    steps = scaled_step(g, h, damping)
    for i in range(4):
        expected = -np.linalg.solve(h[i] + damping[i] * np.diag(np.diag(h[i])), g[i])
        np.testing.assert_allclose(steps[i], expected, rtol=1e-9)
        np.testing.assert_allclose(scaled_inverse(h[i], 0.0), np.linalg.inv(h[i]), rtol=1e-9)
