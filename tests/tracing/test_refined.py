"""Nothing is missing, and the records determine the derivatives better than the declaration does: they are refined."""

import pytest

from airtruth import aircraft as planes
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.resolution import linear_point
from airtruth.simulation.simulator import Condition
from airtruth.tracing import trace
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.text import verdict
from airtruth.units import FT, KT
from validation import undeclared

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("refined")]


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    folder = tmp_path_factory.mktemp("refined")
    return trace("data/undeclared/f.parquet", "gtm", out=folder).answer


def apparent(declared):
    """Derivatives that the trial flew, over the declared mass, inertia and CG (Etkin and Reid, 1996, ch. 2)."""
    body = undeclared.trial("f").body
    flown = {name: declared[name] * (1.0 + body.derivatives[name]) for name in LONGITUDINAL.parameters}
    moved = {f"CL{s}": flown[f"CL{s}"] / body.mass for s in ("alpha", "q", "de")}
    moved |= {
        f"Cm{s}": (flown[f"Cm{s}"] + body.cg * flown[f"CL{s}"]) / body.inertia for s in ("alpha", "q", "de")
    }
    return moved


def test_refined_derivatives_are_those_that_were_flown(refined):
    assert refined.verdict == "none"
    assert set(refined.refined) == set(LONGITUDINAL.parameters)
    truth = apparent(refined.derivatives.declared)
    off = {name: (r.estimate - truth[name]) / r.std for name, r in refined.refined.items()}
    assert sum(x**2 for x in off.values()) < 16.81  # chi-square of six degrees at 1 %
    nearer = [abs(r.estimate - truth[n]) < abs(r.declared - truth[n]) for n, r in refined.refined.items()]
    assert sum(nearer) >= 4


def test_the_updated_aircraft_has_them(refined):
    at = Condition(eas_m_s=75.0 * KT, altitude_m=7000.0 * FT)
    declared, updated = (
        linear_point(planes.load(a), at).derivatives for a in ("gtm", refined.updated_aircraft)
    )
    for i, (name, r) in enumerate(refined.refined.items()):
        assert updated[i] - declared[i] == pytest.approx(r.estimate - r.declared, abs=0.25 * r.std), name


def test_they_survive_the_file(refined):
    assert TraceAnswer.from_dict(refined.to_dict()).refined == refined.refined
    assert "They refine CLalpha" in verdict(refined)
