"""Every verb and function that reads a log passes it through the gate, before anything expensive."""

from __future__ import annotations

import json
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from faults import FAULTS
from lateral_faults import LATERAL_FAULTS
from test_gate_lateral import all_axes
from tiers import sampled

import airtruth as at
from airtruth import cli
from airtruth.errors import LogError
from airtruth.logs.store import read_log, write_log
from airtruth.tracing import run as tracing
from validation.lateral_truth import log_of, record_pair

ROOT = Path(__file__).resolve().parents[2]
UNITS = {
    "alt": "m",
    "air": "m_s",
    "den": "kg_m3",
    "ax_": "m_s2",
    "ay_": "m_s2",
    "az_": "m_s2",
} | dict.fromkeys(("p_r", "q_r", "r_r"), "rad_s")
"""First three letters of a channel -> its unit in a mapping; rad without an entry."""
TIMES = '[time]\ncolumn = "t_s"\nrun = "run_id"\n'
NAMED = ["az sign", "alpha sign", "q sign", "elevator sign", "alpha and q", "alpha in deg", "az partly zero"]
"""Faults of the three reviews that a verb once answered with numbers."""


@pytest.fixture(scope="module")
def log():
    return read_log(ROOT / "data" / "undeclared" / "a.parquet")


@pytest.fixture
def stored(log, tmp_path):
    def write(name):
        path = tmp_path / "bad.parquet"
        return written(FAULTS[name](log), path)

    return write


def written(log, path):
    """The log at a path, and a mapping of its channels beside it."""
    write_log(path, log, dtype="float64")
    rows = (
        f'[channels.{n}]\ncolumn = "{n}"\nunit = "{UNITS.get(n[:3], "rad")}"\n'
        for n in log.channels
        if n != "throttle"
    )
    path.with_name("map.toml").write_text(TIMES + "".join(rows))
    return path


@pytest.fixture
def command(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["airtruth", *map(str, arguments)])
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = end.code
        out, err = capsys.readouterr()
        return code or 0, out, err

    return run


def arguments(verb, path):
    folder = path.parent
    return {
        "identify": ("identify", path, "--aircraft", "gtm", "--method", "ls", "--quiet"),
        "check": ("check", path, "--aircraft", "gtm"),
        "trace": ("trace", path, "--aircraft", "gtm", "--out", folder / "out", "--quiet"),
        "loop": ("loop", path, "--aircraft", "gtm", "--out", folder / "out", "--quiet"),
        "import": ("import", path, "--mapping", folder / "map.toml", "--out", folder / "out.parquet"),
    }[verb]


VERBS = ("identify", "check", "trace", "loop", "import")


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "name"), sampled(product(VERBS, NAMED), 3))
def test_every_verb_refuses_and_names_the_channel(verb, name, stored, command, monkeypatch):
    refused(verb, stored(name), FAULTS[name], command, monkeypatch)


@pytest.fixture(scope="module")
def turning():
    return log_of(*(all_axes(f) for f in record_pair()))


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "name"), sampled(product(VERBS, LATERAL_FAULTS), 40))
def test_every_verb_refuses_a_lateral_fault(verb, name, turning, command, monkeypatch, tmp_path):
    path = written(LATERAL_FAULTS[name](turning), tmp_path / "bad.parquet")
    refused(verb, path, LATERAL_FAULTS[name], command, monkeypatch)


def refused(verb, path, fault, command, monkeypatch):
    """The command ends with one error that names a channel of the fault, and writes nothing.

    A channel that was not recorded is of no use with --force, and the error does not offer it.
    """
    monkeypatch.setattr(tracing, "prepare", lambda *a: pytest.fail("went on behind the gate"))
    code, out, err = command(*arguments(verb, path))
    assert code == 2, (out, err)
    assert "contradicts physics" in err
    assert "--force" in err or ("constant" in fault.codes and "the sensor was not recorded" in err)
    assert any(channel in err for channel in fault.channels)
    assert not path.with_name("out.parquet").exists()
    assert not path.with_name("out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("call", [at.identify, at.check, at.trace])
def test_every_function_refuses(call, log):
    with pytest.raises(LogError, match="q_rad_s: opposite sign in all 6 runs"):
        call(FAULTS["q sign"](log), "gtm")


@pytest.mark.slow
def test_force_continues_and_the_result_records_it(stored, command):
    path = stored("theta sign")
    code, out, _ = command(*arguments("check", path), "--force", "--json")
    assert code == 0
    assert json.loads(out)["forced"][0].startswith("theta_rad: opposite sign in all 6 runs")
    code, _, err = command(*arguments("import", path), "--force")
    assert code == 0
    assert "theta_rad: opposite sign" in err
    forced = read_log(path.parent / "out.parquet").metadata["forced"]
    assert forced[0].startswith("theta_rad: opposite sign in all 6 runs")


def test_the_result_of_check(log):
    from airtruth.result import Result

    result = at.check(log, "gtm")
    assert isinstance(result, Result)
    assert result.to_dict()["run_ids"] == log.run_ids
    assert "gyro_scale" in result.summary()
    assert len(result.to_frame()) == len(result.findings)
    assert np.isfinite(result.to_frame()["estimate"].astype(float)).all()
    assert result._repr_html_().count("<table") == 2
    figure = result.plot()
    names, sets = figure.axes
    assert figure.get_suptitle().split() == result.sentences[0].split()
    assert names.yaxis_inverted()
    shown = result.causes[: len(sets.patches)]
    assert [text.get_text().strip() == "possible" for text in sets.texts] == [c.possible for c in shown]
