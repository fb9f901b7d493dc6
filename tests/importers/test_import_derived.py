"""Airspeed from dynamic pressure, and an angle of attack without a vane whose uncertainty the intervals hold."""

import numpy as np
import pytest
from import_flight import flown

from airtruth.errors import LogError
from airtruth.identification import identify
from airtruth.importers import import_log
from airtruth.importers.mapping import MappingFile
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import read_log, write_log
from airtruth.physics.reconstruction import COLUMNS, ReconstructionPriors, reconstruct

DEG = np.pi / 180.0
UNITS = {
    "airspeed_m_s": "m_s", "alpha_rad": "rad", "theta_rad": "rad", "q_rad_s": "rad_s", "ax_m_s2": "m_s2", "az_m_s2": "m_s2",
    "elevator_rad": "rad", "altitude_m": "m", "density_kg_m3": "kg_m3",
}  # fmt: skip


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("flown"), runs=6, duration_s=8.0, gust=0.1)


def mapping(names, **more):
    channels = {n: {"column": n, "unit": UNITS[n]} for n in names if n in UNITS}
    return MappingFile.model_validate(
        {"time": {"column": "t_s", "run": "run_id"}, "channels": channels | more.pop("channels", {}), **more}
    )


def stored(log, folder, **changes):
    frame = log.to_frame().assign(**changes)
    frame.to_parquet(folder / "f.parquet")
    return folder / "f.parquet"


@pytest.mark.slow
def test_dynamic_pressure_gives_the_true_airspeed(log, tmp_path):
    pressure = 0.5 * log.channels["density_kg_m3"] * log.channels["airspeed_m_s"] ** 2
    path = stored(log, tmp_path, qbar=pressure / 47.880259)
    names = [n for n in UNITS if n != "airspeed_m_s"]
    stated = {"dynamic_pressure_pa": {"column": "qbar", "unit": "psf"}}
    made = import_log(path, mapping(names, channels=stated)).log
    np.testing.assert_allclose(made.channels["airspeed_m_s"], log.channels["airspeed_m_s"], rtol=1e-6)
    assert "dynamic_pressure_pa" not in made.channels
    with pytest.raises(LogError, match="needs density_kg_m3 or altitude_m"):
        import_log(
            path,
            mapping([n for n in names if n not in ("density_kg_m3", "altitude_m")], channels=stated),
        )
    path = stored(log, tmp_path, qbar=-pressure)
    with pytest.raises(LogError, match="dynamic_pressure_pa is not positive"):
        import_log(path, mapping(names, channels=stated))


def test_a_mapping_with_two_speeds_or_two_alphas_is_refused():
    with pytest.raises(ValueError, match="keep one of the two"):
        mapping(UNITS, channels={"dynamic_pressure_pa": {"column": "x", "unit": "Pa"}})
    with pytest.raises(ValueError, match="replaces a missing vane"):
        mapping(UNITS, reconstruct={"alpha": True})


def exact_motion(seconds=12.0, dt=0.01):
    """Pitching flight whose alpha, q, az, V and h satisfy the equations exactly: gamma and theta are prescribed."""
    t = np.arange(round(seconds / dt) + 1) * dt
    gamma = 0.05 * np.sin(0.7 * t)
    theta = 0.09 + gamma + 0.04 * np.sin(2.2 * t)
    alpha = theta - gamma
    speed = 45.0 + 1.5 * np.sin(0.3 * t)
    path_rate, speed_rate = 0.05 * 0.7 * np.cos(0.7 * t), 0.45 * np.cos(0.3 * t)
    along = speed_rate + 9.80665 * np.sin(gamma)  # specific force along the path, and towards its inside
    across = speed * path_rate + 9.80665 * np.cos(gamma)
    fine = np.arange((len(t) - 1) * 20 + 1) * dt / 20
    climb = (45.0 + 1.5 * np.sin(0.3 * fine)) * np.sin(0.05 * np.sin(0.7 * fine))
    height = np.concatenate([[0.0], np.cumsum(0.5 * (climb[1:] + climb[:-1]) * dt / 20)])[::20]
    return {
        "airspeed_m_s": speed,
        "alpha_rad": alpha,
        "theta_rad": theta,
        "q_rad_s": path_rate + 0.04 * 2.2 * np.cos(2.2 * t),
        "az_m_s2": along * np.sin(alpha) - across * np.cos(alpha),
        "ax_m_s2": along * np.cos(alpha) + across * np.sin(alpha),
        "altitude_m": 1000.0 + height,
    }


