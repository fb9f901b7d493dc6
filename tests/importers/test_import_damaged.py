"""Files that crash, hang or fill their reader end in one sentence, and the caller goes on."""

import struct
import subprocess
import sys

import numpy as np
import pytest
import scipy.io
from import_flight import mapping_by_name

from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.foreign.matlab import read_mat
from airtruth.importers import import_log, open_source
from airtruth.isolation import client, limits


@pytest.fixture
def matlab(tmp_path):
    """A .mat file of version 5, and the file with one byte changed."""
    t = np.arange(30) / 50.0
    path = tmp_path / "f.mat"
    scipy.io.savemat(path, {"fdata": np.column_stack([t, np.sin(t)]), "rec": {"q": np.cos(t)}, "s": "text"})
    whole = path.read_bytes()

    def damaged(offset, value):
        path.write_bytes(whole[:offset] + bytes([value]) + whole[offset + 1 :])
        return path

    return damaged


@pytest.mark.parametrize(("offset", "value"), [(1058, 1), (785, 8)])
def test_a_file_that_kills_scipy(matlab, offset, value):
    """scipy 1.17 ends in SIGSEGV and SIGBUS on these."""
    with pytest.raises(StoreError, match=r"f\.mat: .*damaged.*again"):
        open_source(matlab(offset, value))


def test_a_file_that_keeps_scipy_busy(matlab, monkeypatch):
    """A size of zero lets scipy 1.17 read the same element for ever."""
    monkeypatch.setattr(limits, "LEAST_SECONDS", 0.5)
    with pytest.raises(StoreError, match=r"f\.mat: .*(not read within|damaged).*(shorter part|again)"):
        open_source(matlab(707, 16))


def test_a_file_that_asks_for_memory(tmp_path):
    """The header of a matrix of 6e5 x 6e5 in a file of 200 bytes."""
    path = tmp_path / "f.mat"
    scipy.io.savemat(path, {"a": np.zeros((2, 2))})
    whole = path.read_bytes()
    path.write_bytes(whole.replace(struct.pack("<ii", 2, 2), struct.pack("<ii", 600_000, 600_000), 1))
    with pytest.raises(StoreError, match=r"f\.mat: .*(memory|damaged)"):
        open_source(path)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (UnboundLocalError("local variable 'arr' referenced before assignment"), "local variable 'arr'"),
        (ZeroDivisionError(), "ZeroDivisionError"),
        (KeyError(7), "7"),
        (NotImplementedError("Please use HDF reader\nfor matlab v7.3 files"), "HDF reader for matlab"),
    ],
)
def test_whatever_scipy_raises_on_wrong_bytes_is_named(matlab, monkeypatch, error, words):
    def loadmat(*arguments, **options):
        raise error

    monkeypatch.setattr(scipy.io, "loadmat", loadmat)
    with pytest.raises(
        StoreError, match=rf"f\.mat: is not a MATLAB file, .*{words}.*; save it again"
    ) as caught:
        read_mat(matlab(0, 0))
    assert "\n" not in str(caught.value)


def test_structs_nested_beyond_the_stack(matlab, monkeypatch):
    inner = np.array(1.0)
    for _ in range(2000):
        inner = np.array([inner, None], dtype=object)[:1]
    monkeypatch.setattr(scipy.io, "loadmat", lambda *arguments, **options: {"a": inner})
    with pytest.raises(StoreError, match=r"f\.mat: its structs are nested too deeply; save"):
        read_mat(matlab(0, 0))


def test_a_px4_topic_without_times_is_left_out(tmp_path):
    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
    data += message("F", b"air:uint64_t timestamp;float v;") + message(
        "F", b"odd:uint64_t timestamq;float v;"
    )
    data += message("A", struct.pack("<BH", 0, 0) + b"air") + message("A", struct.pack("<BH", 0, 1) + b"odd")
    for i in range(3):
        data += message("D", struct.pack("<HQf", 0, i, 1.0)) + message("D", struct.pack("<HQf", 1, i, 2.0))
    (tmp_path / "f.ulg").write_bytes(data)
    assert set(open_source(tmp_path / "f.ulg").arrays) == {"air.timestamp", "air.v"}


def test_a_clock_that_asks_for_too_many_samples(tmp_path):
    t = np.arange(60) / 50.0
    names = ("KTAS", "AOA_nose")
    rows = [f"{a},{a},{a}" for a in [*t[:-1], 1e15]]
    (tmp_path / "f.csv").write_text("\n".join(["t," + ",".join(names), *rows]))
    (tmp_path / "m.toml").write_text(
        '[time]\ncolumn = "t"\n[resample]\nrate_hz = 50\nmethod = "linear"\n'
        '[channels.airspeed_m_s]\ncolumn = "KTAS"\nunit = "kt"\n'
        '[channels.alpha_rad]\ncolumn = "AOA_nose"\nunit = "deg"\n'
    )
    with pytest.raises(
        LogError, match=r"5e\+16 samples, and a run may have 2e\+07; correct the unit of \[time\]"
    ):
        import_log(tmp_path / "f.csv", tmp_path / "m.toml")


@pytest.mark.slow
def test_a_reader_that_does_not_start(tmp_path, monkeypatch):
    (tmp_path / "f.csv").write_text("a,b\n1,2\n")
    client.close()
    monkeypatch.setattr(client, "_MODULE", "airtruth.no_such_module")
    with pytest.raises(StoreError, match=r"f\.csv: the process that reads it does not start .*ulimit"):
        open_source(tmp_path / "f.csv")
    client.close()


@pytest.mark.parametrize(
    ("delimiter", "decimal"), [("", "."), (";;", "."), ("(a+)+$", "."), ("5", "."), ('"', "."), ("\n", ".")]
)
def test_a_delimiter_that_cannot_divide_cells(tmp_path, delimiter, decimal):
    (tmp_path / "f.csv").write_text("a,b\n1,2\n")
    text = mapping_by_name(f"delimiter = {delimiter!r}" if delimiter != "\n" else 'delimiter = "\\n"')
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(ConfigurationError, match=r"source\.delimiter: .*one character.*format = \"table\""):
        import_log(tmp_path / "f.csv", tmp_path / "m.toml")


@pytest.mark.slow
def test_a_module_of_a_stranger_in_the_working_folder_is_not_imported(tmp_path):
    for name in ("pandas", "subprocess", "scipy", "json", "airtruth"):
        (tmp_path / f"{name}.py").write_text("open('canary', 'w').close()\n")
    (tmp_path / "f.csv").write_text("a,b\n1,2\n3,4\n")
    command = [sys.executable, "-P", "-m", "airtruth", "import", "--guess", "f.csv"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "canary").exists()
