"""Every verb takes logs in every form, and returns a frozen result with text, table, dictionary, figure and page."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import airtruth as at

OPTIONS = {"model": "linear", "effects": ("elevator_delay",)}
VERBS: dict[str, Callable[[Path], at.Result]] = {
    "fly": lambda folder: at.fly(folder / "light.toml", folder / "out" / "light", runs=6),
    "plan": lambda folder: at.plan(folder / "light.toml"),
    "check": lambda folder: at.check(folder / "out" / "light", "gtm"),
    "identify": lambda folder: at.identify(folder / "out" / "light", "gtm", ["ls", "iv-f1"]),
    "trace": lambda folder: at.trace(folder / "out" / "light", "gtm", at.TraceOptions(**OPTIONS)),
    "close_loop": lambda folder: at.close_loop(
        folder / "out" / "light", "gtm", ["ls"], at.TraceOptions(**OPTIONS)
    ),
}
SLOW = ("trace", "close_loop")


@pytest.mark.grid
@pytest.mark.parametrize(
    "verb", [pytest.param(verb, marks=[pytest.mark.slow] * (verb in SLOW)) for verb in VERBS]
)
def test_the_result_of_each_verb_is_frozen_and_shows_itself(
    verb: str, workspace: Path, tmp_path: Path
) -> None:
    result = VERBS[verb](workspace)
    assert isinstance(result, at.Result)
    assert dataclasses.is_dataclass(result)
    name = dataclasses.fields(result)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(result, name, None)
    assert result.summary().strip()
    assert isinstance(result.to_frame(), pd.DataFrame)
    assert len(result.to_frame()) > 0
    assert json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert isinstance(result.plot(), Figure)
    assert "<" in result._repr_html_()
    page, *tables = at.report(result, tmp_path / "page.html")
    assert page.read_text(encoding="utf-8").lstrip().startswith("<!")
    assert all(table.is_file() for table in tables)


@pytest.mark.slow
def test_identify_takes_logs_in_every_form(workspace: Path) -> None:
    folder = workspace / "out" / "light"
    files = sorted((folder / "logs").glob("*.parquet"))
    log = at.read_log(folder)
    aircraft = at.load_aircraft("gtm")
    whole = at.identify(folder, "gtm", ["ls"]).to_frame()
    forms = [str(folder), folder / "logs", files, [str(f) for f in files], log, [log]]
    split = [log.select(run_id) for run_id in log.run_ids]
    for form in [
        *forms,
        split,
        [files[0], *(log.select(r) for r in log.run_ids if r not in _runs(files[0]))],
    ]:
        pd.testing.assert_frame_equal(at.identify(form, aircraft, ["ls"]).to_frame(), whole)


def _runs(path: Path) -> tuple[str, ...]:
    return at.read_log(path).run_ids


@pytest.mark.slow
def test_aircraft_in_every_form(workspace: Path) -> None:
    shipped = at.load_aircraft("gtm")
    for form in (shipped.folder, str(shipped.folder), shipped.folder / "aircraft.toml", shipped):
        assert at.load_aircraft(form).constants == shipped.constants
    with pytest.raises(at.AircraftError, match="did you mean 'gtm'"):
        at.load_aircraft("gtn")
    with pytest.raises(at.AircraftError, match="int is not an aircraft"):
        at.load_aircraft(3)


@pytest.mark.slow
def test_check_joins_logs_and_selects_runs(workspace: Path) -> None:
    log = at.read_log(workspace / "out" / "light")
    some = at.check(log, "gtm", run_ids=log.run_ids[:3])
    assert some.run_ids == log.run_ids[:3]
    again = at.check([log.select(run) for run in log.run_ids[:3]], "gtm")
    assert again.run_ids == some.run_ids
    np.testing.assert_equal(again.residual_rms, some.residual_rms)


@pytest.mark.slow
@pytest.mark.parametrize("verb", [at.identify, at.trace, at.close_loop])
def test_a_missing_log_and_a_wrong_type_are_named(verb: Callable[..., object]) -> None:
    with pytest.raises(at.StoreError, match=r"absent\.parquet: no such file"):
        verb("absent.parquet", "gtm")
    with pytest.raises(at.ConfigurationError, match="DataFrame is not a log"):
        verb(pd.DataFrame(), "gtm")


def test_list_effects_names_the_nearest(workspace: Path) -> None:
    assert len(at.list_effects()) > 20
    with pytest.raises(at.ConfigurationError, match="elevator_delay"):
        at.list_effects("elevator_delays")
