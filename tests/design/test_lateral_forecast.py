"""Standard errors to expect of the lateral derivatives, against the information of the whole record at once."""

import json

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from typer.testing import CliRunner

from airtruth import cli
from airtruth.aircraft import load
from airtruth.design import DerivativeQuestion, forecast
from airtruth.design.lateral_information import LateralExperiment
from airtruth.errors import ConfigurationError
from airtruth.physics import lateral_gusts
from airtruth.physics.lateral import lateral_scale, lateral_system
from airtruth.physics.motion import LATERAL
from airtruth.simulation.campaign import plan
from airtruth.starting.examples import data_root

Array = NDArray[np.float64]

CAMPAIGNS = data_root() / "campaigns"
# GTM at 75 kt EAS, 7000 ft: derivatives from an independent six-degree-of-freedom integration of NASA's tables
THETA = np.array(
    [
        *(-1.0158, 0.063, 0.8565, -0.0157, 0.3406),
        *(-0.1403, -0.3352, 0.1472, -0.0718, 0.0266),
        *(0.2185, -0.0528, -0.3897, -0.0035, -0.1700),
    ]
)
V, RHO, ALPHA = 42.85, 0.9931, 0.0972
SIGMA_V, LENGTH_V = 0.8118, 840.4
NOISE = {"beta_rad": 5.8e-4, "p_rad_s": 9.1e-3, "r_rad_s": 5.8e-3, "phi_rad": 8.7e-4, "ay_m_s2": 0.064}
DT, SAMPLES, FINE = 0.02, 41, 10


def surfaces(t: Array) -> Array:
    """(samples, 2) smooth aileron and rudder [rad]."""
    window = np.sin(np.pi * t / (DT * (SAMPLES - 1))) ** 2
    return np.stack([0.06 * window * np.sin(9.0 * t), 0.05 * window * np.cos(6.0 * t)], axis=1)


@pytest.fixture(scope="module")
def gtm():
    return load("gtm")


def moments_of(gtm, levels: Array, theta: Array) -> tuple[Array, Array]:
    """Mean and covariance of all readings of a record that starts at the trim in a stationary gust.

    Dense: motion and gust at a tenth of a sample, by the matrix exponential and by the gust's discrete model.
    """
    s = lateral_scale(gtm.constants, V, RHO, ALPHA, ALPHA)
    system = lateral_system(theta, s)
    sigma_v, *noise = levels
    h = DT / FINE
    t = h * np.arange(FINE * (SAMPLES - 1) + 1)
    # inputs: surfaces, and the sideslip of the gust, which acts through the aerodynamics alone
    by_gust = (system.a[:, 0] - lateral_system(0.0 * theta, s).a[:, 0])[:, None]
    block = np.zeros((10, 10))
    block[:4, :4], block[:4, 4:7], block[4:7, 7:] = system.a, np.hstack([system.b, by_gust]), np.eye(3)
    e = expm(block * h)
    phi, early, late = e[:4, :4], e[:4, 4:7] - e[:4, 7:] / h, e[:4, 7:] / h
    gust = lateral_gusts.discretise(lateral_gusts.LateralDryden(sigma_v, 1.0, LENGTH_V, 1.0, V), h)
    k = gust.phi.shape[0]
    # first column: the mean by the surfaces; the others: the response to each draw of the gust
    g, x = np.zeros((k, 1 + k * len(t))), np.zeros((4, 1 + k * len(t)))
    before, states, inputs = np.zeros((3, g.shape[1])), [], []
    for i, moved in enumerate(surfaces(t)):
        g = gust.phi @ g
        g[:, 1 + k * i : 1 + k * (i + 1)] = gust.gamma if i else gust.start
        now = np.zeros_like(before)
        now[:2, 0], now[2] = moved, gust.output[0] @ g / V
        x = phi @ x + early @ before + late @ now if i else x
        before = now
        if i % FINE == 0:
            states.append(x)
            inputs.append(now)
    c_gust = (system.c[:, 0] - np.eye(5, 4)[:, 0])[:, None]  # of ay
    c_gust[0] = 1.0  # the vane
    through = np.hstack([system.d, c_gust])
    y = np.concatenate([system.c @ x + through @ now for x, now in zip(states, inputs, strict=True)])
    covariance = y[:, 1:] @ y[:, 1:].T + np.diag(np.tile(np.square(noise), SAMPLES))
    return y[:, 0], covariance


