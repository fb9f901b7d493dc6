"""Keys of an object store as paths: names, reading, writing, listing, and the sentence of each error."""

from __future__ import annotations

import pickle
from pathlib import Path

import pandas as pd
import pytest
from conftest_stores import Server, use

from airtruth.errors import StoreError
from airtruth.logs import ledger, manifest
from airtruth.logs.atomic import atomic_file, write_text
from airtruth.logs.digest import sha256_of, sha256_of_each
from airtruth.logs.outputs import writing
from airtruth.logs.remote import RemotePath, location
from airtruth.logs.tables import read_table, write_table
from airtruth.logs.temporary import clear


@pytest.mark.parametrize(
    "given", ["s3://b/run 1/x", "s3://b/run 1/x/", Path("s3://b/run 1/x"), "s3:/b/run 1/x"]
)
def test_a_url_is_a_path_however_it_arrives(given: str | Path) -> None:
    path = location(given)
    assert isinstance(path, RemotePath)
    assert str(path) == "s3://b/run 1/x"
    assert path == location("s3://b") / "run 1" / "x"
    assert (path.name, str(path.parent), str(path.with_name("y.md"))) == (
        "x",
        "s3://b/run 1",
        "s3://b/run 1/y.md",
    )
    assert (path / "logs" / "a").relative_to(path).as_posix() == "logs/a"
    assert Path.cwd() / path is path
    copy = pickle.loads(pickle.dumps(path))
    assert (type(copy), copy) == (RemotePath, path)


@pytest.mark.parametrize("given", ["out/light", "/tmp/x", "C:/x", "file.parquet"])
def test_other_names_are_local(given: str) -> None:
    assert type(location(given)) is type(Path())
    assert location(given) == Path(given)


def test_a_file_url_is_local() -> None:
    assert location("file:///tmp/a%20b/c") == Path("/tmp/a b/c")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("http://host/x", "no store of scheme 'http'; allowed: file, gs, s3"),
        ("s4://bucket/x", "no store of scheme 's4'; allowed: file, gs, s3"),
        ("s3://bucket/x?region=eu", "is not s3://BUCKET/FOLDER"),
        ("s3://key:secret@bucket/x", "is not s3://BUCKET/FOLDER"),
    ],
)
def test_urls_that_are_refused(given: str, words: str) -> None:
    with pytest.raises(StoreError, match=r"docs/stores\.md|allowed") as caught:
        location(given)
    assert words in str(caught.value)


def test_a_key_is_written_read_listed_and_deleted(bucket: str) -> None:
    folder = location(f"{bucket}/some folder")
    assert not folder.exists()
    write_text(folder / "a.txt", "abc")
    with atomic_file(folder / "below" / "large") as file:
        file.write(b"0123456789" * 2_000_000)  # several parts of 5 MB and more
    assert (folder.is_dir(), folder.is_file(), (folder / "a.txt").is_file()) == (True, False, True)
    assert (folder / "a.txt").read_bytes() == b"abc"
    assert (folder / "a.txt").read_text(encoding="utf-8") == "abc"
    assert sorted(p.name for p in folder.iterdir()) == ["a.txt", "below"]
    assert [p.name for p in folder.glob("*.txt")] == ["a.txt"]
    assert [str(p) for p in folder.files()] == [f"{folder}/a.txt", f"{folder}/below/large"]
    # sha256sum of the bytes "abc": FIPS 180-2, appendix B.1
    abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256_of_each([folder / "a.txt", folder / "none"]) == [abc, None]
    (folder / "below" / "large").unlink()
    with pytest.raises(FileNotFoundError):
        (folder / "below" / "large").unlink()
    (folder / "below" / "large").unlink(missing_ok=True)
    (folder / "below").rmdir()
    assert [str(p) for p in folder.files()] == [f"{folder}/a.txt"]


def test_a_block_that_fails_writes_nothing(bucket: str) -> None:
    path = location(f"{bucket}/x")

    def fail() -> None:
        with atomic_file(path) as file:
            file.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert not path.exists()


def test_a_key_cannot_be_opened_for_writing(bucket: str) -> None:
    with pytest.raises(OSError, match="one upload"):
        location(f"{bucket}/x").open("wb")


def test_a_table_makes_the_round_trip(bucket: str) -> None:
    frame = pd.DataFrame({"run_id": ["a", "b"], "value": [1.0, 2.0]})
    write_table(f"{bucket}/t.parquet", frame)
    assert read_table(f"{bucket}/t.parquet").equals(frame)
    with pytest.raises(StoreError, match=r"t2\.parquet: no such file"):
        read_table(f"{bucket}/t2.parquet")
    location(f"{bucket}/bad.parquet").upload(b"PAR1")
    with pytest.raises(StoreError, match="is not a Parquet file"):
        read_table(f"{bucket}/bad.parquet")


def test_the_rule_for_outputs_holds_in_a_store(bucket: str) -> None:
    path = location(f"{bucket}/out/a.txt")
    for text in ("one", "two"):
        with writing("tables"):
            write_text(path, text)
    assert ledger.read(path.parent)["a.txt"].sha256 == sha256_of(path)
    with writing("report"), pytest.raises(StoreError, match="another command"):
        write_text(path, "three")
    path.upload(b"changed")
    with writing("tables"), pytest.raises(StoreError, match="changed since"):
        write_text(path, "three")
    with writing("tables", [path]), pytest.raises(StoreError, match="is an input"):
        write_text(path, "three")
    with writing("tables", force=True):
        write_text(path, "three")
    assert path.read_text() == "three"


def test_records_of_a_manifest_are_keys_until_it_is_rewritten(bucket: str) -> None:
    path = location(f"{bucket}/c/manifest.jsonl")
    records = [{"chunk": k} for k in range(3)]
    manifest.rewrite(path, records[:1])
    manifest.append(path, manifest.sealed(records[1]))
    manifest.append(path, manifest.sealed(records[2]))
    assert manifest.scan(path).records == tuple(records)
    assert len(list((path.parent / manifest.MANIFEST_PARTS).iterdir())) == 2
    manifest.rewrite(path, records, {"complete": True})
    found = manifest.scan(path)
    assert (found.closed, len(found.records)) == (True, 4)
    assert list((path.parent / manifest.MANIFEST_PARTS).iterdir()) == []
    clear(path.parent)  # a store has no temporary names


def test_a_bucket_that_does_not_exist(bucket: str) -> None:
    path = location(f"{bucket}-none/x")
    words = "there is no bucket '.*-none'; create it and run the same command again, or choose another"
    with pytest.raises(StoreError, match=words):
        path.mkdir()
    with pytest.raises(StoreError, match=words):
        path.upload(b"1")
    with pytest.raises(StoreError, match=words):
        path.upload(b"1" * 20_000_000)


@pytest.mark.long
def test_a_store_that_does_not_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    server = Server(tmp_path)
    use(server, monkeypatch)
    server.request("PUT", "gone")
    path = location("s3://gone/x")
    path.upload(b"1")
    server.close()
    for act in (path.exists, lambda: path.upload(b"2")):
        with pytest.raises(
            StoreError, match=r"s3://gone.*: the store does not answer; what is recorded stays"
        ):
            act()
