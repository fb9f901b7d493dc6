"""Stores on the loopback address (moto, gcp-storage-emulator), and the environment in which airtruth uses them."""

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


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(port: int, process: subprocess.Popen[bytes]) -> None:
    """Wait until a server accepts connections."""
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            with socket.create_connection(("127.0.0.1", port), 1.0):
                return
        except OSError:
            assert time.monotonic() < end, "the server does not answer"
            assert process.poll() is None, "the server has ended"
            time.sleep(0.05)


class Server:
    """A process that serves S3; its keys are lost when it ends."""

    def __init__(self, folder: Path, free_requests: int | None = None) -> None:
        """``free_requests``: requests that need no permission; None for all."""
        if find_spec("moto") is None:
            pytest.skip("the S3 server of the tests is not installed: pip install 'moto[server]'")
        port = free_port()
        self.address = f"http://127.0.0.1:{port}"
        extra = {} if free_requests is None else {"INITIAL_NO_AUTH_ACTION_COUNT": str(free_requests)}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)],
            env=os.environ | extra,
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_for(port, self._process)

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


@pytest.fixture
def google_bucket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """URL of a bucket in an emulator of Google Cloud Storage, which serves this test alone."""
    if find_spec("gcp_storage_emulator") is None:
        pytest.skip("the emulator of Google Cloud Storage is not installed: pip install gcp-storage-emulator")
    from airtruth.logs import remote

    port = free_port()
    start = [
        "start",
        "--host",
        "127.0.0.1",
        "--port",
        str(port),
        "--in-memory",
        "--default-bucket",
        "flights",
    ]
    process = subprocess.Popen(
        [sys.executable, "-c", "from gcp_storage_emulator.__main__ import main; main()", *start],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for(port, process)
        monkeypatch.setenv("CLOUD_STORAGE_EMULATOR_ENDPOINT", f"http://127.0.0.1:{port}")
        remote._file_system.cache_clear()
        yield "gs://flights"
    finally:
        remote._file_system.cache_clear()
        process.kill()
        process.wait()
