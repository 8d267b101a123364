"""Serial links over pseudo-terminals: unplugging, plugging in again, and a full port."""

import asyncio
import os
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from companion.errors import LinkDownError
from companion.links import LinkState, Reconnect, SerialLink, open_link
from tests.support.inbox import Inbox, frame, until

OPEN = (LinkState.ON_TRIAL, LinkState.UP)


class Device:
    """The device at the other end of the cable, plugged in under a constant name."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self.master = -1

    def plug_in(self) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self.master, False)
        self.name.unlink(missing_ok=True)
        self.name.symlink_to(os.ttyname(slave))
        os.close(slave)

    def unplug(self) -> None:
        if self.master >= 0:
            os.close(self.master)
        self.master = -1
        self.name.unlink(missing_ok=True)

    def send(self, data: bytes) -> None:
        os.write(self.master, data)

    def heard(self) -> bytes:
        try:
            return os.read(self.master, 65_536)
        except (BlockingIOError, OSError):
            return b""


@pytest.fixture
def device(tmp_path: Path) -> Iterator[Device]:
    device = Device(tmp_path / "ttyACM0")
    yield device
    device.unplug()


def link_to(device: Device, rest: str = ":115200") -> SerialLink:
    link = open_link(f"serial:{device.name}{rest}")
    assert isinstance(link, SerialLink)
    return link


async def test_both_ways(device: Device) -> None:
    device.plug_in()
    link, heard = link_to(device), Inbox()
    running = asyncio.create_task(link.run(heard))
    await link.open()
    sent = [frame(number) for number in range(20)]
    stream = b"\x00boot text\r\n" + b"".join(sent)
    for start in range(0, len(stream), 11):
        device.send(stream[start : start + 11])
        await asyncio.sleep(0)
    await heard.until(20)
    assert heard.raws == sent
    answer = frame(5)
    link.send(answer)
    assert device.heard() == answer
    assert (link.counters.sent_frames, link.counters.sent_bytes) == (1, len(answer))
    link.close()
    await running
    link.send(frame())
    assert link.counters.send_errors == 1


async def test_a_missing_device_is_named_and_waited_for(device: Device) -> None:
    link, heard = link_to(device), Inbox()
    with pytest.raises(LinkDownError, match=f"^{link.address}: No such file or directory$"):
        await link.open()
    reconnect = Reconnect(link)
    running = asyncio.create_task(reconnect.run(heard))
    await until(lambda: reconnect.state is LinkState.WAITING)
    device.plug_in()
    await until(lambda: reconnect.state in OPEN)
    device.send(frame())
    await heard.until(1)
    link.close()
    await running


async def test_a_device_unplugged_and_plugged_in_again_is_reopened(device: Device) -> None:
    device.plug_in()
    link, heard = link_to(device), Inbox()
    reconnect = Reconnect(link)
    running = asyncio.create_task(reconnect.run(heard))
    await until(lambda: reconnect.state in OPEN)
    device.send(frame(1) + frame(2)[:8])
    await heard.until(1)
    device.unplug()
    await until(lambda: reconnect.state is LinkState.WAITING)
    link.send(frame())
    assert link.counters.send_errors == 1
    device.plug_in()
    await until(lambda: reconnect.state in OPEN)
    third = frame(3)
    device.send(third)
    await heard.until(2)
    assert heard.raws[1] == third
    link.send(third)
    assert device.heard() == third
    link.close()
    await running


async def test_a_device_that_is_gone_does_not_keep_the_loop_busy(device: Device) -> None:
    device.plug_in()
    link = link_to(device)
    await link.open()
    reads = 0
    read = link._read

    def counted() -> None:
        nonlocal reads
        reads += 1
        read()

    assert link._port is not None
    asyncio.get_running_loop().add_reader(link._port.fileno(), counted)
    device.unplug()
    for _ in range(50):
        await asyncio.sleep(0.001)
    assert reads == 1
    with pytest.raises(LinkDownError):
        await link.run(Inbox())
    link.close()


async def test_a_full_port_drops_frames_whole_and_counts_them(device: Device) -> None:
    device.plug_in()
    link = link_to(device)
    running = asyncio.create_task(link.run(Inbox()))
    await link.open()
    sent = []
    for number in range(20_000):
        raw = frame(number % 1000)
        before = link.counters.sent_frames
        link.send(raw)
        if link.counters.sent_frames > before:
            sent.append(raw)
        if link.counters.send_errors == 100:
            break
    assert link.counters.send_errors == 100, "the port never filled up"
    received = b""
    for _ in range(100):
        received += device.heard()
        await asyncio.sleep(0.001)
    assert received == b"".join(sent), "whole frames only, and the rest of the one sent in part"
    late = frame(1)
    link.send(late)
    assert device.heard() == late
    link.close()
    await running


async def test_a_port_is_opened_by_one_program_only(device: Device) -> None:
    device.plug_in()
    first, second = link_to(device), link_to(device)
    await first.open()
    with pytest.raises(LinkDownError, match="in use by another program"):
        await second.open()
    first.close()
    await second.open()
    second.close()


async def test_a_file_that_is_not_a_serial_port_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.touch()
    with pytest.raises(LinkDownError) as refusal:
        await open_link(f"serial:{path}").open()
    assert str(refusal.value).startswith(f"serial:{path}: ")
    assert "\n" not in str(refusal.value)


async def test_listen_only_never_sends(device: Device) -> None:
    device.plug_in()
    link, heard = link_to(device, "?listen"), Inbox()
    running = asyncio.create_task(link.run(heard))
    await link.open()
    link.send(frame())
    device.send(frame())
    await heard.until(1)
    assert device.heard() == b""
    assert (link.counters.sent_frames, link.counters.send_errors) == (0, 0)
    link.close()
    await running
