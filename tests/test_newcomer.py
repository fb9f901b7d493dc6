"""Thirty tasks of a new user, without a look into the source.

Each task has a wrong guess, the words of the answer that lead on, and the right way, which the words name.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from tiers import sampled

from airtruth.cli.entry import main
from airtruth.starting import EXAMPLES, copy_example

LOG = "data/undeclared/b.parquet"
CSV = "data/foreign/flight7.csv"
MAP = "data/foreign/flight7.toml"


@dataclass(frozen=True)
class Task:
    """One task: its title, a wrong guess, words of the answer, and the right way.

    ``edits`` are files that the guess needs: name -> (original, text, replacement).
    """

    title: str
    guess: str
    answer: tuple[str, ...]
    right: str
    edits: tuple[tuple[str, str, str, str], ...] = ()


def edited(name: str, original: str, text: str, replacement: str) -> tuple[tuple[str, str, str, str], ...]:
    return ((name, original, text, replacement),)


TASKS = (
    Task("see what there is", "list", ("`airtruth example` does that", "airtruth --help"), "example"),
    Task("get records to play with", "example vain", ("did you mean 'vane'",), "example vane"),
    Task("see the version", "version", ("`airtruth --version` does that",), "--version"),
    Task("start a campaign", "init", ("`airtruth new` does that",), "new campaign --out mine.toml"),
    Task(
        "start a mapping",
        "new maping --out m.toml",
        ("did you mean 'mapping'",),
        f"new mapping {CSV} --out m.toml",
    ),
    Task(
        "start an aircraft",
        "new plane --out mine",
        ("allowed: aircraft, campaign, mapping",),
        "new aircraft --out mine",
    ),
    Task(
        "a campaign of my own aircraft",
        "new campaign --aircraft mine --out mine.toml",
        ("--eas-kt and --altitude-ft",),
        "new campaign --aircraft mine --eas-kt 60 --altitude-ft 3000 --out mine.toml",
    ),
    Task(
        "keep my campaign file",
        "new campaign --out first.toml",
        ("exists and was not written by airtruth", "choose another --out"),
        "new campaign --out second.toml",
    ),
    Task("simulate", "simulate first.toml", ("`airtruth fly` does that",), "fly first.toml --out o --dry-run"),
    Task("say where the logs go", "fly first.toml", ("Missing option '--out'",), "fly first.toml --out o --dry-run"),
    Task(
        "fly without a campaign file",
        "fly missing.toml --out o",
        ("airtruth new campaign --out FILE.toml",),
        "new campaign --out missing.toml",
    ),
    Task(
        "a quantity without its unit",
        "fly wrong.toml --out o",
        ("write duration_s",),
        "fly first.toml --out o --dry-run",
        edited("wrong.toml", "first.toml", "duration_s", "duration"),
    ),
    Task(
        "a misspelt manoeuvre",
        "fly wrong.toml --out o",
        ("did you mean 'doublet'", "multisine"),
        "fly first.toml --out o --dry-run",
        edited("wrong.toml", "first.toml", '"doublet"', '"doublte"'),
    ),
    Task(
        "a misspelt aircraft in a campaign",
        "fly wrong.toml --out o",
        ("did you mean 'gtm'", "a folder that holds aircraft.toml"),
        "fly first.toml --out o --dry-run",
        edited("wrong.toml", "first.toml", 'aircraft = "gtm"', 'aircraft = "gmt"'),
    ),
    Task(
        "fly with a delay that is not declared",
        "fly wrong.toml --out o",
        ("did you mean 'elevator_delay'",),
        "effects elevator_delay",
        edited(
            "wrong.toml",
            "first.toml",
            "[condition]",
            '[[effect]]\nname = "elevator_lag"\ndelay_ms = 60\n[condition]',
        ),
    ),
    Task(
        "use several processors",
        "fly first.toml --out o --jobs all",
        ("Invalid value for '--jobs'",),
        "fly first.toml --out o --jobs 2 --dry-run",
    ),
    Task("predict the accuracy", "predict first.toml", ("`airtruth plan` does that",), "plan --help"),
    Task(
        "identify: which aircraft",
        f"identify {LOG}",
        ("Missing option '--aircraft'",),
        f"identify {LOG} --aircraft gtm --method ls",
    ),
    Task(
        "identify: a misspelt aircraft",
        f"identify {LOG} --aircraft GTM2",
        ("did you mean 'gtm'",),
        f"identify {LOG} --aircraft gtm --method ls",
    ),
    Task(
        "identify: which method",
        f"identify {LOG} --aircraft gtm --method IV",
        ("did you mean 'iv-", "iv-f1", "filter-error"),
        f"identify {LOG} --aircraft gtm --method ls",
    ),
    Task(
        "identify: a choice that does not exist",
        f"identify {LOG} --aircraft gtm --pressure measurd",
        ("is not one of 'method', 'constant', 'measured'",),
        f"identify {LOG} --aircraft gtm --method ls --pressure measured",
    ),
    Task(
        "identify a CSV file",
        f"identify {CSV} --aircraft gtm",
        ("convert another format with `airtruth import`",),
        f"import {CSV} --mapping {MAP} --out f.parquet",
    ),
    Task(
        "import without a mapping",
        f"import {CSV}",
        (f"`airtruth import --guess {CSV}` prints a mapping",),
        f"import --guess {CSV}",
    ),
    Task(
        "import: the sign of the elevator",
        f"import {CSV} --mapping wrong.toml --out f.parquet",
        ("opposite sign", "state sign = -1 under [channels.elevator_rad]"),
        f"import {CSV} --mapping {MAP} --out f.parquet",
        edited("wrong.toml", MAP, 'deg"\nsign = -1', 'deg"'),
    ),
    Task(
        "import: a unit",
        f"import {CSV} --mapping wrong.toml --out f.parquet",
        ("alpha_rad", "use one of rad, deg"),
        f"import {CSV} --mapping {MAP} --out f.parquet",
        edited("wrong.toml", MAP, 'column = "AOA (deg)"\nunit = "deg"', 'column = "AOA (deg)"\nunit = "grad"'),
    ),
    Task(
        "import: a column",
        f"import {CSV} --mapping wrong.toml --out f.parquet",
        ("no column 'AOA deg'", "did you mean 'AOA (deg)'"),
        f"import {CSV} --mapping {MAP} --out f.parquet",
        edited("wrong.toml", MAP, "AOA (deg)", "AOA deg"),
    ),
    Task(
        "check the instruments",
        f"validate {LOG}",
        ("`airtruth check` does that",),
        f"check {LOG} --aircraft gtm --run r1",
    ),
    Task(
        "trace for one cause",
        f"trace {LOG} --aircraft gtm --effect delay --out t",
        ("did you mean", "'elevator_delay'"),
        "effects elevator_delay",
    ),
    Task(
        "hold out a record",
        f"trace {LOG} --aircraft gtm --hold-out r9 --out t",
        ("no such run", "allowed: r1, r2, r3"),
        "trace --help",
    ),
    Task("what a cause means", "effects tail", ("did you mean 'tail_effectiveness'",), "effects tail_effectiveness"),
    Task(
        "report before there is a result",
        "report data --out r.html",
        ("nothing to report", "`airtruth trace ... --out data`", "airtruth identify"),
        "report --help",
    ),
    Task(
        "name the page",
        "report data --out page",
        ("name it page.html",),
        "report --help",
    ),
    Task(
        "give an aircraft by a wrong file",
        f"check {LOG} --aircraft first.toml",
        ("give a folder that holds aircraft.toml",),
        f"identify {LOG} --aircraft gtm --method ls",
    ),
    Task(
        "complete a file in an editor",
        "schema campain",
        ("is not one of 'campaign', 'aircraft', 'mapping'",),
        "schema campaign",
    ),
)  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the examples and a campaign that the user wrote."""
    from airtruth.starting import campaign_text

    for name in ("vane", "csv"):
        copy_example(name, tmp_path)
    (tmp_path / "first.toml").write_text(campaign_text("first"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(line: str, monkeypatch, capsys) -> tuple[int, str]:
    """Exit code and all that the command printed."""
    monkeypatch.setattr(sys, "argv", ["airtruth", *line.split()])
    with pytest.raises(SystemExit) as ended:
        main()
    printed = capsys.readouterr()
    return int(ended.value.code or 0), printed.out + printed.err


def test_there_are_thirty_tasks_of_all_kinds():
    assert len(TASKS) >= 30
    assert len({task.title for task in TASKS}) == len(TASKS)
    assert {"vane", "csv"} <= set(EXAMPLES)


@pytest.mark.parametrize("task", sampled(TASKS, 3), ids=lambda task: task.title.replace(" ", "-"))
def test_a_wrong_guess_names_the_right_way(task, folder, monkeypatch, capsys):
    for name, original, text, replacement in task.edits:
        content = (folder / original).read_text(encoding="utf-8")
        assert text in content
        (folder / name).write_text(content.replace(text, replacement), encoding="utf-8")
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    code, printed = run(task.guess, monkeypatch, capsys)
    assert code == 2
    words = " ".join(printed.split())
    for part in task.answer:
        assert part in words
    assert "Traceback" not in printed
    assert {p: p.read_bytes() for p in before} == before
    code, printed = run(task.right, monkeypatch, capsys)
    assert code == 0, printed


def test_a_failure_leaves_no_report(folder):
    assert not list(Path(folder).glob("airtruth-failure-*"))
