"""Cached kernels that a change of another file has made stale are removed."""

import os

import pytest

from scripts.compile_kernels import remove_stale


@pytest.mark.parametrize(("age_s", "removed"), [(-1.0, 2), (1.0, 0)])
def test_a_kernel_older_than_any_file_with_kernels_is_removed(age_s, removed, tmp_path):
    cache = tmp_path / "__pycache__"
    cache.mkdir()
    for path in (tmp_path / "called.py", tmp_path / "plain.py", cache / "a.nbi", cache / "a.1.nbc"):
        path.write_text("from numba import njit" if path.name == "called.py" else "")
        changed = 1000.0 + (age_s if path.parent == cache else 0.0)
        os.utime(path, (changed, changed))
    os.utime(tmp_path / "plain.py", (2000.0, 2000.0))  # without kernels: its date does not count
    assert remove_stale(tmp_path) == removed
    assert len(list(cache.iterdir())) == 2 - removed
