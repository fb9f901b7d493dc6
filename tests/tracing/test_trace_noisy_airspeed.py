"""Records whose airspeed has the noise of a small aircraft's pitot: 0.5 m/s at 43 m/s, 16 times that of the GTM."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth.logs.store import read_log
from airtruth.tracing import TraceOptions, trace

DATA = Path(__file__).resolve().parents[2] / "data" / "undeclared"
NOISE_M_S = 0.5


def noisy(name, seed):
    log = read_log(DATA / f"{name}.parquet")
    speed = log.channels["airspeed_m_s"]
    noise = NOISE_M_S * np.random.default_rng(seed).standard_normal(speed.size)
    return replace(log, channels={**log.channels, "airspeed_m_s": speed + noise})


@pytest.mark.slow
def test_noise_of_the_airspeed_is_no_effect():
    """f has no effect. After the low-pass alone, the noise was learned as an increment without reservation."""
    answer = trace(noisy("f", 0), "gtm", TraceOptions()).to_dict()
    assert answer["verdict"] == "none"
    assert answer["declared_model"]["consistent"]


@pytest.mark.slow
def test_an_effect_is_named_beside_it():
    """b has a vane arm of 1.6 m (tests/tracing/undeclared_key.toml)."""
    options = TraceOptions(effects=("vane_arm", "vane_scale", "elevator_delay"))
    answer = trace(noisy("b", 0), "gtm", options).to_dict()
    (effect,) = answer["effects"]
    assert effect["name"] == "vane_arm"
    low, high = effect["parameters"]["x_m"]["ci95"]
    assert low < 1.6 < high
