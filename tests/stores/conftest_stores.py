"""A server of the S3 protocol on the loopback address (moto), and the environment in which airtruth uses it."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

PATIENCE_S = 60.0  # start of the server on a busy machine


class Server:
    """A process that serves S3; its keys are lost when it ends."""

    def __init__(self, folder: Path, free_requests: int | None = None) -> None:
        """``free_requests``: requests that need no permission; None for all."""
        if find_spec("moto") is None:
            pytest.skip("the S3 server of the tests is not installed: pip install 'moto[server]'")
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.address = f"http://127.0.0.1:{port}"
        extra = {} if free_requests is None else {"INITIAL_NO_AUTH_ACTION_COUNT": str(free_requests)}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)],
            env=os.environ | extra,
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        end = time.monotonic() + PATIENCE_S
        while not self._answers():
            assert time.monotonic() < end, "moto does not answer"
            assert self._process.poll() is None, "moto has ended"
            time.sleep(0.05)

    def _answers(self) -> bool:
        try:
            with socket.create_connection(("127.0.0.1", int(self.address.rpartition(":")[2])), 1.0):
                return True
        except OSError:
            return False

    def request(self, method: str, path: str) -> None:
        """Send a request without credentials."""
        with urllib.request.urlopen(urllib.request.Request(f"{self.address}/{path}", method=method)):
            pass

    def close(self) -> None:
        self._process.kill()
        self._process.wait()


def use(server: Server, patch: pytest.MonkeyPatch, key: str = "test", secret: str = "test") -> None:
    """Let this process and its children use a server."""
    from airtruth.logs import remote

    patch.setenv("AWS_ENDPOINT_URL", server.address)
    patch.setenv("AWS_ACCESS_KEY_ID", key)
    patch.setenv("AWS_SECRET_ACCESS_KEY", secret)
    patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    patch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    remote._file_system.cache_clear()  # it was connected with the environment of before


@pytest.fixture(scope="session")
def s3_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("moto"))
    yield server
    server.close()


@pytest.fixture
def bucket(
    s3_server: Server, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Iterator[str]:
    """URL of a new bucket."""
    use(s3_server, monkeypatch)
    name = f"bucket-{os.getpid()}-{abs(hash(request.node.nodeid)):x}"[:60]
    s3_server.request("PUT", name)
    yield f"s3://{name}"
    from airtruth.logs import remote

    remote._file_system.cache_clear()
