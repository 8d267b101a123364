"""Serial ports: one peer and one stream; frames that the port cannot accept at once are dropped."""

import asyncio
import contextlib
import errno
import os
import termios

from serial import Serial

from companion.address import DEFAULT_BAUD
from companion.links.content import MAVLINK, Content, Reader
from companion.links.queued import QueuedLink
from companion.links.sockets import error_text
from companion.mavlink.framing import Frame

_READ_BYTES = 4_096  # the most that the kernel buffers for a terminal


class SerialLink(QueuedLink[None]):
    """A device opened exclusively: eight bits, no parity, one stop bit, no flow control."""

    def __init__(
        self,
        address: str,
        device: str,
        baud: int = DEFAULT_BAUD,
        *,
        listen_only: bool = False,
        content: Content = MAVLINK,
    ) -> None:
        super().__init__(address, listen_only=listen_only, content=content)
        self._device = device
        self._baud = baud
        self._port: Serial | None = None
        self._reader: Reader = content.new_reader(self.counters)
        self._rest = b""  # of a frame that was sent in part: without it the next frame would be damaged too

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
        """The number of bytes that the port accepted; 0 when it is full or gone."""
        # Not with pyserial: with a timeout of zero it retries for ever while the port is full.
        try:
            return os.write(descriptor, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            self._lose(error_text(error))
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
            self._lose(error_text(error))
            return
        if data:
            self.arrived(None, data)
        else:
            self._lose("unplugged")

    def _lose(self, reason: str) -> None:
        if self._port is not None:  # a device that is gone stays readable and would keep the loop busy
            asyncio.get_running_loop().remove_reader(self._port.fileno())
        self.failed(reason)

    def _split(self, source: None, data: bytes) -> list[Frame]:  # noqa: ARG002 - there is only one peer
        return self._reader.feed(data)

    @property
    def _is_open(self) -> bool:
        return self._port is not None

    async def _connect(self) -> None:
        self._reader, self._rest = self.content.new_reader(self.counters), b""
        # In a thread: a USB device that hangs takes seconds to refuse its settings.
        port = await asyncio.to_thread(self._open_port)
        self._port = port
        asyncio.get_running_loop().add_reader(port.fileno(), self._read)

    def _open_port(self) -> Serial:
        try:
            return Serial(self._device, self._baud, timeout=0, write_timeout=0, exclusive=True)
        except (ValueError, termios.error) as error:
            raise OSError(f"cannot be used at {self._baud} baud: {error}") from error
        except OSError as error:
            if error.errno == errno.EACCES:  # temporary: udev sets the group of a new device a moment later
                raise OSError(os.strerror(errno.EACCES)) from error
            if error.errno == errno.EAGAIN:
                raise OSError("in use by another program") from error
            raise

    def _disconnect(self) -> None:
        port, self._port = self._port, None
        if port is None:
            return
        loop = asyncio.get_running_loop()
        loop.remove_reader(port.fileno())
        loop.remove_writer(port.fileno())
        with contextlib.suppress(OSError, termios.error):
            port.reset_output_buffer()  # otherwise closing waits until everything is sent
        port.close()
