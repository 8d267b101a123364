"""Flies a campaign on the workers of a dask.distributed scheduler; by whom does not change the results."""

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
from sim.campaign.plan import Given, Plan
from sim.campaign.results import Result, Results
from sim.campaign.runner import WAITING_PER_WORKER, Task, fly_task, keep, tasks_of

if TYPE_CHECKING:
    # Takes half a second to import: `run_on` does it, and nobody else.
    from distributed import Client, Future

_SCHEMES = ("", "tcp", "tls")
# Within this a scheduler is there, or away. A user waits for it.
_CONNECT_S = 8.0
# One that is there may be busy; one that was stopped, or whose cable is cut, says nothing for ever.
_ANSWER_S = 30.0
# How often to look whether workers came or went.
_GLANCE_S = 1.0


def place_of(address: str) -> tuple[str, int]:
    """Host and port of HOST:PORT, with tcp:// or tls:// before it or not; otherwise `ConfigError`."""
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
    tell: Callable[[int], None] = lambda _: None,
    say: Callable[[str], None] = lambda _: None,
) -> None:
    """Fly what is left of a campaign on a scheduler's workers, those that join later too.

    `tell` hears how many more are flown, `say` in words what is waited for. What a worker had in hand when it
    died is flown again by another. `ConfigError` when nobody answers at `address`, or a worker has not what
    is here; `CompanionError` when the scheduler is lost, or a portion killed worker after worker. What was
    flown until then is kept, and nothing stays queued.
    """
    with _quiet(), _connected(address) as client:
        _Cluster(address, client, plan, results).fly(tell, say)


def fly_there(task: Task, given: Given, wanted: Environment) -> list[Result]:
    """Fly a portion on a worker; `ConfigError` when it has not what the campaign's own machine has."""
    from distributed import get_worker

    plan, address = task[0], get_worker().address
    if found := difference(wanted, environment(plan.avoiders)):
        raise _refused(address, found)
    try:
        return fly_task(task, plan.source(given))
    except ConfigError as error:
        raise ConfigError(f"campaign: worker {address}: {error}") from error


def _refused(worker: str, found: str) -> ConfigError:
    return ConfigError(f"campaign: worker {worker} is refused: {found}")


def _passed_on(given: Given) -> Given:
    """A task of its own: workers hand its result to each other, and make it again when they die."""
    return given


