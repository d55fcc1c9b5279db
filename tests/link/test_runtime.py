"""The client against the real runtime in this process, by packets and over a simulated serial line, good and bad."""

from __future__ import annotations

import platform
import random
from collections.abc import Iterator

import pytest
from fake_device import damage
from hypothesis import given
from hypothesis import strategies as st
from shares import examples
from small_app import RETURN, make_application

from plctool.core import ffi, lib
from plctool.device import Plc
from plctool.errors import DeviceError, LinkError
from plctool.link import services
from plctool.link.connection import Connection
from plctool.link.session import Session
from plctool.link.sim import SimTransport
from plctool.link.transport import BlockTransport
from plctool.testing.sim_line import SimSerial


@pytest.fixture(autouse=True)
def runtime() -> Iterator[None]:
    power_on()
    yield
    lib.SimStop()


def power_on() -> None:
    """A controller fresh from the factory."""
    lib.SimStop()
    assert lib.SimFlashConfigure(1 << 20, 4096, 8, 0xFF) == lib.ERR_OK
    assert lib.SimStart() == lib.ERR_OK


@pytest.fixture(params=[SimTransport, SimSerial], ids=["packets", "serial"])
def session(request: pytest.FixtureRequest) -> Session:
    transport: BlockTransport = request.param()
    return Session(Connection(transport))


def test_the_runtime_is_found_and_names_itself(session: Session) -> None:
    (node,) = session.connection.scan(0.3)
    identity = services.read_identity(session)
    assert (node.node_name, node.device_name) == (identity.node_name, identity.device_name)
    assert node.target_type == lib.TARGET_TYPE_PROGRAMMABLE


def test_an_empty_runtime_says_so_everywhere(session: Session) -> None:
    status = services.read_status(session)
    assert (status.state, status.image_crc, status.exception) == ("none", 0, None)
    assert services.read_tasks(session) == []
    for service in (services.start, services.stop, services.read_application_info):
        with pytest.raises(DeviceError):
            service(session)


@pytest.mark.parametrize("size", [1, 455, 456, 457, 1000, 16000])
def test_echoes_of_all_sizes_come_back(session: Session, size: int) -> None:
    data = random.Random(size).randbytes(size)
    assert services.echo(session, data) == data


def test_the_log_can_be_read(session: Session) -> None:
    assert any("boot project" in entry.text for entry in services.read_log(session))


def test_what_is_no_image_is_refused_with_a_reason(session: Session) -> None:
    with pytest.raises(DeviceError, match=r"download: .+ \(ERR_"):
        services.download(session, random.Random(1).randbytes(5000))
    assert services.read_status(session).state == "none"


def test_a_session_survives_long_silence(session: Session) -> None:
    services.echo(session, b"before")
    assert lib.SimAdvance(40 * 10**9) == lib.ERR_OK
    assert services.echo(session, b"after") == b"after"


def test_a_session_survives_a_restart_of_the_runtime(session: Session) -> None:
    services.echo(session, b"before")
    lib.SimStop()
    assert lib.SimStart() == lib.ERR_OK
    assert services.echo(session, b"after") == b"after"


def test_a_second_client_learns_that_the_device_is_busy() -> None:
    first, second = Session(Connection(SimTransport())), Session(Connection(SimSerial()))
    services.echo(first, b"mine")
    with pytest.raises(LinkError, match="busy"):
        services.echo(second, b"mine?")
    first.connection.close()
    assert services.echo(second, b"mine") == b"mine"


@examples(10)
@given(st.integers(0, 2**32), st.sampled_from([0.0003, 0.001]))
def test_over_bad_lines_everything_arrives_intact(seed: int, rate: float) -> None:
    power_on()
    session = Session(Connection(SimSerial(damage(seed, rate), damage(seed + 1, rate))))
    rng = random.Random(seed)
    for size in (10, 3000, 100, 9000):
        data = rng.randbytes(size)
        assert services.echo(session, data) == data


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the application's code is for x86-64")
@examples(5)
@given(st.integers(0, 2**32))
def test_what_runs_after_a_download_over_a_bad_line_is_what_was_sent(seed: int) -> None:
    power_on()
    image, symbols = make_application(code_size=20_000)
    session = Session(Connection(SimSerial(damage(seed, 0.001), damage(seed + 1, 0.001))))
    services.download(session, image)
    services.start(session)
    status = services.read_status(session)
    assert (status.state, status.image_crc) == ("run", symbols.image_crc)
    code = lib.AppGetAreaAddress(lib.APP_AREA_CODE, 0, 20_000)
    assert bytes(ffi.buffer(code, 20_000)) == RETURN * 20_000


def test_19_of_20_bytes_on_the_line_are_of_the_image() -> None:
    image, _ = make_application(code_size=60_000)
    line = SimSerial()
    line.is_slow = False
    session = Session(Connection(line))
    session.ensure()
    begin = line.now()
    services.download(session, image)
    assert len(image) / (line.now() - begin) / line.byte_rate > 0.95


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the application's code is for x86-64")
def test_a_small_image_has_two_thirds_of_the_line_from_the_first_request_until_it_runs() -> None:
    image, _ = make_application(code_size=2300)
    assert 2400 < len(image) < 2600
    line = SimSerial()
    line.is_slow = False
    with Plc(Connection(line)) as plc:
        assert plc.flash(image).state == "run"
        assert len(image) / line.now() / line.byte_rate > 0.67


def test_large_messages_use_nine_tenths_of_the_line_both_ways() -> None:
    session = Session(Connection(SimSerial()))
    session.ensure()
    begin, size = session.connection.transport.now(), session.connection.buffer_size - 128
    for _ in range(4):
        services.echo(session, bytes(size))
    seconds = session.connection.transport.now() - begin
    assert 4 * 2 * size / seconds / session.connection.transport.byte_rate > 0.9
