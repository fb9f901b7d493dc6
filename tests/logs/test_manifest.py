"""The manifest survives a killed writer and reports other damage."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.errors import StoreError
from airtruth.logs import manifest

RECORDS: list[dict[str, object]] = [{"chunk": 0, "runs": ["a", "b"]}, {"chunk": 1, "état": "ok"}, {}]


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    assert manifest.read(path) == []
    manifest.append(path, RECORDS[0])
    manifest.append(path, *RECORDS[1:])
    assert manifest.read(path) == RECORDS
    assert path.read_bytes().count(b"\n") == 3


@given(st.integers(0, 200))
def test_cut_anywhere_loses_the_last_records_only(tmp_path_factory: pytest.TempPathFactory, cut: int) -> None:
    path = tmp_path_factory.mktemp("cut") / "manifest.jsonl"
    manifest.append(path, *RECORDS)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) - cut] if cut else whole)
    kept = manifest.read(path)
    assert kept == RECORDS[: len(kept)]
    manifest.append(path, {"after": True})
    assert manifest.read(path) == [*kept, {"after": True}]


def test_a_long_torn_line_is_cut(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    path.write_bytes(b'{"a": 1}\n{"b": "' + b"x" * 10000)
    manifest.append(path, {"c": 2})
    assert manifest.read(path) == [{"a": 1}, {"c": 2}]
    path.write_bytes(b"y" * 10000)
    manifest.append(path, {"c": 3})
    assert manifest.read(path) == [{"c": 3}]


def test_other_damage_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    path.write_bytes(b'{"a": 1}\n{"b": \n[1, 2]\n{"c": 1}\n\xff\xfe\n{"torn')
    with pytest.raises(
        StoreError, match=r"manifest\.jsonl: line 2 is not JSON .*line 3 is not a JSON object; line 5"
    ):
        manifest.read(path)


def test_unwritable_folder(tmp_path: Path) -> None:
    with pytest.raises(
        StoreError, match=r"nowhere/m\.jsonl: not written; the folder does not exist: create it"
    ):
        manifest.append(tmp_path / "nowhere" / "m.jsonl", {})
    with pytest.raises(StoreError, match="cannot be read"):
        manifest.read(tmp_path)


@pytest.mark.parametrize(("count", "more"), [(3, ""), (5, ""), (6, "; and 1 more"), (8, "; and 3 more")])
def test_many_damaged_lines_are_counted(tmp_path: Path, count: int, more: str) -> None:
    path = tmp_path / "m.jsonl"
    path.write_bytes(b"x\n" * count)
    with pytest.raises(StoreError) as error:
        manifest.read(path)
    message = str(error.value)
    assert message.count("is not JSON (") == min(count, 5)
    assert f"{more}. An interrupted write damages only the last line" in message
    assert ("more" in message) == bool(more)


def test_a_number_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    """JSON has no NaN, and other programs read the manifest."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        manifest.append(tmp_path / "m.jsonl", {"x": float("nan")})
    assert not (tmp_path / "m.jsonl").exists()


def test_an_empty_first_line_is_kept_by_append(tmp_path: Path) -> None:
    path = tmp_path / "m.jsonl"
    path.write_bytes(b"\ntorn")
    manifest.append(path, {"a": 1})
    assert path.read_bytes() == b'\n{"a": 1}\n'


def test_a_new_manifest_is_an_entry_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder is flushed once, when the file appears: otherwise a power cut could lose the file as a whole."""
    flushed: list[Path] = []
    monkeypatch.setattr(manifest, "sync_folder", flushed.append)
    manifest.append(tmp_path / "m.jsonl", {})
    manifest.append(tmp_path / "m.jsonl", {})
    assert flushed == [tmp_path]


def test_a_closing_record_closes_what_is_above_it_alone(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    manifest.rewrite(path, RECORDS)
    assert manifest.scan(path) == manifest.Scan(tuple(RECORDS), (), closed=False)
    manifest.rewrite(path, RECORDS, closing={"end": True})
    assert manifest.scan(path) == manifest.Scan((*RECORDS, {"end": True}), (), closed=True)
    whole = path.read_bytes().split(b"\n")
    for changed in (
        [*whole[1:]],  # a line is gone
        [whole[1], whole[0], *whole[2:]],  # exchanged
        [*whole[:-1], b'{"torn'],
        [*whole[:-1], *whole[:1], b""],  # another record follows
    ):
        path.write_bytes(b"\n".join(changed))
        found = manifest.scan(path)
        assert not found.closed
        assert found.damaged == ()


def test_a_record_that_changed_is_named_by_its_line(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    manifest.rewrite(path, RECORDS)
    path.write_bytes(path.read_bytes().replace(b"ok", b"no"))
    found = manifest.scan(path)
    assert found.damaged == (2,)
    assert found.records == (RECORDS[0], RECORDS[2])
