"""What every test shares: the GTM and its trim at the paper's condition."""

from pathlib import Path

import pytest

from airtruth import aircraft
from airtruth.fly.engine import Condition
from airtruth.fly.trim import trim
from airtruth.units import FT, KT

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def gtm():
    return aircraft.load(ROOT / "aircraft" / "gtm")


@pytest.fixture(scope="session")
def paper_condition():
    """EAS 75 kt, 7000 ft, level (paper, section IV.A)."""
    return Condition(75.0 * KT, 7000.0 * FT)


@pytest.fixture(scope="session")
def paper_trim(gtm, paper_condition):
    return trim(gtm, paper_condition)
