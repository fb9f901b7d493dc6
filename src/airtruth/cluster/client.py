"""A connection to a Dask scheduler: its workers checked, and a function mapped over items.

The scheduler persists nothing, and a function may run twice: a function that is mapped has to be idempotent, and the caller
records what is done.
"""

from __future__ import annotations

import os
import platform
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, Final, TypeVar

from airtruth.cluster.address import Address, parse
from airtruth.errors import ConfigurationError, StoreError, reason
from airtruth.isolation.interpreter import HOME

if TYPE_CHECKING:
    from distributed import Client, Future

Item = TypeVar("Item")
Result = TypeVar("Result")

CONNECT_S: Final = 10.0
"""Time within which a scheduler has to answer [s] (judgement: a loaded one answers within seconds)."""
WORKERS_S: Final = 60.0
"""Time within which the first worker has to appear [s] (judgement: a job of a batch queue that starts at once)."""
POLL_S: Final = 1.0
"""Period at which the connection is checked while tasks run [s] (judgement: a loss is reported within seconds)."""
AHEAD: Final = 2
"""Tasks in the cluster for each thread of it (judgement: one that runs and one that waits, so that no thread idles)."""
AGREEING: Final = ("airtruth", "jsbsim", "numpy", "scipy", "pandas", "pyarrow", "numba")
"""Packages whose versions have to agree on all machines: results are the same bytes only then."""


class LostWorkError(Exception):
    """The workers that performed a task died each time."""


def versions() -> dict[str, str]:
    """Versions on this machine of Python and of the packages that have to agree."""
    found = {"python": ".".join(platform.python_version_tuple()[:2])}
    for name in AGREEING:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found


class Cluster:
    """A cluster whose workers have been checked; made by `connected`."""

    def __init__(self, client: Client, address: Address) -> None:
        self._client = client
        self._address = address

    def completed(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Generator[tuple[Item, Result | LostWorkError], None, None]:
        """Call a function with each item on the workers; yield item and result in the order of completion.

        Parameters
        ----------
        function : importable on the workers and idempotent, since it may run twice.
        items : its arguments; one is taken when a worker is nearly free, so that the memory holds few.

        Raises
        ------
        AirtruthError
            That of the function.
        StoreError
            If the connection to the scheduler is lost.
        """
        from distributed import wait

        waiting = iter(items)
        running: dict[Future[Any], Item] = {}
        try:
            self._submit(function, waiting, running)
            while running:
                try:
                    with self._client.as_current():
                        done = wait(list(running), timeout=POLL_S, return_when="FIRST_COMPLETED").done
                except TimeoutError:
                    self._require_connection()
                    continue
                for future in [f for f in running if f in done]:
                    item, result = running.pop(future), self._result(future)
                    # while anything refers to a result, Dask performs its task again when the worker that keeps it dies
                    future.release()
                    yield item, result
                self._submit(function, waiting, running)
        finally:
            for future in running:
                future.cancel()

    def _submit(
        self, function: Callable[[Item], Result], waiting: Iterator[Item], running: dict[Any, Item]
    ) -> None:
        try:
            threads = sum(self._client.nthreads().values())
        except OSError:
            raise self._lost() from None
        most = AHEAD * max(1, threads)
        while len(running) < most:
            try:
                item = next(waiting)
            except StopIteration:
                return
            running[self._client.submit(function, item, pure=False)] = item

    def _result(self, future: Future[Any]) -> Any:
        from concurrent.futures import CancelledError

        from distributed.comm import CommClosedError
        from distributed.scheduler import KilledWorker

        if future.status in ("cancelled", "lost"):
            raise self._lost()
        try:
            return future.result()
        except KilledWorker as error:
            return LostWorkError(reason(error))
        except (CommClosedError, CancelledError):
            raise self._lost() from None

    def _require_connection(self) -> None:
        if self._client.status != "running":
            raise self._lost()

    def _lost(self) -> StoreError:
        return StoreError(
            f"--cluster {self._address.text}: the connection to the scheduler was lost; what is recorded stays, and the "
            "same command continues"
        )

    def check_versions(self) -> None:
        """Refuse workers whose versions differ from those of this process.

        Raises
        ------
        ConfigurationError
            Naming the worker, the package and both versions.
        """
        own = versions()
        for worker, found in sorted(self._client.run(versions).items()):
            for name, mine in own.items():
                if found.get(name) != mine:
                    raise ConfigurationError(
                        f"--cluster {self._address.text}: worker {worker} has {name} {found.get(name)}, this machine {mine}; "
                        "install the same versions on all machines (requirements.lock)"
                    )


@contextmanager
def connected(text: str) -> Iterator[Cluster]:
    """A cluster at an address; its processes end with the context if it is local.

    Parameters
    ----------
    text : see `airtruth.cluster.address.parse`.

    Raises
    ------
    ConfigurationError
        If the address is malformed, nothing answers there, no worker appears, versions differ, or dask.distributed is
        not installed.
    """
    address = parse(text)
    try:
        import distributed
    except ImportError:
        raise ConfigurationError(
            f"--cluster {text}: needs dask.distributed; install it with: pip install 'airtruth[cluster]'"
        ) from None
    _configure()
    with _processes(address) as target:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of other versions: `check_versions` refuses them
                client = distributed.Client(target, timeout=CONNECT_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise ConfigurationError(
                f"--cluster {text}: no scheduler answers within {CONNECT_S:.0f} s ({reason(error)}); start one with "
                "`dask scheduler`, or use local:N"
            ) from None
        with client:
            try:
                client.wait_for_workers(1, timeout=WORKERS_S)
            except TimeoutError:
                raise ConfigurationError(
                    f"--cluster {text}: the scheduler has no worker after {WORKERS_S:.0f} s; start one with "
                    f"`dask worker {address.scheduler} --nthreads 1`"
                ) from None
            cluster = Cluster(client, address)
            cluster.check_versions()
            yield cluster


@contextmanager
def workers(text: str | None) -> Iterator[Cluster | None]:
    """`connected`, or None without an address: the work is done on this machine."""
    if text is None:
        yield None
        return
    with connected(text) as cluster:
        yield cluster


def _configure() -> None:
    """No dashboard, no log of what was sent, and no messages of Dask's own: a lost worker is an ordinary event."""
    import logging

    import dask

    dask.config.set(
        {
            "distributed.worker.daemon": False,  # a worker starts processes of its own
            "distributed.scheduler.dashboard.status.task-stream-length": 0,
            "distributed.admin.low-level-log-length": 0,  # of messages, each with the runs of a chunk
            "distributed.comm.timeouts.connect": CONNECT_S,
        }
    )
    for name in (
        "distributed",
        "distributed.nanny",
        "distributed.scheduler",
        "distributed.worker",
        "tornado",
    ):
        logging.getLogger(name).setLevel(logging.CRITICAL)


@contextmanager
def _processes(address: Address) -> Iterator[Any]:
    """Address for a client: processes on this machine that end with the context, or the scheduler's URL."""
    if address.local is None:
        yield address.scheduler
        return
    from distributed import LocalCluster

    # a worker never imports a module from the working folder
    path = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(HOME), *([path] if path else [])])
    with LocalCluster(
        n_workers=address.local,
        threads_per_worker=1,
        processes=True,
        dashboard_address="127.0.0.1:0",  # of any free port: 8787 may belong to another cluster
        memory_limit=0,
        silence_logs=50,
    ) as cluster:
        yield cluster


__all__ = ["AGREEING", "Cluster", "LostWorkError", "connected", "versions", "workers"]
