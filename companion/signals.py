"""Signals: those that end the service, after the aircraft is given back, and those that are ignored.

A second signal does not cut the release short: it takes a few seconds at most, and without it the aircraft
would be left in its guided mode. SIGKILL ends the service at once; the next run then gives the aircraft back.

Not caught: SIGKILL and SIGSTOP, which cannot be; SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP and SIGSYS, after
which the process is broken; and SIGABRT, which a service manager sends to a service that hangs. The next run
gives the aircraft back.
"""

import asyncio
import contextlib
import signal
from collections.abc import Callable, Iterator

ENDING = {
    signal.SIGTERM: "the service manager stops the service",
    signal.SIGINT: "Ctrl-C",
    signal.SIGQUIT: "Ctrl-\\",
    signal.SIGPWR: "the power fails, the computer will go down",
    signal.SIGXCPU: "the limit of computing time is reached, the kernel will kill the service",
}
IGNORED = {
    signal.SIGHUP: "a terminal or a remote session is gone: no reason to stop avoiding in flight",
    signal.SIGPIPE: "the reader of the log is gone",
    signal.SIGXFSZ: "a file is too large: writing fails, and that is reported",
    # A stopped service would leave the aircraft in its guided mode.
    signal.SIGTSTP: "Ctrl-Z",
    signal.SIGTTIN: "reading from a terminal in the background",
    signal.SIGTTOU: "writing to a terminal in the background",
    # No one sends these for a reason that is known here, and they would end the service at once.
    signal.SIGUSR1: "no meaning",
    signal.SIGUSR2: "no meaning",
    signal.SIGALRM: "no timer of ours",
    signal.SIGVTALRM: "no timer of ours",
    signal.SIGPROF: "no timer of ours",
    signal.SIGIO: "no descriptor of ours",
    signal.SIGSTKFLT: "no meaning",
    **dict.fromkeys(range(signal.SIGRTMIN, signal.SIGRTMAX + 1), "no meaning"),
}


def exit_on_ending() -> None:
    """Exit with code 0 at a signal of `ENDING`, until `handled`; ignore those of `IGNORED`."""
    for number in IGNORED:
        signal.signal(number, signal.SIG_IGN)
    for number in ENDING:
        signal.signal(number, _exit)


def _exit(_number: int, _frame: object) -> None:
    raise SystemExit(0)


@contextlib.contextmanager
def handled(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` at a signal of `ENDING`, after `exit_on_ending`; in the main thread only."""
    loop = asyncio.get_running_loop()
    with contextlib.ExitStack() as undo:
        for number in ENDING:
            loop.add_signal_handler(number, stop)
            undo.callback(loop.remove_signal_handler, number)
        yield
