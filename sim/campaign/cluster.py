"""Flies a campaign on the workers of a dask.distributed scheduler; the results are the same as locally."""

import asyncio
import concurrent.futures
import contextlib
import logging
import socket
import time
import warnings
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from companion.errors import CompanionError, ConfigError
from sim.campaign.environment import Environment, difference, environment
from sim.campaign.plan import Inputs, Plan
from sim.campaign.results import ResultLine, Results
from sim.campaign.runner import WAITING_PER_WORKER, Task, fly_task, store, tasks_of

if TYPE_CHECKING:
    # Takes half a second to import: only `run_on` imports it.
    from distributed import Client, Future

_SCHEMES = ("", "tcp", "tls")
# Time limit for the connection; the user waits for it.
_CONNECT_S = 8.0
# Time limit for an answer: a scheduler may be busy, stopped or cut off.
_ANSWER_S = 30.0
# Period of checks for workers that joined or left.
_GLANCE_S = 1.0


def parse_scheduler_address(address: str) -> tuple[str, int]:
    """Host and port of HOST:PORT, optionally after tcp:// or tls://; `ConfigError` for anything else."""
    scheme, _, place = address.rpartition("://")
    host, _, port = place.rpartition(":")
    if scheme not in _SCHEMES or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ConfigError(
            f"--scheduler {address}: neither local nor an address such as tcp://192.168.1.7:8786"
        )
    return host.strip("[]"), int(port)


def run_on(
    address: str,
    plan: Plan,
    results: Results,
    *,
    on_flown: Callable[[int], None] = lambda _: None,
    on_notice: Callable[[str], None] = lambda _: None,
) -> None:
    """Fly the remaining encounters on a scheduler's workers, including workers that join later.

    `on_flown` gets the number newly flown, `on_notice` a text while no worker is there. The task of a worker
    that died is flown again by another. `ConfigError` if no scheduler answers at `address` or a worker has
    other versions; `CompanionError` if the scheduler is lost, or a task killed several workers. Results until
    then are kept, and no task stays queued.
    """
    with _quiet(), _connected(address) as client:
        _Cluster(address, client, plan, results).fly(on_flown, on_notice)


def fly_on_worker(task: Task, inputs: Inputs, wanted: Environment) -> list[ResultLine]:
    """Fly a task on a worker; `ConfigError` if its versions differ from the campaign machine's."""
    from distributed import get_worker

    plan, address = task[0], get_worker().address
    if found := difference(wanted, environment(plan.avoiders)):
        raise _refused(address, found)
    try:
        return fly_task(task, plan.source(inputs))
    except ConfigError as error:
        raise ConfigError(f"campaign: worker {address}: {error}") from error


def _refused(worker: str, found: str) -> ConfigError:
    return ConfigError(f"campaign: worker {worker} is refused: {found}")


def _as_task(inputs: Inputs) -> Inputs:
    """The inputs as the result of a task: workers copy it from each other, and recompute it if lost."""
    return inputs


