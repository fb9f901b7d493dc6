"""An estimator of another package: `airtruth.methods`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

import airtruth as at
from airtruth.identification import (
    METHODS,
    AircraftConstants,
    Estimates,
    Method,
    Options,
    identify_batch,
    methods,
)
from airtruth.logs.flight_log import Batch


def _halved(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Half of least squares, so that a test can tell the two apart."""
    found = identify_batch(batch, constants, "ls", options)
    return replace(found, method="halved", theta=0.5 * found.theta, covariance=0.25 * found.covariance)


HALVED = Method("halved", "LS / 2", "this test", estimate=_halved)
TWO: Sequence[object] = (HALVED, 3)


def _point(name: str) -> EntryPoint:
    return EntryPoint("own", f"{__name__}:{name}", methods.GROUP)


def test_an_entry_point_adds_an_estimator(monkeypatch: pytest.MonkeyPatch) -> None:
    known = methods.merged(METHODS, [_point("HALVED")])
    assert list(known) == [*METHODS, "halved"]
    monkeypatch.setitem(METHODS, "halved", known["halved"])
    result = at.identify("data/undeclared/b.parquet", "gtm", ["ls", "halved"])
    np.testing.assert_array_equal(result.of("halved").theta, 0.5 * result.of("ls").theta)
    assert "halved" in result.summary()


def test_a_wrong_entry_point_is_refused() -> None:
    with pytest.raises(at.ConfigurationError, match="gives int"):
        methods.merged({}, [_point("TWO")])
    with pytest.raises(at.ConfigurationError, match="exists already"):
        methods.merged({"halved": HALVED}, [_point("HALVED")])