@pytest.mark.slow
def test_the_bound_is_the_information_of_the_whole_record(gtm):
    """F = mu_i' S^-1 mu_j + 1/2 tr(S^-1 S_i S^-1 S_j) over all readings of a record, by central differences."""
    levels = np.array([SIGMA_V, *NOISE.values()])
    truth = np.concatenate([THETA, np.log(levels)])

    def at(z: Array) -> tuple[Array, Array]:
        return moments_of(gtm, np.exp(z[15:]), z[:15])

    steps = np.full(truth.size, 1e-4)
    sides = [[at(truth + sign * h) for sign in (1.0, -1.0)] for h in np.diag(steps)]
    d_mean = [(up[0] - down[0]) / 2e-4 for up, down in sides]
    d_cov = [(up[1] - down[1]) / 2e-4 for up, down in sides]
    _, cov = at(truth)
    # biases of the outputs, and the initial state
    system = lateral_system(THETA, lateral_scale(gtm.constants, V, RHO, ALPHA, ALPHA))
    start = np.concatenate([system.c @ expm(system.a * DT * i) for i in range(SAMPLES)])
    unknown = [*np.tile(np.eye(5), (SAMPLES, 1)).T, *start.T]
    columns = np.stack([*d_mean, *unknown], axis=1)
    information = columns.T @ np.linalg.solve(cov, columns)
    whitened = [np.linalg.solve(cov, d) for d in d_cov]
    for i, one in enumerate(whitened):
        for j, two in enumerate(whitened):
            information[i, j] += 0.5 * np.sum(one * two.T)
    expected = np.sqrt(np.diag(np.linalg.inv(information))[:15])

    t = DT * np.arange(SAMPLES)
    u, still = surfaces(t), np.zeros(SAMPLES)
    flown = dict.fromkeys(("beta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "phi_rad", "ay_m_s2"), still)
    flown |= {"airspeed_m_s": still + V, "density_kg_m3": still + RHO}
    flown |= {"alpha_rad": still + ALPHA, "theta_rad": still + ALPHA}
    flown |= {"aileron_rad": u[:, 0], "rudder_rad": u[:, 1]}
    experiment = LateralExperiment(gtm, NOISE, SIGMA_V, LENGTH_V, DT, "stationary")
    found = np.sqrt(np.diag(experiment.least_covariance(flown, THETA)))
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.slow
def test_the_bound_of_the_lateral_campaign():
    """Per cent of |truth| of aileron-rudder records of 10 s at 3 deg in light gusts, from an independent prototype (filter-error
    information of the linear model); 3.5 deg here, so 3/3.5 of it."""
    found = forecast(plan.make(CAMPAIGNS / "lateral.toml", runs=2))
    percent = dict(zip(found.parameters, found.percent[0], strict=True))
    prototype = {
        "CYbeta": 1.3,
        "CYr": 12.0,
        "CYdr": 2.5,
        "Clr": 2.2,
        "Cldr": 1.2,
        "Cnp": 6.5,
        "Cnr": 1.6,
        "Cnda": 21.0,
    }
    for name, value in prototype.items():
        assert percent[name] == pytest.approx(value * 3.0 / 3.5, rel=0.15), name
    assert found.motion == "lateral"
    assert set(found.gusts) == {"sigma_v"}
    assert tuple(found.to_frame()["parameter"]) == LATERAL.parameters
    assert "lateral (gtm)" in found.summary()
    assert found.undetermined == ("CYp", "CYda")
    assert "One record does not determine CYp, CYda" in found.summary()
    assert len(found.plot().axes[0].get_xticklabels()) == 15


@pytest.mark.slow
def test_both_motions_of_a_campaign_that_moves_all_controls(tmp_path):
    file = tmp_path / "combined.toml"
    file.write_text((CAMPAIGNS / "combined.toml").read_text().replace("runs = 100", "runs = 1"))

    def said_by(*options: str) -> str:
        ended = CliRunner().invoke(cli.app, ["plan", str(file), "--quiet", *options])
        assert ended.exit_code == 0
        return ended.stdout

    said = json.loads(said_by("--json"))
    assert list(said) == ["longitudinal", "lateral"]
    assert "Cmq" in said["longitudinal"]["parameters"]
    assert "Cnr" in said["lateral"]["parameters"]
    text = said_by()
    assert text.index("Longitudinal motion") < text.index("Cmq") < text.index("Lateral-directional motion")
    assert json.loads(said_by("--json", "--motion", "lateral")) == said["lateral"]


@pytest.mark.parametrize(
    ("campaign", "motion", "message"),
    [
        ("light", "lateral", "campaign light moves no aileron and no rudder, so it cannot determine the derivatives of the "
         "lateral-directional motion; add a manoeuvre of the aileron and of the rudder"),
        ("lateral", "longitudinal", "campaign lateral moves no elevator"),
        ("light", "sideways", "motion = 'sideways': .*allowed: lateral, longitudinal"),
    ],
)  # fmt: skip
def test_a_motion_whose_controls_stand_still_is_refused(campaign, motion, message):
    with pytest.raises(ConfigurationError, match=message):
        forecast(plan.make(CAMPAIGNS / f"{campaign}.toml", runs=1), motion=motion)


def test_derivatives_of_both_motions_are_not_planned_by_one_command():
    with pytest.raises(
        ConfigurationError,
        match="'Cnp' belongs to the lateral-directional motion, and an input determines those of one motion",
    ):
        DerivativeQuestion(("Cmq", "Cnp"))
