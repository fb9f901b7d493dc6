"""Arguments that a function of the package cannot use end in one `AirtruthError`, and a string is one name."""

import numpy as np
import pytest

import airtruth as at
from airtruth.errors import ConfigurationError

REFUSED = {
    "seed of a trace": (lambda: at.TraceOptions(seed=-1), "seed = -1: must be a whole number, 0 or more"),
    "effects": (
        lambda: at.TraceOptions(effects=(1,)),
        "effects = (1,): must be a name or a sequence of names",
    ),
    "hold_out": (
        lambda: at.TraceOptions(hold_out=[None]),
        "hold_out = [None]: must be a name or a sequence of names",
    ),
    "window": (
        lambda: at.IdentificationOptions(trim_window_s=None),
        "trim_window_s = None: must be a number between 0",
    ),
    "tolerance": (
        lambda: at.IdentificationOptions(tolerance="x"),
        "tolerance = 'x': must be a number between 0 and 1",
    ),
    "order": (
        lambda: at.IdentificationOptions(order=1.5),
        "option order = 1.5: must be a whole number, 1 or more",
    ),
    "band": (
        lambda: at.IdentificationOptions(band_hz=0.2),
        "band_hz = 0.2: must be a lower and a higher frequency",
    ),
    "methods": (
        lambda: at.identify("out/light", "gtm", [1]),
        "methods = [1]: must be a name or a sequence of names",
    ),
    "method": (
        lambda: at.identify("out/light", "gtm", 1),
        "methods = 1: must be a name or a sequence of names",
    ),
    "report": (lambda: at.report(None, "r.html"), "NoneType is not a result; give the result of a function"),
    "jobs": (lambda: at.fly("light.toml", "out/new", jobs=0), "jobs = 0: must be a whole number, 1 or more"),
    "records": (lambda: at.plan("light.toml", records=0), "records = 0: must be a whole number, 1 or more"),
    "records of an input": (
        lambda: at.plan("light.toml", derivatives="Cmq", records=True),
        "records = True: must be a whole number, 1 or more",
    ),
    "derivatives": (
        lambda: at.plan("light.toml", derivatives=[None]),
        "derivatives = [None]: must be a name or a seq",
    ),
    "derivative": (lambda: at.plan("light.toml", derivatives="C"), "'C'"),
    "options": (
        lambda: at.identify("out/light", "gtm", options={"order": 2}),
        "options: dict is not IdentificationOptions; give IdentificationOptions(...) or None",
    ),
    "options of a trace": (lambda: at.trace("out/light", "gtm", {}), "options: dict is not TraceOptions"),
    "options of a loop": (
        lambda: at.close_loop("out/light", "gtm", options=1),
        "options: int is not TraceOptions",
    ),
    "limits": (lambda: at.plan("light.toml", derivatives="Cmq", limits=3), "limits: int is not Limits"),
    "campaign": (
        lambda: at.fly(None, "out/new"),
        "NoneType is not a campaign; give a campaign file, or a Campaign",
    ),
    "out": (lambda: at.fly("light.toml", 7), "out = 7: must be the path of a file or folder"),
    "folder": (lambda: at.verify(None), "folder = None: must be the path"),
    "file": (lambda: at.import_log([3], "map.toml"), "file = 3: must be the path"),
    "mapping": (lambda: at.import_log("a.csv", None), "mapping = None: must be the path"),
    "split": (lambda: at.plan("light.toml", split="elevator_delay"), "two"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", REFUSED)
def test_an_argument_that_cannot_be_used(case, workspace, monkeypatch):
    monkeypatch.chdir(workspace)
    call, words = REFUSED[case]
    with pytest.raises(ConfigurationError) as caught:
        call()
    assert words in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [list, tuple, iter, lambda paths: (p for p in paths)])
def test_several_files_in_any_iterable(kind, workspace):
    """An import reads the mappings first, and these do not exist."""
    with pytest.raises(ConfigurationError, match=r"absent\.toml: cannot be read"):
        at.import_log(kind(["one.csv", "other.csv"]), kind([workspace / "absent.toml", "map.toml"]))


def test_the_type_of_a_written_log(workspace, tmp_path):
    log = at.read_log(workspace / "out" / "light")
    with pytest.raises(ConfigurationError, match=r"dtype = 'int': allowed: float32, float64"):
        at.write_log(tmp_path / "a.parquet", log, dtype="int")
    assert not list(tmp_path.iterdir())


def test_a_string_is_one_name(workspace):
    campaign = workspace / "out" / "light"
    assert at.TraceOptions(effects="vane_arm", hold_out="r1") == at.TraceOptions(
        effects=("vane_arm",), hold_out=("r1",)
    )
    first = at.read_log(campaign).run_ids[0]
    log = at.read_log(campaign, channels="alpha_rad", run_ids=first)
    assert (log.run_ids, list(log.channels)) == ((first,), ["alpha_rad"])
    assert at.identify(campaign, "gtm", "ls").to_frame()["method"].unique().tolist() == ["ls"]


def test_numbers_of_numpy_are_numbers():
    options = at.IdentificationOptions(tolerance=np.float32(0.02), order=np.int64(2), band_hz=[0.2, 2.0])
    assert options.order == 2
    assert at.TraceOptions(seed=np.int32(3)).seed == 3