def test_exact_motion_is_reconstructed():
    """A motion written by hand satisfies the equations; errors are those of the quadrature."""
    c = exact_motion()
    force = c["az_m_s2"] * np.cos(c["alpha_rad"]) - c["ax_m_s2"] * np.sin(c["alpha_rad"])
    gamma = c["theta_rad"] - c["alpha_rad"]
    rate = -(force + 9.80665 * np.cos(gamma)) / c["airspeed_m_s"]
    np.testing.assert_allclose(rate, np.gradient(gamma, 0.01, edge_order=2), atol=2e-5)
    made = reconstruct(c, 0.01, ReconstructionPriors(0.1, 0.003, 0.02))
    np.testing.assert_allclose(made.alpha_rad, c["alpha_rad"], atol=2e-5)


@pytest.mark.slow
def test_errors_of_instruments_stay_within_the_directions():
    """A bias of az and of q, and a wrong airspeed: the error of alpha over its stated deviation, 60 draws."""
    ratios, rng = [], np.random.default_rng(3)
    for _ in range(60):
        c = exact_motion()
        truth = c.pop("alpha_rad")
        c["az_m_s2"] = c["az_m_s2"] + 0.1 * rng.normal() + 0.02 * rng.normal(size=len(truth))
        c["q_rad_s"] = c["q_rad_s"] + 0.003 * rng.normal()
        c["airspeed_m_s"] = c["airspeed_m_s"] * (1.0 + 0.02 * rng.normal())
        c["altitude_m"] = c["altitude_m"] + 0.3 * rng.normal(size=len(truth))
        c["theta_rad"] = c["theta_rad"] + 0.002 * rng.normal(size=len(truth))
        made = reconstruct(c, 0.01, ReconstructionPriors(0.1, 0.003, 0.02))
        error = made.alpha_rad - truth
        at = [100, 600, 1100]
        change = error[at] - error.mean()
        centred = made.directions_rad - made.directions_rad.mean(axis=1, keepdims=True)
        ratios.append(change / np.sqrt((centred[:, at] ** 2).sum(axis=0)))
    spread = np.std(ratios, axis=0)
    assert (spread > 0.6).all()
    assert (spread < 1.3).all()


@pytest.mark.slow
def test_a_log_without_a_vane_is_imported_and_identified_with_wider_intervals(log, gtm, tmp_path):
    path = stored(log, tmp_path)
    names = [n for n in UNITS if n != "alpha_rad"]
    with pytest.raises(LogError, match=r"alpha_rad.*\[reconstruct\] alpha = true"):
        import_log(path, mapping(names))
    imported = import_log(path, mapping(names, reconstruct={"alpha": True}))
    assert [f.code for f in imported.faults] == ["reconstructed"]
    assert set(COLUMNS) <= imported.log.channels.keys()
    assert imported.log.metadata["reconstructed"]["alpha_rad"]["drift_std_deg"] > 0.0
    inner = imported.log.channels["alpha_rad"] - imported.log.channels["alpha_rad"].mean()
    true = log.channels["alpha_rad"] - log.channels["alpha_rad"].mean()
    assert np.sqrt(np.mean((inner - true) ** 2)) < 0.3 * DEG
    write_log(tmp_path / "log.parquet", imported.log, dtype="float64")
    made = identify(read_log(tmp_path / "log.parquet"), gtm, ["iv-f1"])
    assert any("no vane was recorded" in note for note in made.notes)
    plain = FlightLog(
        imported.log.metadata, imported.log.run_ids, imported.log.offsets, imported.log.t_s,
        {n: v for n, v in imported.log.channels.items() if n not in COLUMNS},
    )  # fmt: skip
    without = identify(plain, gtm, ["iv-f1"]).to_frame()
    found = made.to_frame()
    assert (found["CLalpha_std"] > without["CLalpha_std"]).all()
    np.testing.assert_array_equal(found["CLalpha"], without["CLalpha"])
    vane = identify(log, gtm, ["iv-f1"]).to_frame()
    distance = (found["CLalpha"] - vane["CLalpha"]).abs()
    both = np.sqrt(found["CLalpha_std"] ** 2 + vane["CLalpha_std"] ** 2)
    assert (distance < 3.0 * both).all()
    joint = identify(imported.log, gtm, ["iv-f1"], joint=True).to_frame()
    narrow = identify(plain, gtm, ["iv-f1"], joint=True).to_frame()
    assert joint["CLalpha_std"][0] > narrow["CLalpha_std"][0]


@pytest.mark.slow
def test_the_reconstruction_names_what_it_lacks(log, tmp_path):
    names = [n for n in UNITS if n not in ("alpha_rad", "az_m_s2")]
    with pytest.raises(LogError, match=r"\[reconstruct\] alpha needs az_m_s2"):
        import_log(stored(log, tmp_path), mapping(names, reconstruct={"alpha": True}))
