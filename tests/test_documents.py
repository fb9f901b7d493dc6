"""TOML and JSON files of any bytes are read, or are one sentence with the file, the fault and the next step."""

import os

import pytest

from airtruth.documents import LARGEST_TOML_BYTES, LONGEST_LINE, read_json, read_toml
from airtruth.errors import ConfigurationError, StoreError


def toml(path):
    return read_toml(path, ConfigurationError, "see the manual")


def test_a_file_with_and_without_a_mark_of_byte_order(tmp_path):
    for name, content in (("a", b"x = 1"), ("b", b"\xef\xbb\xbfx = 1"), ("c", b"")):
        (tmp_path / name).write_bytes(content)
    assert [toml(tmp_path / name) for name in "abc"] == [{"x": 1}, {"x": 1}, {}]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("x = 1".encode("utf-16"), "is not UTF-8: invalid start byte at byte 0"),
        (b"name = '\xe9'", "is not UTF-8"),
        (b"x = = 1", "not valid TOML: Invalid value (at line 1, column 5)"),
        (b"x = 1\nx = 2", "not valid TOML: Cannot overwrite a value"),
        (b"x = " + b"9" * 5000, "not valid TOML: Exceeds the limit"),
        (b"x = [{ y = -1" + b"0" * 400 + b" }]", "an integer is beyond 64 bits"),
        (b"x = 0x" + b"f" * 9000, "an integer is beyond 64 bits"),
        (b"x = " + b"[" * 5000, "not valid TOML: nested too deeply"),
        (b"x = " + b"[" * 60 + b"]" * 60, "not valid TOML: nested more than 50 levels deep"),
        (b"a." * 70 + b"b = 1", "not valid TOML: nested more than 50 levels deep"),
        (b"a." * LONGEST_LINE + b"b = 1", f"has a line of {2 * LONGEST_LINE + 5} characters"),
        (b"# x\n" * (LARGEST_TOML_BYTES // 4 + 1), "has more than 0.5 MB"),
        (b"\0\0", "not valid TOML"),
    ],
)
def test_a_file_that_is_no_toml(tmp_path, content, words):
    path = tmp_path / "f.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigurationError) as caught:
        toml(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert words in message
    assert message.endswith("see the manual")
    assert "\n" not in message


def test_paths_that_are_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name, words in (
        ("none", "No such file"),
        (".", "is not a regular file"),
        ("pipe", "is not a regular file"),
        ("x" * 500, "File name too long"),
        ("a\0b", "null"),
    ):
        with pytest.raises(ConfigurationError, match=rf"cannot be read \(.*{words}.*\); see the manual"):
            toml(tmp_path / name)


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, "1" * 5000, "[" * 60 + "]" * 60])
def test_a_file_that_is_no_json(tmp_path, text):
    (tmp_path / "f.json").write_text(text)
    with pytest.raises(StoreError, match=r"f\.json: not valid JSON: .*; write it again$"):
        read_json(tmp_path / "f.json", StoreError, "write it again")
