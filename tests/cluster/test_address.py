"""Addresses of clusters, and refusals that need no cluster."""

import json

import pytest

from airtruth.cluster import connected
from airtruth.cluster.address import parse
from airtruth.errors import ConfigurationError


@pytest.mark.parametrize(
    ("text", "local", "scheduler"),
    [
        ("local:2", 2, None),
        ("tcp://10.0.0.1:8786", None, "tcp://10.0.0.1:8786"),
        ("tls://node-7.site:8786", None, "tls://node-7.site:8786"),
    ],
)
def test_addresses(text, local, scheduler):
    address = parse(text)
    assert (address.local, address.scheduler) == (local, scheduler)


def test_a_scheduler_file(tmp_path):
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"type": "Scheduler", "address": "tcp://10.1.2.3:40001"}))
    assert parse(str(file)).scheduler == "tcp://10.1.2.3:40001"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("local:", "local:N needs a number"),
        ("local:0", "local:N needs a number"),
        ("local:two", "local:N needs a number"),
        ("tcp://host", "state host and port"),
        ("tcp://:8786", "state host and port"),
        ("missing.json", "no such scheduler file; allowed: local:N"),
    ],
)
def test_wrong_addresses_name_the_allowed_ones(text, words):
    with pytest.raises(ConfigurationError, match=words):
        parse(text)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"workers": {}}', "\x00"])
def test_a_file_that_is_no_scheduler_file(tmp_path, content):
    file = tmp_path / "scheduler.json"
    file.write_text(content)
    with pytest.raises(ConfigurationError, match="not a scheduler file"):
        parse(str(file))


@pytest.mark.slow
def test_nothing_answers(monkeypatch):
    monkeypatch.setattr("airtruth.cluster.client.CONNECT_S", 0.5)
    with (
        pytest.raises(
            ConfigurationError, match=r"tcp://127.0.0.1:9: no scheduler answers .*`dask scheduler`"
        ),
        connected("tcp://127.0.0.1:9"),
    ):
        pass
