"""A small flight log whose numbers are easy to tell apart."""

from __future__ import annotations

import numpy as np
import pytest

from airtruth.channels import SIGNALS
from airtruth.logs.flight_log import FlightLog


@pytest.fixture
def log() -> FlightLog:
    """Three runs of 30, 40 and 30 samples at 50 Hz with every channel of the vocabulary."""
    lengths = (30, 40, 30)
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    rng = np.random.default_rng(3)
    middle = {
        "airspeed_m_s": 42.85,
        "az_m_s2": -9.8,
        "altitude_m": 2133.0,
        "density_kg_m3": 0.9931,
        "throttle": 0.5,
    }
    return FlightLog(
        metadata={"aircraft": "gtm", "sample_rate_hz": 50, "note": {"unknown": ["kept", 1.5]}},
        run_ids=("a", "b", "c"),
        offsets=offsets.astype(np.int64),
        t_s=np.concatenate([np.arange(n) / 50 for n in lengths]),
        channels={name: middle.get(name, 0.0) + 0.01 * rng.standard_normal(100) for name in SIGNALS},
    )
