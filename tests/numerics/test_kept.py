"""Values that are kept as long as the object from which they were computed."""

import gc
from dataclasses import dataclass, replace

import numpy as np
import pytest

from airtruth.numerics.kept import Kept


@dataclass(frozen=True)
class Record:
    values: np.ndarray


def test_a_value_belongs_to_one_object_and_not_to_its_copy():
    kept, record = Kept(), Record(np.zeros(3))
    assert kept.of(record) is None
    assert kept.keep(record, "first") == "first"
    kept.keep(record, "second")
    copy = replace(record)
    assert (kept.of(record), kept.of(copy), len(kept)) == ("second", None, 1)


def test_a_value_goes_with_its_object():
    """The number of a freed object serves the next one, which must not get the value of the former."""
    kept = Kept()
    for i in range(100):
        record = Record(np.zeros(3))
        assert kept.of(record) is None
        kept.keep(record, i)
        del record
    gc.collect()
    assert len(kept) == 0


def test_an_object_without_weak_references_is_refused():
    with pytest.raises(TypeError):
        Kept().keep((1, 2), 3)
