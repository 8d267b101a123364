"""Serial ports: one peer, one stream; what the port does not take at once is forgotten."""

import asyncio
import contextlib
import errno
import os
import termios

from serial import Serial

from companion.address import DEFAULT_BAUD
from companion.links.queued import QueuedLink, in_words
from companion.mavlink.framing import Frame, FrameSplitter

_READ_BYTES = 4_096  # what the kernel holds of a terminal at most


class SerialLink(QueuedLink[None]):
    """A device opened for us alone, eight bits, no parity, one stop bit, no flow control."""

    def __init__(
        self, address: str, device: str, baud: int = DEFAULT_BAUD, *, listen_only: bool = False
    ) -> None:
        super().__init__(address, listen_only=listen_only)
        self._device = device
        self._baud = baud
        self._port: Serial | None = None
        self._splitter = FrameSplitter(self.counters)
        self._rest = b""  # of a frame that has begun to go out: cut in two it would spoil the next one

    def _send(self, data: bytes) -> None:
        if self._port is None or self._rest:
            self.counters.send_errors += 1
            return
        written = self._write(self._port.fileno(), data)
        if written == 0:
            self.counters.send_errors += 1
            return
        self.counters.sent_frames += 1
        self.counters.sent_bytes += len(data)
        if written < len(data):
            self._rest = data[written:]
            asyncio.get_running_loop().add_writer(self._port.fileno(), self._write_rest)

    def _write(self, descriptor: int, data: bytes) -> int:
        """How many bytes the port took; none when it is full or gone."""
        # Not by pyserial: with a timeout of zero it tries for ever when the port is full.
        try:
            return os.write(descriptor, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            self._gone(in_words(error))
            return 0

    def _write_rest(self) -> None:
        if self._port is None:
            return
        descriptor = self._port.fileno()
        self._rest = self._rest[self._write(descriptor, self._rest) :]
        if not self._rest or self._failure is not None:
            asyncio.get_running_loop().remove_writer(descriptor)

    def _read(self) -> None:
        if self._port is None:
            return
        try:
            data = os.read(self._port.fileno(), _READ_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self._gone(in_words(error))
            return
        if data:
            self.arrived(None, data)
        else:
            self._gone("unplugged")

    def _gone(self, reason: str) -> None:
        if self._port is not None:  # a device that is gone stays readable: it would keep the loop busy
            asyncio.get_running_loop().remove_reader(self._port.fileno())
        self.failed(reason)

    def _split(self, source: None, data: bytes) -> list[Frame]:  # noqa: ARG002 - there is one peer
        return self._splitter.feed(data)

    @property
    def _is_open(self) -> bool:
        return self._port is not None

    async def _connect(self) -> None:
        self._splitter, self._rest = FrameSplitter(self.counters), b""
        # A USB device that hangs takes seconds to refuse its settings.
        port = await asyncio.to_thread(self._open_port)
        self._port = port
        asyncio.get_running_loop().add_reader(port.fileno(), self._read)

    def _open_port(self) -> Serial:
        try:
            return Serial(self._device, self._baud, timeout=0, write_timeout=0, exclusive=True)
        except (ValueError, termios.error) as error:
            raise OSError(f"cannot be used at {self._baud} baud: {error}") from error
        except OSError as error:
            if error.errno == errno.EACCES:  # udev gives a new device to its group a moment later
                raise OSError(os.strerror(errno.EACCES)) from error
            if error.errno == errno.EAGAIN:
                raise OSError("another program has it") from error
            raise

    def _disconnect(self) -> None:
        port, self._port = self._port, None
        if port is None:
            return
        loop = asyncio.get_running_loop()
        loop.remove_reader(port.fileno())
        loop.remove_writer(port.fileno())
        with contextlib.suppress(OSError, termios.error):
            port.reset_output_buffer()  # or closing waits until everything has gone out
        port.close()