class _Cluster:
    """One campaign on one scheduler."""

    def __init__(self, address: str, client: "Client", plan: Plan, results: Results) -> None:
        self._address, self._client, self._plan, self._results = address, client, plan, results
        self._flying: dict[Future[list[ResultLine]], Task] = {}
        self._wanted = environment(plan.avoiders)
        self._known: set[str] = set()

    def fly(self, on_flown: Callable[[int], None], on_notice: Callable[[str], None]) -> None:
        """Fly all remaining tasks."""
        tasks, inputs, waiting = tasks_of(self._plan, self._results), None, False
        task = next(tasks, None)
        while task is not None or self._flying:
            threads = self._threads()
            if threads and inputs is None:
                inputs = self._submit(_as_task, self._plan.inputs())
            if not threads and not waiting:
                on_notice(f"campaign: no worker at {self._address}; waiting for one")
            waiting = not threads
            while task is not None and len(self._flying) < threads * WAITING_PER_WORKER:
                self._flying[self._submit(fly_on_worker, task, inputs, self._wanted)] = task
                task = next(tasks, None)
            for future in self._done():
                if (flown := self._flown(future)) is not None:
                    del self._flying[future]
                    store(self._results, flown, on_flown)

    @contextlib.contextmanager
    def _connection_errors(self) -> Iterator[None]:
        from distributed.client import ClosedClientError

        lost = (OSError, ClosedClientError, asyncio.CancelledError, concurrent.futures.CancelledError)
        try:
            yield
        except lost as error:
            raise CompanionError(f"campaign: lost the scheduler {self._address}; {self._kept()}") from error

    def _kept(self) -> str:
        return f"{len(self._results.done)} results are kept, start again to continue"

    def _submit(self, function: Callable[..., Any], *arguments: object) -> "Future[Any]":
        # Not pure: each task has its own key, so that dask never returns a result of another campaign.
        with self._connection_errors():
            return self._client.submit(function, *arguments, pure=False)

    def _threads(self) -> int:
        """Number of tasks that the checked workers fly at a time."""
        scheduler: Any = self._client.scheduler
        with self._connection_errors():
            threads: dict[str, int] = self._client.sync(scheduler.ncores, callback_timeout=_ANSWER_S)
        if new := sorted(threads.keys() - self._known):
            self._check_workers(new)
        return sum(count for address, count in threads.items() if address in self._known)

    def _check_workers(self, workers: list[str]) -> None:
        """Raise `ConfigError` if a worker has other versions.

        This comes before the first task, which would kill a worker without this package, and without a
        message. Each task checks again, since the scheduler gives tasks to new workers at once.
        """
        with self._connection_errors():
            answers = self._client.run(environment, self._plan.avoiders, workers=workers, on_error="return")
        for worker, answer in answers.items():
            if isinstance(answer, OSError):  # left already
                continue
            if found := str(answer) if isinstance(answer, Exception) else difference(self._wanted, answer):
                raise _refused(worker, found)
            self._known.add(worker)

    def _done(self) -> list["Future[list[ResultLine]]"]:
        """The finished tasks, failed ones last; empty after a second without any."""
        from distributed import wait

        if not self._flying:
            time.sleep(_GLANCE_S)
            return []
        with self._connection_errors():
            try:
                done = wait(list(self._flying), timeout=_GLANCE_S, return_when="FIRST_COMPLETED").done
            except TimeoutError:
                return []
        return sorted(done, key=lambda future: future.status == "error")

    def _flown(self, future: "Future[list[ResultLine]]") -> list[ResultLine] | None:
        """The results of a task; `None` if its worker died, which repeats the task."""
        if future.status == "error":
            raise self._explained(future)
        with self._connection_errors():
            try:
                return future.result(timeout=_GLANCE_S)
            except TimeoutError:
                return None

    def _explained(self, future: "Future[list[ResultLine]]") -> BaseException:
        from distributed import KilledWorker

        error: BaseException = future.exception()
        _, avoider, _, numbers = self._flying[future]
        if isinstance(error, KilledWorker):
            killed = f"{error.allowed_failures + 1} workers died, the last {error.last_worker.address}"
            flights = f"encounters {numbers[0]} to {numbers[-1]} by {avoider}"
            return CompanionError(f"campaign: {flights}: {killed}; {self._kept()}")
        if isinstance(error, RuntimeError) and "deserialization" in str(error):
            return ConfigError(f"campaign: the scheduler {self._address} has another version of the package")
        return error


def _probe(address: str) -> None:
    """Raise `ConfigError` if no server listens there or it is silent; dask itself would wait for ever."""
    try:
        with socket.create_connection(parse_scheduler_address(address), timeout=_CONNECT_S) as probe:
            if not address.startswith("tls:"):  # with TLS the client sends first
                probe.settimeout(_CONNECT_S)
                probe.recv(1)
    except OSError as error:
        raise ConfigError(f"--scheduler {address}: {error.strerror or error}") from error


@contextlib.contextmanager
def _connected(address: str) -> Iterator["Client"]:
    _probe(address)
    import dask
    from distributed import Client

    with dask.config.set({"distributed.comm.timeouts.connect": _CONNECT_S}):
        try:
            client = Client(address, timeout=_CONNECT_S)
        except (TypeError, ImportError) as error:
            # No certificates, another kind of dask server, or an incompatible version.
            words = str(error).partition("\n")[0]
            raise ConfigError(f"--scheduler {address}: not a usable scheduler: {words}") from error
        except (OSError, ValueError, MemoryError) as error:
            # MemoryError: the first bytes of another protocol are read as a length.
            raise ConfigError(f"--scheduler {address}: the server there is no dask scheduler") from error
        try:
            yield client
        finally:
            # The scheduler drops the queued tasks of a closed client.
            client.close()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Suppress dask's own output; errors are reported in our words."""
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(logging.NOTSET)
