"""The rule for outputs: inputs, files of others and changed files are not replaced."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from airtruth.errors import StoreError
from airtruth.logs import ledger
from airtruth.logs.atomic import new_folder, remove_folder, write_text
from airtruth.logs.outputs import writing
from airtruth.logs.temporary import (
    clear,
    is_abandoned,
    is_temporary,
    private_folder,
    temporary_folder,
    temporary_name,
)
from airtruth.logs.verify import verify


def write(
    path: Path, text: str, command: str = "report", inputs: tuple[Path, ...] = (), force: bool = False
) -> None:
    with writing(command, inputs, force=force):
        write_text(path, text)


def test_a_command_replaces_its_own_files(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for text in ("one", "two", "two", "three"):
        write(path, text)
        assert path.read_text() == text
    assert sorted(os.listdir(tmp_path)) == [ledger.LEDGER, "a.csv"]
    assert verify(tmp_path).intact


def test_a_name_that_is_not_utf8(tmp_path: Path) -> None:
    path = tmp_path / "gr\udcf6\udcdfe.txt"
    write(path, f"of {path.name}")
    assert path.read_bytes() == rb"of gr\udcf6\udcdfe.txt"
    assert verify(tmp_path).intact


def test_a_temporary_name_divides_no_character() -> None:
    for name in ("\u20ac" * 80, "a" + "\u20ac" * 80, "\udcf6" * 300, "\u20ac" * 59 + "a\udcf6" * 9):
        short = temporary_name(name)[1:].rpartition(".tmp")[0].rsplit(".", 1)[0]
        assert name.startswith(short)
        assert 177 < len(os.fsencode(short)) <= 180
        assert is_temporary(temporary_name(name))


def test_nothing_else_is_replaced_without_force(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("mine")
    with pytest.raises(
        StoreError, match=r"a\.csv: exists and was not written by airtruth; choose another --out, or repl"
    ):
        write(path, "theirs")
    assert (path.read_text(), os.listdir(tmp_path)) == ("mine", ["a.csv"])
    write(path, "theirs", force=True)
    path.write_text("changed")
    with pytest.raises(StoreError, match="changed since airtruth wrote it"):
        write(path, "theirs")
    write(path, "theirs", force=True)
    with pytest.raises(StoreError, match=r"was written by another command \(airtruth report\)"):
        write(path, "tables", command="tables")
    assert path.read_text() == "theirs"
    path.unlink()
    write(path, "tables", command="tables")


def test_an_input_is_never_an_output(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    write(path, "mine")
    hard, soft = tmp_path / "hard", tmp_path / "soft"
    os.link(path, hard)
    soft.symlink_to(path)
    for name in (path, hard, soft, tmp_path / "." / "log.parquet"):
        for force in (False, True):
            with pytest.raises(StoreError, match="is an input of this command; choose another --out"):
                write(name, "new", inputs=(path, tmp_path / "absent"), force=force)
    assert path.read_text() == "mine"


def test_devices_and_links_are_not_replaced(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    for device in (Path(os.devnull), fifo):
        with pytest.raises(StoreError, match="is not a regular file"):
            write(device, "x", force=True)
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("mine")
    link.symlink_to(target)
    with pytest.raises(StoreError, match="was not written by airtruth"):
        write(link, "x")
    assert (target.read_text(), link.is_symlink()) == ("mine", True)


# Dies by SIGKILL at a rename: the first is that of the ledger, the second that of the file.
DIES = """
import os, signal, sys
from pathlib import Path
from airtruth.logs.atomic import write_text
from airtruth.logs.outputs import writing
number, after, path, text = sys.argv[1:]
rename, left = os.replace, [int(number)]
def replace(*paths):
    left[0] -= 1
    if after == "after":
        rename(*paths)
    if left[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    if after != "after":
        rename(*paths)
os.replace = replace
with writing("report"):
    write_text(Path(path), text)
"""


@pytest.mark.grid
@pytest.mark.parametrize("moment", [("1", "before"), ("1", "after"), ("2", "before"), ("2", "after")])
@pytest.mark.parametrize("earlier", ["", "old", "new"])
def test_a_command_that_is_killed_recognises_its_files(
    tmp_path: Path, moment: tuple[str, str], earlier: str
) -> None:
    killed, whole = tmp_path / "killed" / "a.csv", tmp_path / "whole" / "a.csv"
    for path in (killed, whole):
        path.parent.mkdir()
        if earlier:
            write(path, earlier)
    done = subprocess.run([sys.executable, "-c", DIES, *moment, killed, "new"], check=False)
    assert done.returncode == -9 or (earlier, moment[0]) == ("new", "2")  # the ledger needs no change
    for path in (killed, whole):
        write(path, "new")
    assert {p.name: p.read_bytes() for p in killed.parent.iterdir()} == {
        p.name: p.read_bytes() for p in whole.parent.iterdir()
    }


def test_a_damaged_ledger_is_named_and_replaced_with_force(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write(path, "one")
    content = (tmp_path / ledger.LEDGER).read_text()
    for damaged in ("", "[]", "{", content[:-2], content.replace('"report"', '"tables"'), content + " "):
        (tmp_path / ledger.LEDGER).write_text(damaged)
        with pytest.raises(StoreError, match=r"\.airtruth\.json: is damaged; remove it"):
            write(path, "two")
        assert [f.file for f in verify(tmp_path).findings if f.state == "damaged"] == [ledger.LEDGER]
    write(path, "two", force=True)
    assert verify(tmp_path).intact


def test_a_folder_is_replaced_only_as_it_was_written(tmp_path: Path) -> None:
    folder = tmp_path / "gtm"
    with writing("trace") as outputs:
        outputs.require_folder(folder)
        with new_folder(folder) as new:
            (new / "Engines").mkdir()
            (new / "Engines" / "a.xml").write_text("1")
            ledger.add_folder(new, "aircraft")
        outputs.require_folder(folder)
        (folder / "notes.txt").write_text("mine")
        with pytest.raises(
            StoreError, match=r"notes\.txt: was not written by airtruth, and the whole folder would be"
        ):
            outputs.require_folder(folder)
        (folder / "notes.txt").unlink()
        (folder / "Engines" / "a.xml").write_text("2")
        with pytest.raises(StoreError, match=r"a\.xml: changed since airtruth wrote it"):
            outputs.require_folder(folder)
    assert [f.file for f in verify(tmp_path).findings] == ["gtm/Engines/a.xml"]
    with writing("trace", force=True) as outputs:
        outputs.require_folder(folder)
    remove_folder(folder)
    assert os.listdir(tmp_path) == []
    remove_folder(folder)


def test_a_new_folder_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    folder = tmp_path / "gtm"
    folder.mkdir()
    (folder / "old").write_text("")

    def fails() -> None:
        with new_folder(folder) as new:
            (new / "half").write_text("")
            raise ValueError("half")

    with pytest.raises(ValueError, match="half"):
        fails()
    assert [p.name for p in tmp_path.rglob("*")] == ["gtm", "old"]
    with new_folder(folder) as new:
        (new / "new").write_text("")
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["gtm", "new"]


def test_temporary_files_of_living_processes_are_kept(tmp_path: Path) -> None:
    own = tmp_path / temporary_name("a.csv")
    own.write_text("")
    code = "import sys; from airtruth.logs.temporary import temporary_name; print(temporary_name('b' * 300))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    dead = tmp_path / done.stdout.strip()
    dead.mkdir()
    (dead / "file").write_text("")
    reused = tmp_path / own.name.replace(
        f".{os.getpid()}-", f".{os.getpid()}-1"
    )  # an earlier process of this id
    reused.write_text("")
    other = tmp_path / ".a.csv.tmp"
    other.write_text("")
    assert [is_temporary(p.name) for p in (own, dead, reused, other)] == [True, True, True, False]
    assert [is_abandoned(p.name) for p in (own, dead, reused, other)] == [False, True, True, False]
    clear(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([own, other])
    clear(tmp_path / "absent")
    with temporary_folder(tmp_path, "x") as folder:
        assert folder.is_dir()
    assert not folder.exists()


def test_a_private_folder_of_a_killed_process_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    code = (
        "import os, signal; from airtruth.logs.temporary import private_folder; "
        "(private_folder() / 'output').write_text('half'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True)
    assert done.returncode == -9
    assert len(list(tmp_path.iterdir())) == 1
    folder = private_folder()
    assert list(tmp_path.iterdir()) == [folder]
    assert folder.stat().st_mode & 0o777 == 0o700


def test_two_processes_do_not_lose_each_others_entries(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from airtruth.logs.atomic import write_text;"
        "from airtruth.logs.outputs import writing\n"
        "with writing('import'):\n"
        "    for k in range(20): write_text(Path(sys.argv[1]) / f'{sys.argv[2]}{k}', str(k))"
    )
    running = [subprocess.Popen([sys.executable, "-c", code, tmp_path, name]) for name in "ab"]
    assert [process.wait() for process in running] == [0, 0]
    assert len(json.loads((tmp_path / ledger.LEDGER).read_text())["files"]) == 40
    assert verify(tmp_path).intact
