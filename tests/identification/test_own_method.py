"""An estimator of another package: `airtruth.methods`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

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


def test_a_method_object_is_taken_as_its_name_is() -> None:
    result = at.identify("data/undeclared/b.parquet", "gtm", ["ls", HALVED, METHODS["ls"]])
    assert [one.method for one in result.estimates] == ["ls", "halved"]
    np.testing.assert_array_equal(result.of("halved").theta, 0.5 * result.of("ls").theta)
    assert "halved" in result.summary()


def test_a_regression_of_a_method_object_is_solved() -> None:
    own = replace(METHODS["iv-f1"], name="own")
    for joint in (False, True):
        result = at.identify("data/undeclared/b.parquet", "gtm", ["iv-f1", own], joint=joint)
        np.testing.assert_array_equal(result.of("own").theta, result.of("iv-f1").theta)


def test_a_method_object_of_a_known_name_is_refused() -> None:
    with pytest.raises(at.ConfigurationError, match="'ls' exists already"):
        at.identify("data/undeclared/b.parquet", "gtm", [replace(HALVED, name="ls")])
    with pytest.raises(at.ConfigurationError, match="two methods have the name 'halved'"):
        at.identify("data/undeclared/b.parquet", "gtm", [HALVED, replace(HALVED, title="other")])


def test_the_example_of_the_page_runs() -> None:
    text = Path("docs/methods.md").read_text().split("## An estimator of your own")[1]
    code = text.split("```python\n")[1].split("```")[0]
    scope: dict[str, Any] = {}
    exec(code.replace("out/light", "data/undeclared/b.parquet"), scope)
    assert [one.method for one in scope["result"].estimates] == ["ls", "shrunk"]
    np.testing.assert_array_equal(scope["result"].of("shrunk").theta, 0.9 * scope["result"].of("ls").theta)


def test_a_joint_estimate_needs_its_function() -> None:
    with pytest.raises(at.ConfigurationError, match="halved has no estimate_joint"):
        at.identify("data/undeclared/b.parquet", "gtm", [HALVED], joint=True)


def test_a_wrong_entry_point_is_refused() -> None:
    with pytest.raises(at.ConfigurationError, match="gives int"):
        methods.merged({}, [_point("TWO")])
    with pytest.raises(at.ConfigurationError, match="exists already"):
        methods.merged({"halved": HALVED}, [_point("HALVED")])