class _Cluster:
    """One campaign on one scheduler."""

    def __init__(self, address: str, client: "Client", plan: Plan, results: Results) -> None:
        self._address, self._client, self._plan, self._results = address, client, plan, results
        self._flying: dict[Future[list[Result]], Task] = {}
        self._wanted = environment(plan.avoiders)
        self._known: set[str] = set()

    def fly(self, tell: Callable[[int], None], say: Callable[[str], None]) -> None:
        """All that is left."""
        tasks, given, waiting = tasks_of(self._plan, self._results), None, False
        task = next(tasks, None)
        while task is not None or self._flying:
            threads = self._threads()
            if threads and given is None:
                given = self._submit(_passed_on, self._plan.given())
            if not threads and not waiting:
                say(f"campaign: no worker at {self._address} yet, or none any more; waiting for one")
            waiting = not threads
            while task is not None and len(self._flying) < threads * WAITING_PER_WORKER:
                self._flying[self._submit(fly_there, task, given, self._wanted)] = task
                task = next(tasks, None)
            for future in self._done():
                if (flown := self._flown(future)) is not None:
                    del self._flying[future]
                    keep(self._results, flown, tell)

    @contextlib.contextmanager
    def _in_touch(self) -> Iterator[None]:
        from distributed.client import ClosedClientError

        lost = (OSError, ClosedClientError, asyncio.CancelledError, concurrent.futures.CancelledError)
        try:
            yield
        except lost as error:
            raise CompanionError(f"campaign: lost the scheduler {self._address}; {self._kept()}") from error

    def _kept(self) -> str:
        return f"{len(self._results.done)} results are kept, start again to go on"

    def _submit(self, function: Callable[..., Any], *arguments: object) -> "Future[Any]":
        # Not pure: a key of its own, so that what another campaign had flown is never taken for ours.
        with self._in_touch():
            return self._client.submit(function, *arguments, pure=False)

    def _threads(self) -> int:
        """How many portions the workers fly at a time; none that we do not know is among them."""
        scheduler: Any = self._client.scheduler
        with self._in_touch():
            threads: dict[str, int] = self._client.sync(scheduler.ncores, callback_timeout=_ANSWER_S)
        if new := sorted(threads.keys() - self._known):
            self._meet(new)
        return sum(count for address, count in threads.items() if address in self._known)

    def _meet(self, workers: list[str]) -> None:
        """`ConfigError` when one has not what is here.

        Asked before it is sent anything: one without this package would die of the first task, wordlessly.
        Each task asks again, since the scheduler does not wait for us before it gives one to who just came.
        """
        with self._in_touch():
            answers = self._client.run(environment, self._plan.avoiders, workers=workers, on_error="return")
        for worker, answer in answers.items():
            if isinstance(answer, OSError):  # gone already
                continue
            if found := str(answer) if isinstance(answer, Exception) else difference(self._wanted, answer):
                raise _refused(worker, found)
            self._known.add(worker)

    def _done(self) -> list["Future[list[Result]]"]:
        """Those that need no more waiting for, the failed last; none when there are none for a second."""
        from distributed import wait

        if not self._flying:
            time.sleep(_GLANCE_S)
            return []
        with self._in_touch():
            try:
                done = wait(list(self._flying), timeout=_GLANCE_S, return_when="FIRST_COMPLETED").done
            except TimeoutError:
                return []
        return sorted(done, key=lambda future: future.status == "error")

    def _flown(self, future: "Future[list[Result]]") -> list[Result] | None:
        """What a portion gave; `None` when the worker died that had flown it, so that it is flown again."""
        if future.status == "error":
            raise self._explained(future)
        with self._in_touch():
            try:
                return future.result(timeout=_GLANCE_S)
            except TimeoutError:
                return None

    def _explained(self, future: "Future[list[Result]]") -> BaseException:
        from distributed import KilledWorker

        error: BaseException = future.exception()
        _, avoider, _, numbers = self._flying[future]
        if isinstance(error, KilledWorker):
            killed = f"{error.allowed_failures + 1} workers died of it, the last {error.last_worker.address}"
            portion = f"encounters {numbers[0]} to {numbers[-1]} by {avoider}"
            return CompanionError(f"campaign: {portion}: {killed}; {self._kept()}")
        if isinstance(error, RuntimeError) and "deserialization" in str(error):
            return ConfigError(f"campaign: the scheduler {self._address} has not this version of the package")
        return error


def _knock(address: str) -> None:
    """`ConfigError` when nobody listens there, or is silent: dask tries on and on, or waits for ever."""
    try:
        with socket.create_connection(place_of(address), timeout=_CONNECT_S) as knocking:
            if not address.startswith("tls:"):  # there the client begins
                knocking.settimeout(_CONNECT_S)
                knocking.recv(1)
    except OSError as error:
        raise ConfigError(f"--scheduler {address}: {error.strerror or error}") from error


@contextlib.contextmanager
def _connected(address: str) -> Iterator["Client"]:
    _knock(address)
    import dask
    from distributed import Client

    with dask.config.set({"distributed.comm.timeouts.connect": _CONNECT_S}):
        try:
            client = Client(address, timeout=_CONNECT_S)
        except (TypeError, ImportError) as error:
            # No certificates, another of dask's servers, or a version too different.
            words = str(error).partition("\n")[0]
            raise ConfigError(f"--scheduler {address}: no scheduler that we can talk to: {words}") from error
        except (OSError, ValueError, MemoryError) as error:
            # The last when another protocol's first bytes are taken for a length.
            raise ConfigError(f"--scheduler {address}: what answers there is no dask scheduler") from error
        try:
            yield client
        finally:
            # What is queued goes with the client that wanted it.
            client.close()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Nothing of dask's own on the terminal: what matters is said in our words."""
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(logging.NOTSET)
