"""What every test shares: the GTM and its trim at the paper's condition."""

import os
from pathlib import Path

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # parallel tests share the processors

from airtruth import aircraft
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.units import FT, KT
from tests.tiers import divide_grids

ROOT = Path(__file__).resolve().parents[1]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Divide the grids before pytest deselects by marker."""
    divide_grids(items)


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
