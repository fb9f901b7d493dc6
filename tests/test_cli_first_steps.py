"""The first steps: `new`, `example`, `schema`, completion, --verbose, --log-file, and the time that remains."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import tomllib
from itertools import pairwise
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from airtruth.aircraft import load
from airtruth.cli.completion import complete_aircraft, complete_effect, complete_example
from airtruth.cli.progress import LOOP_STEPS, TRACE_STEPS, Remaining
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError
from airtruth.importers import guess_mapping
from airtruth.reporting.paper.tables import methods_of
from airtruth.schemas import FILES, schema
from airtruth.schemas.generate import NAMES
from airtruth.simulation.campaign.file import Campaign, read
from airtruth.starting import EXAMPLES, aircraft_text, campaign_text, data_root, mapping_text
from airtruth.starting.texts import CONDITIONS
from airtruth.units import KT

ROOT = Path(__file__).resolve().parents[1]
FILES_OF = {
    "campaign": [*sorted((ROOT / "data" / "campaigns").glob("*.toml"))],
    "aircraft": [*sorted((ROOT / "aircraft").glob("*/aircraft.toml"))],
    "mapping": [
        *sorted((ROOT / "data" / "mappings").glob("*.toml")),
        ROOT / "data" / "foreign" / "flight7.toml",
    ],
}
TEMPLATES = {"campaign": campaign_text("x"), "aircraft": aircraft_text("x"), "mapping": mapping_text()}


@pytest.fixture
def airtruth(tmp_path):
    """Run the command line in an empty folder: (arguments) -> exit code, stdout, stderr."""

    def run(*arguments: str, **environment: str) -> tuple[int, str, str]:
        done = subprocess.run(
            [sys.executable, "-m", "airtruth", *arguments],
            cwd=tmp_path,
            env=os.environ | environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout, done.stderr

    return run


@pytest.mark.slow
def test_a_new_campaign_works_as_written(airtruth, tmp_path):
    code, out, _ = airtruth("new", "campaign", "--out", "first test.toml")
    assert code == 0
    assert "airtruth fly 'first test.toml' --out out/first-test" in out
    campaign = read(tmp_path / "first test.toml")
    assert (campaign.name, campaign.aircraft, campaign.runs) == ("first-test", "gtm", 6)
    code, out, err = airtruth("fly", "first test.toml", "--out", "flown", "--dry-run")
    assert (code, err) == (0, "")


@pytest.mark.parametrize("aircraft", CONDITIONS)
def test_a_new_campaign_has_the_condition_of_the_shipped_aircraft(aircraft, tmp_path):
    file = tmp_path / "c.toml"
    file.write_text(campaign_text("c", aircraft))
    eas_kt = CONDITIONS[aircraft][0]
    assert read(file).condition.eas.value == pytest.approx(eas_kt * KT)


@pytest.mark.parametrize("option", ["eas_kt", "altitude_ft"])
@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_a_new_campaign_has_a_finite_condition(option, value):
    with pytest.raises(
        ConfigurationError, match=f"--{option.replace('_', '-')} {value}: state a finite number"
    ):
        campaign_text("c", **{option: value})


@pytest.mark.long
def test_printed_commands_are_quoted(airtruth, tmp_path):
    name = "flight 7;x.csv"
    (tmp_path / name).write_text("t,q\n0,1\n0.02,2\n")
    code, out, _ = airtruth("new", "mapping", name, "--out", "my map.toml")
    assert code == 0
    assert "airtruth import 'flight 7;x.csv' --mapping 'my map.toml' --out 'flight 7;x.parquet'" in out
    code, out, _ = airtruth("new", "aircraft", "--out", "my plane")
    assert (code, "airtruth check LOG.parquet --aircraft 'my plane'" in out) == (0, True)
    code, _, err = airtruth("import", name)
    assert (code, f"`airtruth import --guess '{name}'` prints" in err) == (2, True)
    code, _, err = airtruth("report", "my out", "--out", "r.html")
    assert (code, "--out 'my out/estimates.parquet'`" in err) == (2, True)


def test_a_new_campaign_of_another_aircraft_needs_a_condition(tmp_path):
    with pytest.raises(ConfigurationError, match="--eas-kt and --altitude-ft"):
        campaign_text("c", "mine")
    file = tmp_path / "c.toml"
    file.write_text(campaign_text("c", 'my "own"', 60.0, 3000.0))
    assert read(file).aircraft == 'my "own"'


def test_a_new_aircraft_loads(airtruth, tmp_path):
    assert airtruth("new", "aircraft", "--out", "mine")[0] == 0
    aircraft = load(tmp_path / "mine")
    assert aircraft.name == "mine"
    assert set(aircraft.file.derivatives) == {"CLalpha", "CLq", "CLde", "Cmalpha", "Cmq", "Cmde"}


@pytest.mark.slow
def test_the_file_of_a_new_aircraft_has_one_name(airtruth, tmp_path):
    code, _, err = airtruth("new", "aircraft", "--out", "mine.toml")
    assert (code, "state the folder, for example --out mine" in err) == (2, True)
    assert not list(tmp_path.glob("*.toml"))
    assert airtruth("new", "aircraft", "--out", "mine/aircraft.toml")[0] == 0
    assert (tmp_path / "mine" / "aircraft.toml").is_file()


@pytest.mark.slow
def test_a_new_mapping_imports_the_example(airtruth, tmp_path):
    code, out, _ = airtruth("new", "mapping", "--out", "map.toml")
    assert code == 0
    *_, example, step = (line.strip() for line in out.splitlines())
    assert airtruth(*example.split()[1:])[0] == 0
    code, out, err = airtruth(*step.split()[1:])
    assert (code, err) == (0, "")
    assert (tmp_path / "flight7.parquet").is_file()


@pytest.mark.long
@pytest.mark.slow
def test_a_new_mapping_of_a_file_is_the_guess(airtruth, tmp_path):
    airtruth("example", "csv")
    code, out, _ = airtruth("new", "mapping", "data/foreign/flight7.csv", "--out", "map.toml")
    assert code == 0
    assert (tmp_path / "map.toml").read_text() == guess_mapping(tmp_path / "data/foreign/flight7.csv")
    code, _, err = airtruth(*out.splitlines()[-1].split()[1:])
    assert (code, err) == (0, "")  # the guess turns Nz and the elevator around, as flight7.toml does


@pytest.mark.slow
def test_new_replaces_no_file_of_the_user(airtruth, tmp_path):
    (tmp_path / "c.toml").write_text("# mine\n")
    code, _, err = airtruth("new", "campaign", "--out", "c.toml")
    assert code == 2
    assert "was not written by airtruth" in err
    assert (tmp_path / "c.toml").read_text() == "# mine\n"
    assert airtruth("new", "campaign", "--out", "c.toml", "--force")[0] == 0


@pytest.mark.grid
@pytest.mark.parametrize("kind", FILES)
def test_new_names_the_missing_option(airtruth, kind):
    code, _, err = airtruth("new", kind)
    assert code == 2
    assert "--out" in err


@pytest.mark.slow
def test_examples_are_listed_and_copied(airtruth, tmp_path):
    code, out, _ = airtruth("example")
    assert code == 0
    for name, example in EXAMPLES.items():
        assert f"{name} " in out
        assert airtruth("example", name, "--out", "copies")[0] == 0
        for file in example.files:
            assert (tmp_path / "copies" / file).read_bytes() == (ROOT / file).read_bytes()


def test_the_commands_of_the_paper_have_the_methods_of_its_tables():
    identify = next(line for line in EXAMPLES["paper"].commands if " identify " in line).split()
    methods = [word for option, word in pairwise(identify) if option == "--method"]
    assert tuple(methods) == methods_of("light-fit")
    assert "--airspeed-m-s 42.852" in " ".join(identify)


@pytest.mark.slow
def test_an_example_keeps_a_file_that_the_user_changed(airtruth, tmp_path):
    assert airtruth("example", "paper")[0] == airtruth("example", "paper")[0] == 0
    file = tmp_path / "data/campaigns/light.toml"
    file.write_text(file.read_text() + "# mine\n")
    code, _, err = airtruth("example", "paper")
    assert code == 2
    assert "changed since airtruth wrote it" in err
    assert airtruth("example", "paper", "--force")[0] == 0
    assert airtruth("example", "papre")[2].count("did you mean 'paper'?") == 1


def test_every_file_of_the_data_belongs_to_an_example():
    shown = {file for example in EXAMPLES.values() for file in example.files}
    there = {f"data/{p.relative_to(data_root()).as_posix()}" for p in data_root().rglob("*") if p.is_file()}
    assert {name for name in there if not Path(name).name.startswith(".")} == shown


@pytest.mark.grid
@pytest.mark.parametrize("kind", FILES)
def test_shipped_files_fit_their_schema(kind):
    generated = json.loads(schema(kind))
    validator = jsonschema.Draft202012Validator(generated)
    validator.check_schema(generated)
    texts = [TEMPLATES[kind], *(path.read_text(encoding="utf-8") for path in FILES_OF[kind])]
    assert not [error.message for text in texts for error in validator.iter_errors(tomllib.loads(text))]


WRONG = (
    {"runs": "5"},
    {"runs": 5.5},
    {"bogus": 1},
    {"duration_min": 1.0},
    {"duration_ms": 5000.0},
    {"duration_s": 5000.0},
    {"duration_s": -1.0},
    {"condition": {"eas_kt": 75.0}},
    {"condition": {"eas_kt": 75.0, "eas_m_s": 38.0, "altitude_m": 1000.0}},
    {"condition": {"eas": 75.0, "altitude_m": 1000.0}},
    {"condition": {"eas_kt": {"mean": 75.0}, "altitude_m": 1000.0}},
    {"condition": {"eas_kt": "75", "altitude_m": 1000.0}},
    {"manoeuvre": [{"kind": "doublte"}]},
    {"gust": {"level": "hard"}},
    {"gust": {"figures": "nasa"}},
    {"effect": [{"name": "elevator_delay", "delay_ms": 1e6}]},
    {"effect": [{"name": "elevator_delay"}]},
    {"effect": [{"name": "elevator_dealy", "delay_ms": 60}]},
    {"sensors": {"channel": {"alpha_rad": {"noise_std": {"value": 1.0, "unit": "kt"}}}}},
    {"sensors": {"channel": {"alfa": {}}}},
)
RIGHT = (
    {"condition": {"eas_kt": {"mean": 75.0, "std": 1.0}, "altitude_m": {"choose": [1000.0, 2000.0]}}},
    {"condition": {"eas_m_s": 38.0, "altitude_ft": 5000, "flight_path_deg": {"low": -1, "high": 1}}},
    {"effect": [{"name": "elevator_delay", "delay_ms": 60}, {"name": "vane_bias", "value_deg": 1.0}]},
    {"effect": [{"name": "cm_alpha_nonlinear", "dCmalpha": 0.5, "at_alpha_deg": 6}]},
    {"effect": [{"name": "sensor_delay", "channel": "q_rad_s", "delay_s": 0.05}]},
    {"wind": {"along_track_kt": 10, "keeps": "ground_speed"}},
    {"sensors": {"channel": {"alpha_rad": {"x": {"value": 3.0, "unit": "ft"}}}}},
    {"manoeuvre": [{"kind": "multisine", "amplitude_deg": 1.0, "length_ms": 4000, "highest_hz": 2.5}]},
)


@pytest.mark.parametrize(("edits", "right"), [(WRONG, False), (RIGHT, True)], ids=["wrong", "right"])
def test_the_schema_agrees_with_the_model_of_a_campaign(edits, right):
    validator = jsonschema.Draft202012Validator(json.loads(schema("campaign")))
    for edit in edits:
        raw = tomllib.loads(TEMPLATES["campaign"]) | edit
        assert validator.is_valid(raw) is right, edit
        if right:
            Campaign.model_validate(raw)
        else:
            with pytest.raises(ValueError, match="error"):
                Campaign.model_validate(raw)


@pytest.mark.parametrize(
    ("kind", "edit"),
    [
        ("aircraft", {"derivatives": {"CLalfa": {"value": 5.0}}}),
        ("aircraft", {"geometry": {"wing_area": {"value": 16.0, "unit": "m"}, "chord": {}, "span": {}}}),
        ("aircraft", {"mass": {"mass": 1000.0, "inertia_yy": {"value": 1.0, "unit": "kg_m2"}}}),
        ("aircraft", {"sensors": {"alpha_rad": {"noise": {"value": 0.1, "unit": "deg"}}}}),
        ("mapping", {"channels": {"alfa_rad": {"column": 2, "unit": "deg"}}}),
        ("mapping", {"channels": {"alpha_rad": {"column": 2}}}),
        ("mapping", {"resample": {"rate_hz": 50.0, "method": "spline"}}),
        ("mapping", {"source": {"format": "xls"}}),
    ],
)
def test_the_schema_refuses_what_the_model_refuses(kind, edit):
    raw = tomllib.loads(TEMPLATES[kind]) | edit
    assert not jsonschema.Draft202012Validator(json.loads(schema(kind))).is_valid(raw)
    with pytest.raises(ValueError, match="error"):
        FILES[kind].model_validate(raw)


def test_the_schema_knows_every_effect_and_the_names_that_validators_test():
    described = json.loads(schema("campaign"))["$defs"]
    shown = {(e["properties"]["name"]["const"], e["properties"].get("variant", {}).get("const", "")) for e in
             described["EffectTable"]["anyOf"]}  # fmt: skip
    assert shown == {(e.name, e.variant) for e in EFFECTS.values()}
    for (model, field), names in NAMES.items():
        required = {
            "kind": {"kind": "replay", "file": "f"},
            "control": {"kind": "step", "amplitude_deg": 1.0},
        }.get(field, {})
        for name in names:
            moved = {"file": "f"} if name == "replay" else {"amplitude_deg": 1.0}
            given = (required if field != "kind" else moved) | {field: name}
            model.model_validate(given)
        with pytest.raises(ValueError, match="is not known"):
            model.model_validate(required | {field: "bogus"})


@pytest.mark.slow
def test_an_unknown_schema_names_the_kinds(airtruth):
    with pytest.raises(ConfigurationError, match="did you mean 'campaign'"):
        schema("campain")
    code, out, _ = airtruth("schema", "aircraft")
    assert code == 0
    assert json.loads(out)["title"] == "airtruth aircraft file"


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_methods(airtruth, shell):
    line = "airtruth identify LOG --method iv-f"
    code, out, _ = airtruth(
        _AIRTRUTH_COMPLETE=f"complete_{shell}",
        COMP_WORDS=line,
        COMP_CWORD="4",
        _TYPER_COMPLETE_ARGS=line,
        _TYPER_COMPLETE_FISH_ACTION="get-args",
    )
    assert code == 0
    assert "iv-f1" in out
    assert "iv-f2" in out
    assert "ls" not in out.split()
    code, out, _ = airtruth("--show-completion", shell, _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert code == 0
    assert "airtruth" in out


def test_names_that_shells_complete(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gnat").mkdir()
    (tmp_path / "gnat" / "aircraft.toml").touch()
    assert list(complete_aircraft("g")) == ["gnat", "gtm"]
    assert list(complete_example("va")) == ["vane"]
    assert "cm_alpha_nonlinear:break" in list(complete_effect("cm_"))


@pytest.mark.slow
def test_verbose_and_the_log_file_state_what_was_done(airtruth, tmp_path):
    code, out, err = airtruth("new", "campaign", "--out", "c.toml", "--verbose", "--log-file", "logs/a.txt")
    assert code == 0
    assert "wrote c.toml" in err
    assert "wrote" not in out
    code, *_ = airtruth("example", "bogus", "--log-file", "logs/a.txt")
    assert code == 2
    first, *lines = (tmp_path / "logs" / "a.txt").read_text().splitlines()
    assert first == "# airtruth log"
    text = "\n".join(lines)
    assert "command: airtruth new campaign --out c.toml" in text
    assert "INFO    finished after" in text
    assert "ERROR   ended by exit code 2 (example 'bogus' does not exist" in text


@pytest.mark.slow
def test_a_log_file_extends_no_other_file(airtruth, tmp_path):
    (tmp_path / "mine.txt").write_text("mine\n")
    code, _, err = airtruth("example", "--log-file", "mine.txt")
    assert code == 2
    assert "is not a log file of airtruth; choose another --log-file" in err
    assert (tmp_path / "mine.txt").read_text() == "mine\n"
    assert airtruth("example", "--log-file", ".")[0] == 2


def test_without_the_options_nothing_is_logged(airtruth):
    assert airtruth("example")[2] == ""


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def test_the_time_that_remains_is_exact_where_steps_take_their_shares():
    clock = Clock()
    remaining = Remaining((("a", 1.0), ("b", 3.0), ("c", 4.0)), clock)
    assert remaining.left_s is None
    remaining.enter("a first")
    assert remaining.left_s is None
    clock.now = 2.0
    remaining.enter("b second")
    assert remaining.left_s == pytest.approx(14.0)
    clock.now = 5.0
    assert remaining.left_s == pytest.approx(11.0)
    remaining.enter("unknown")
    assert remaining.left_s == pytest.approx(11.0)
    clock.now = 8.0
    remaining.enter("c")
    assert remaining.text() == "8 s, about 8 s left"
    clock.now = 40.0
    assert remaining.left_s == 0.0


def test_a_short_first_step_predicts_nothing():
    """A step of 1 of 101 typical seconds scatters by more than its time; the first of the next ten seconds predicts the rest."""
    clock = Clock()
    remaining = Remaining((("a", 1.0), ("b", 10.0), ("c", 90.0)), clock)
    remaining.enter("a")
    clock.now = 3.0
    remaining.enter("b")
    assert remaining.left_s is None
    clock.now = 11.0
    remaining.enter("c")
    assert remaining.left_s == pytest.approx(90.0)


def test_steps_of_a_trace_are_never_entered_again():
    """Every refit belongs to the search until increments are learned."""
    clock = Clock()
    remaining = Remaining(TRACE_STEPS, clock)
    steps = ("probe", "check the kinematics", "refit the declared aircraft")
    search = ("refit vane_arm", "refit gyro_lag + vane_arm", "refit gyro_lag")
    for what in (*steps, *search):
        remaining.enter(what)
        clock.now += 1.0
    first = sum(time for _, time in TRACE_STEPS[:3])
    later = sum(time for _, time in TRACE_STEPS[4:])
    assert remaining.left_s == pytest.approx((TRACE_STEPS[3][1] + later) * 3.0 / first - 3.0)
    remaining.enter("learn increments from what remains")
    remaining.enter("refit increment:Cm over alpha_rad")
    before = remaining.left_s
    remaining.enter("score the effects")
    remaining.enter("refit increment:CL over alpha_rad")
    assert remaining.left_s == before
    remaining.enter("assess every stage")
    assert remaining.left_s == pytest.approx(3.5 * 6.0 / 13.5)


def test_the_time_that_remains_is_right_within_a_factor_of_one_and_a_half_after_a_fifth():
    """Steps of a loop whose times are off by up to 15 % each, on machines of half to four times the speed."""
    rng = np.random.default_rng(5)
    for _ in range(200):
        costs = rng.uniform(0.25, 2.0) * np.array(
            [time * np.exp(rng.uniform(-0.14, 0.14)) for _, time in LOOP_STEPS]
        )
        total, ends, clock = costs.sum(), np.cumsum(costs), Clock()
        remaining = Remaining(LOOP_STEPS, clock)
        entered = -1
        for now in np.linspace(0.0, 0.9, 91) * total:
            clock.now = now
            while entered < np.searchsorted(ends, now, side="right"):
                entered += 1
                clock.now = ends[entered - 1] if entered else 0.0
                remaining.enter(f"{LOOP_STEPS[entered][0]} something")
            clock.now = now
            if now >= 0.2 * total:
                assert 1.0 / 1.5 < remaining.left_s / (total - now) < 1.5


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["fly", "none.toml", "--out", "x"], "none.toml: no such campaign file; `airtruth new campaign"),
        (
            ["tables", "none", "--out", "x"],
            "none: no such campaign folder; `airtruth fly CAMPAIGN.toml --out none`",
        ),
        (["report", "none", "--out", "x.html"], "none: no such folder or file; give the folder of a trace"),
        (["report", "logs", "--out", "x.html", "--aircraft", "gtmm"], "aircraft 'gtmm' not found"),
        (["verify", "none"], "none: is not a folder"),
    ],
)
def test_what_does_not_exist_is_refused_before_the_imports_of_seconds(tmp_path, words, message):
    (tmp_path / "logs").mkdir()
    script = (
        "import sys\nfrom airtruth import cli\n"
        f"sys.argv = ['airtruth', *{words!r}]\n"
        "try:\n    cli.main()\nexcept SystemExit:\n    pass\n"
        "print(*sorted({'scipy', 'pandas', 'numba', 'jsbsim', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == ""
    assert message in done.stderr


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_a_bar_on_a_terminal_leaves_the_result_as_it_is(tmp_path):
    """rich would wrap what a command prints below a bar at the width of the terminal."""
    import pty

    log = ROOT / "data" / "undeclared" / "b.parquet"
    command = [sys.executable, "-m", "airtruth", "identify", str(log), "--aircraft", "gtm", "--method", "ls"]
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "60"}
    plain = subprocess.run([*command, "--quiet"], env=environment, capture_output=True, text=True, check=True)
    outer, inner = pty.openpty()
    bar: list[bytes] = []

    def read() -> None:
        """Empty the terminal, which holds few bytes, until its other end is closed."""
        with contextlib.suppress(OSError):
            while part := os.read(outer, 4096):
                bar.append(part)

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    shown = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, stderr=inner, text=True, check=True, timeout=60
    )
    os.close(inner)
    reader.join(10.0)
    os.close(outer)
    assert shown.stdout == plain.stdout
    assert b"identify" in b"".join(bar)
