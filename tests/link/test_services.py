"""Services against a device in Python: what is asked, what is answered, what happens when the line fails on the way."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress

import pytest
from fake_device import (
    DEVICE_NAME,
    NODE_NAME,
    SERIAL,
    VENDOR_NAME,
    FakeDevice,
    FakeLine,
    FakePlc,
    damage,
    image_crc,
    make_image,
)
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.core import lib
from plctool.device import Plc
from plctool.errors import DeviceError, LinkError
from plctool.link import bintag, file_services, l7, monitoring, services
from plctool.link.connection import Connection
from plctool.link.monitoring import AreaRange, Write
from plctool.link.services import AppException, AppState
from plctool.link.session import Request, Session


class Bench:
    """A session with a fake controller that has an application, and everything around it."""

    def __init__(self, buffer_size: int = 16384, **line: object) -> None:
        self.plc = FakePlc()
        self.plc.image, self.plc.state = make_image(1000), lib.AS_RUN
        self.device = FakeDevice(self.plc.handle, buffer_size)
        self.line = FakeLine(self.device, **line)  # type: ignore[arg-type]
        self.session = Session(Connection(self.line))

    @property
    def crc(self) -> int:
        return self.plc.crc


# ---- layer 7 ---------------------------------------------------------------------------------------------------------


def test_a_message_has_the_bytes_of_the_capture() -> None:
    message = l7.Message(1, 7, 0x8EEF560B, b"")
    assert l7.encode(message) == bytes.fromhex("55CD1000010007000B56EF8E0000000000000000")
    assert l7.decode(l7.encode(message)) == message


def test_short_headers_are_understood() -> None:
    assert l7.decode(bytes.fromhex("55CD0C0081000700 0B56EF8E 01000000 AA".replace(" ", ""))) == l7.Message(
        0x81, 7, 0x8EEF560B, b"\xaa"
    )


@pytest.mark.parametrize(
    "data",
    [
        b"",
        bytes(20),
        bytes.fromhex("55CD1000010007000B56EF8E0100000000000000"),  # content missing
        bytes.fromhex("55CDFF00010007000B56EF8E0000000000000000"),  # header longer than the message
        bytes.fromhex("55CD0400010007000B56EF8E0000000000000000"),  # header too short
    ],
)
def test_broken_headers_are_link_errors(data: bytes) -> None:
    with pytest.raises(LinkError):
        l7.decode(data)


def test_the_answer_to_something_else_is_a_link_error() -> None:
    request = l7.Message(1, 2, 0, b"")
    with pytest.raises(LinkError, match="not for the request"):
        l7.decode_reply(l7.encode(l7.Message(0x81, 3, 0, b"")), request)


def test_a_service_error_becomes_a_device_error_with_its_name() -> None:
    bench = Bench()
    with pytest.raises(DeviceError, match="ERR_L7_UNKNOWNCMD") as caught:
        bench.session.call(9, 9)
    assert caught.value.code == "l7-unknowncmd"
    assert caught.value.result == lib.ERR_L7_UNKNOWNCMD


_STATUS = Request(lib.SG_APPLICATION, lib.SRV_APP_READ_STATUS)
_ECHO = Request(lib.SG_DEVICE, lib.SRV_DEV_ECHO, [bintag.raw(lib.TAG_DEV_ECHO_DATA, b"ping")])


def test_requests_in_one_go_take_less_time_than_one_after_the_other() -> None:
    bench = Bench()
    bench.session.ensure()
    begin = bench.line.now()
    status, echo = bench.session.call_each([_STATUS, _ECHO])
    both = bench.line.now() - begin
    assert status.find(lib.TAG_ERROR) is None and echo.bytes(lib.TAG_DEV_ECHO_DATA) == b"ping"
    begin = bench.line.now()
    for request in (_STATUS, _ECHO):
        bench.session.call(request.group, request.service, request.tags)
    assert both < 0.75 * (bench.line.now() - begin)


def test_the_error_of_one_of_several_requests_is_raised() -> None:
    bench = Bench()
    with pytest.raises(DeviceError, match="ERR_L7_UNKNOWNCMD"):
        bench.session.call_each([Request(9, 9), _STATUS])
    assert services.read_status(bench.session).state is AppState.RUN


def test_requests_in_one_go_are_repeated_after_the_login_has_ended() -> None:
    bench = Bench()
    services.read_status(bench.session)
    bench.plc.LOGIN += 1
    status, prepared = services.prepare_download(bench.session, bench.plc.image)
    assert (status.image_crc, prepared.arrived) == (bench.crc, len(bench.plc.image))


def test_a_firmware_without_single_cycles_is_named_with_what_to_do() -> None:
    bench = Bench()
    with pytest.raises(DeviceError, match="SRV_OTHER_CLIENTS") as caught:
        services.cycle(bench.session)
    assert caught.value.code == "no-single-cycle"


@examples(50)
@given(st.binary(max_size=60))
def test_random_answers_are_errors_of_ours(content: bytes) -> None:
    bench = Bench()
    bench.session.ensure()
    bench.device.handler = lambda message: l7.encode(
        l7.Message(struct.unpack_from("<H", message, 4)[0] | lib.L7_REPLY, message[6], 0, content)
    )
    with pytest.raises((LinkError, DeviceError)):
        services.read_status(bench.session)


READERS: dict[str, Callable[[Session], object]] = {
    "identity": services.read_identity,
    "stack": services.read_stack,
    "status": services.read_status,
    "tasks": services.read_tasks,
    "info": services.read_application_info,
    "log": services.read_log,
}


@pytest.mark.parametrize("reader", READERS)
@examples(150)
@given(st.integers(0, 400), st.integers(0, 255), st.integers(-8, 8))
def test_answers_with_a_changed_byte_are_values_or_errors_of_ours(reader: str, at: int, byte: int, longer: int) -> None:
    bench = Bench()
    bench.plc.log = [(n, 10**9, lib.LOG_INFO, "CmpApp", "entry") for n in (1, 2, 7)]
    bench.plc.tasks = [([0, 1, 20000, 100, 7, 8, 5, 30, 12, 3], "Main")]
    bench.session.ensure()
    handler = bench.device.handler

    def changed(message: bytes) -> bytes:
        answer = bytearray(handler(message))
        answer[at % len(answer)] ^= byte
        return bytes(answer[: len(answer) + longer] if longer < 0 else answer + bytes(longer))

    bench.device.handler = changed
    with suppress(LinkError, DeviceError):
        READERS[reader](bench.session)


# ---- device and application ------------------------------------------------------------------------------------------


def test_identity() -> None:
    identity = services.read_identity(Bench().session)
    assert (identity.device_name, identity.node_name, identity.vendor_name) == (DEVICE_NAME, NODE_NAME, VENDOR_NAME)
    assert (identity.serial_number, identity.version, identity.runtime_version) == (SERIAL, "1.2.3.4", "0.1.0.0")


@pytest.mark.parametrize("size", [1, 500, 2000])
def test_echo(size: int) -> None:
    data = bytes(range(256)) * 8
    assert services.echo(Bench().session, data[:size]) == data[:size]


def test_status_without_application() -> None:
    bench = Bench()
    bench.plc.image, bench.plc.state = b"", lib.AS_NONE
    status = services.read_status(bench.session)
    assert (status.state, status.image_crc, status.exception) == (AppState.NONE, 0, None)


def test_status_of_a_running_application() -> None:
    bench = Bench()
    status = services.read_status(bench.session)
    assert (status.state, status.image_crc, status.image_size) == (AppState.RUN, bench.crc, 1000)


def test_status_after_an_exception() -> None:
    bench = Bench()
    bench.plc.state, bench.plc.operating = lib.AS_STOP, lib.OS_EXCEPTION
    bench.plc.exception = (lib.RTSEXCPT_DIVIDEBYZERO, 0x40, 1)
    status = services.read_status(bench.session)
    assert status.state is AppState.EXCEPTION
    assert status.exception == AppException(lib.RTSEXCPT_DIVIDEBYZERO, 0x40, 1)
    assert status.exception.name == "DIVIDEBYZERO"


def test_stop_start_and_reset() -> None:
    bench = Bench()
    services.stop(bench.session)
    assert bench.plc.state == lib.AS_STOP
    services.start(bench.session)
    assert bench.plc.state == lib.AS_RUN
    services.reset(bench.session, lib.RESET_OPTION_ORIGIN)
    assert bench.plc.state == lib.AS_NONE


def test_start_without_application_says_what_to_do() -> None:
    bench = Bench()
    bench.plc.image = b""
    with pytest.raises(DeviceError, match="flash one first"):
        services.start(bench.session)


def test_a_refused_start_names_the_reason() -> None:
    bench = Bench()
    bench.plc.operating = lib.OS_EXCEPTION
    with pytest.raises(DeviceError, match=r"refused the start: .*reset it first \(ERR_INVALID_STATE\)"):
        services.start(bench.session)


def test_a_flash_that_fails_is_said_in_words() -> None:
    with pytest.raises(DeviceError, match=r"refused the download: its flash or disk cannot be .* \(ERR_DEVICE\)"):
        l7.check_result(lib.ERR_DEVICE, "download")


def test_a_component_that_denies_is_quoted() -> None:
    bench = Bench()
    bench.plc.denial = "the door is open"
    for action, operate in {
        "stop": lambda: services.stop(bench.session),
        "start": lambda: services.start(bench.session),
        "reset": lambda: services.reset(bench.session, lib.RESET_OPTION_WARM),
    }.items():
        with pytest.raises(DeviceError) as caught:
            operate()
        words = f"The device refused the {action}: the door is open (ERR_OPERATION_DENIED)."
        assert (str(caught.value), caught.value.result) == (words, lib.ERR_OPERATION_DENIED)


def test_a_component_that_denies_a_shell_command_is_quoted() -> None:
    bench = Bench()
    bench.plc.shell_refusals["stopprg"] = ("stopprg: the door is open", lib.ERR_OPERATION_DENIED)
    with pytest.raises(DeviceError, match=r"refused the stopprg: the door is open \(ERR_OPERATION_DENIED\)"):
        services.run_shell(bench.session, "stopprg")
    bench.plc.shell_refusals["stopprg"] = ("stopprg: error 0x1", lib.ERR_FAILED)
    with pytest.raises(DeviceError, match=r"refused the stopprg: ERR_FAILED\."):
        services.run_shell(bench.session, "stopprg")


def lose_starts(bench: Bench, count: int, monkeypatch: pytest.MonkeyPatch, died: bool) -> list[int]:
    """The first starts end with the channel; `died`: because the program took the controller down. The list gets the
    starts that arrived."""
    real, starts = bench.plc._control, []

    def control(tags: bintag.Tags, state: int) -> list[bintag.Tag]:
        starts.append(state)
        if len(starts) > count:
            return real(tags, state)
        if died:
            bench.plc.operating, bench.plc.exception = (
                lib.OS_EXCEPTION,
                (lib.RTSEXCPT_BOOTPROJECT_CRASH, 0xFFFFFFFF, -1),
            )
        bench.device.restart()
        return []

    bench.plc.state = lib.AS_STOP
    monkeypatch.setattr(bench.plc, "_control", control)
    return starts


def test_a_program_that_takes_the_controller_down_is_not_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The controller would start the program before it, which is not what was asked for."""
    bench = Bench()
    starts = lose_starts(bench, 1, monkeypatch, died=True)
    with pytest.raises(DeviceError, match="No reply came to the start, and the program is stopped with an exception"):
        services.start(bench.session)
    assert starts == [lib.AS_RUN]


def test_a_program_that_took_the_controller_down_before_can_be_started(monkeypatch: pytest.MonkeyPatch) -> None:
    """The channel was lost then; the start itself is not."""
    bench = Bench()
    services.read_status(bench.session)
    starts = lose_starts(bench, 0, monkeypatch, died=True)
    bench.plc.exception = (lib.RTSEXCPT_BOOTPROJECT_CRASH, 0xFFFFFFFF, -1)
    bench.device.restart()
    services.start(bench.session)
    assert starts == [lib.AS_RUN]


def test_a_start_that_was_lost_is_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    starts = lose_starts(bench, 1, monkeypatch, died=False)
    services.start(bench.session)
    assert (bench.plc.state, starts) == (lib.AS_RUN, [lib.AS_RUN] * 2)


def test_tasks() -> None:
    bench = Bench()
    bench.plc.tasks = [([0, 1, 20000, 100, 7, 8, 5, 30, 12, 3], "Main"), ([3, 9, 0, 5, 1, 1, 1, 1, 0, 0], "Slow")]
    main, slow = services.read_tasks(bench.session)
    assert (main.name, main.interval_us, main.cycles, main.max_us, main.overruns) == ("Main", 20000, 100, 30, 3)
    assert (slow.name, slow.kind, slow.priority) == ("Slow", 3, 9)


def test_application_info() -> None:
    assert services.read_application_info(Bench().session) == {"project": "demo", "version": "1.2"}


def test_the_log_is_read_to_its_end_in_several_requests() -> None:
    bench = Bench()
    bench.plc.log = [(n, n * 10**9, lib.LOG_INFO, "CmpApp", f"entry {n}") for n in range(1, 9)]
    entries = services.read_log(bench.session)
    assert [e.handle for e in entries] == list(range(1, 9))
    assert (entries[2].text, entries[2].component, entries[2].time_ns) == ("entry 3", "CmpApp", 3 * 10**9)
    assert [e.handle for e in services.read_log(bench.session, after=6)] == [7, 8]


def test_firmware_without_a_kept_log_says_how_to_get_one() -> None:
    bench = Bench()
    bench.plc.log = [(1, 10**9, lib.LOG_INFO, "CmpApp", "entry")]
    with pytest.raises(DeviceError, match="Build its firmware with LOG_KEEP"):
        services.read_log(bench.session, kept=True)


def test_the_log_ends_with_the_last_handle_there_can_be() -> None:
    bench = Bench()
    bench.plc.log = [(n, 10**9, lib.LOG_INFO, "CmpApp", "entry") for n in (1, 0xFFFFFFFF)]
    assert [e.handle for e in services.read_log(bench.session)] == [1, 0xFFFFFFFF]
    assert services.read_log(bench.session, after=0xFFFFFFFF) == []


def test_a_long_answer_of_the_shell_comes_in_parts() -> None:
    assert services.run_shell(Bench().session, "rtsinfo") == "You said rtsinfo\nand now\nall is said."


# ---- monitoring ------------------------------------------------------------------------------------------------------


def test_values_are_read_from_their_places() -> None:
    bench = Bench()
    bench.plc.memory[0][10:14] = b"\x01\x02\x03\x04"
    bench.plc.memory[3][66000] = 9
    contents = monitoring.read_memory(
        bench.session, bench.crc, [AreaRange(0, 10, 4), AreaRange(3, 66000, 1), AreaRange(0, 12, 1)]
    )
    assert contents.values == [b"\x01\x02\x03\x04", b"\x09", b"\x03"]


def test_many_values_take_few_requests() -> None:
    bench = Bench(buffer_size=2048)
    for n in range(1000):
        bench.plc.memory[0][n] = n & 0xFF
    contents = monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, n, 1) for n in range(1000)])
    assert contents.values == [bytes([n & 0xFF]) for n in range(1000)]
    assert bench.plc.requests.count((lib.SG_MONITORING2, lib.SRV_MON2_READ)) <= 8


def test_values_longer_than_a_message_are_read_in_pieces() -> None:
    bench = Bench(buffer_size=512)
    bench.plc.memory[0][:3000] = bytes(n % 251 for n in range(3000))
    ranges = [AreaRange(0, 0, 2500), AreaRange(0, 2500, 500)]
    first, second = monitoring.read_memory(bench.session, bench.crc, ranges).values
    assert first and second and first + second == bytes(bench.plc.memory[0][:3000])


def test_a_reader_encodes_its_ranges_once_for_a_size_of_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(buffer_size=512)
    encoded: list[AreaRange] = []
    encode = monitoring._read_variable

    def counted(piece: AreaRange) -> bytes:
        encoded.append(piece)
        return encode(piece)

    monkeypatch.setattr(monitoring, "_read_variable", counted)
    bench.plc.memory[0][:600] = bytes(n % 251 for n in range(600))
    reader = monitoring.Reader([AreaRange(0, 0, 0), AreaRange(0, 0, 600), AreaRange(0, 600, 0)])
    for byte in (1, 2):
        bench.plc.memory[0][0] = byte
        values = reader.read(bench.session, bench.crc).values
        assert values == [b"", bytes(bench.plc.memory[0][:600]), b""]
    assert len(encoded) == 2
    other = Bench(buffer_size=2048)
    assert reader.read(other.session, other.crc).values[1] == bytes(600)
    assert len(encoded) == 3


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 69000), st.integers(1, 1000)), max_size=30))
@examples(30)
def test_any_ranges_read_what_is_in_memory(ranges: list[tuple[int, int, int]]) -> None:
    bench = Bench(buffer_size=600)
    for area, memory in bench.plc.memory.items():
        memory[:] = bytes((n * 7 + area) & 0xFF for n in range(256)) * (len(memory) // 256) + bytes(len(memory) % 256)
    contents = monitoring.read_memory(bench.session, bench.crc, [AreaRange(*r) for r in ranges])
    assert contents.values == [bytes(bench.plc.memory[a][o : o + s]) for a, o, s in ranges]


def test_a_value_outside_memory_is_a_device_error() -> None:
    bench = Bench()
    with pytest.raises(DeviceError, match="MONITORING_ERR_INVALID_INDEX"):
        monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 0, 1), AreaRange(0, 70000, 4)])


def pointer(area: int, offset: int) -> bytes:
    """What a pointer of the fake controller holds."""
    return ((area + 1) << 32 | offset).to_bytes(8, "little")


def test_pointers_are_followed_by_the_device() -> None:
    bench = Bench()
    bench.plc.memory[0][16:24] = pointer(3, 66000)
    bench.plc.memory[3][66008:66016] = pointer(4, 10)
    bench.plc.memory[4][10:14] = b"\x01\x02\x03\x04"
    ranges = [AreaRange(0, 16, 2, (8, 1)), AreaRange(0, 16, 8, (8,)), AreaRange(4, 10, 1)]
    contents = monitoring.read_memory(bench.session, bench.crc, ranges)
    assert contents.values == [b"\x02\x03", pointer(4, 10), b"\x01"]
    assert bench.plc.requests.count((lib.SG_MONITORING2, lib.SRV_MON2_READ)) == 1


def test_the_target_of_a_pointer_to_nothing_is_none_and_the_rest_is_read() -> None:
    bench = Bench()
    bench.plc.memory[0][8:16] = pointer(0, 69_999)
    contents = monitoring.read_memory(
        bench.session, bench.crc, [AreaRange(0, 0, 2, (0,)), AreaRange(0, 8, 2, (0,)), AreaRange(0, 8, 1)]
    )
    assert contents.values == [None, None, b"\x6f"]


def test_long_values_through_pointers_are_read_in_pieces() -> None:
    bench = Bench(buffer_size=512)
    bench.plc.memory[0][0:8] = pointer(1, 100)
    bench.plc.memory[1][:3000] = bytes(n % 251 for n in range(3000))
    contents = monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 0, 2000, (4,))])
    assert contents.values == [bytes(bench.plc.memory[1][104:2104])]


@pytest.mark.parametrize("hops", [(), (4,)])
@pytest.mark.parametrize("offset", [0, 65_000])
def test_values_longer_than_a_message_are_written_in_parts(offset: int, hops: tuple[int, ...]) -> None:
    bench = Bench(buffer_size=232)
    bench.plc.memory[1][0:8] = pointer(0, offset)
    value = bytes(n % 251 for n in range(1500))
    where = AreaRange(1, 0, 1500, hops) if hops else AreaRange(0, offset, 1500)
    monitoring.write_memory(bench.session, bench.crc, [Write(AreaRange(2, 0, 1), b"\x07"), Write(where, value)])
    begin = offset + sum(hops)
    assert bench.plc.memory[0][begin : begin + 1500] == value
    assert bench.plc.memory[0][begin + 1500 : begin + 1600] == bytes(100)
    assert bench.plc.memory[2][0] == 7


def test_values_are_written_through_pointers() -> None:
    bench = Bench()
    bench.plc.memory[0][0:8] = pointer(1, 100)
    monitoring.write_memory(bench.session, bench.crc, [Write(AreaRange(0, 0, 2, (4,)), b"\xaa\xbb")])
    assert bench.plc.memory[1][104:106] == b"\xaa\xbb"


def test_values_of_one_request_are_asked_for_until_they_are_consistent() -> None:
    bench = Bench()
    bench.plc.disturbed = 2
    contents = monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 0, 1), AreaRange(0, 8, 4)])
    assert contents.consistent
    assert bench.plc.requests.count((lib.SG_MONITORING2, lib.SRV_MON2_READ)) == 3


def test_values_that_never_are_consistent_are_given_all_the_same() -> None:
    bench = Bench()
    bench.plc.disturbed = 1000
    contents = monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 0, 1), AreaRange(0, 8, 4)])
    assert not contents.consistent
    assert contents.values == [b"\0", bytes(4)]


def test_a_single_value_that_is_read_in_one_access_is_asked_for_once() -> None:
    bench = Bench()
    bench.plc.disturbed = 1000
    assert monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 8, 4)]).consistent
    assert bench.plc.requests.count((lib.SG_MONITORING2, lib.SRV_MON2_READ)) == 1


def test_values_of_several_requests_are_not_consistent() -> None:
    bench = Bench(buffer_size=512)
    contents = monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, n, 1) for n in range(300)])
    assert not contents.consistent


def test_values_are_written_to_their_places() -> None:
    bench = Bench()
    values = [Write(AreaRange(0, 10, 2), b"\xaa\xbb"), Write(AreaRange(4, 66000, 1), b"c")]
    monitoring.write_memory(bench.session, bench.crc, values)
    assert bench.plc.memory[0][10:12] == b"\xaa\xbb"
    assert bench.plc.memory[4][66000] == ord("c")


def test_more_values_than_a_message_holds_are_all_written() -> None:
    bench = Bench(buffer_size=512)
    monitoring.write_memory(
        bench.session, bench.crc, [Write(AreaRange(0, n, 1), bytes([n & 0xFF])) for n in range(300)]
    )
    assert bench.plc.memory[0][:300] == bytes(n & 0xFF for n in range(300))


def test_nothing_is_read_from_another_application_than_meant() -> None:
    bench = Bench()
    with pytest.raises(DeviceError, match="Another application") as caught:
        monitoring.read_memory(bench.session, bench.crc ^ 1, [AreaRange(0, 0, 1)])
    assert caught.value.code == "app-changed"


def test_an_application_that_changes_meanwhile_is_noticed() -> None:
    bench = Bench()
    monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 0, 1)])
    old = bench.crc
    bench.plc.image = make_image(1000, seed=2)
    with pytest.raises(DeviceError, match="Another application"):
        monitoring.read_memory(bench.session, old, [AreaRange(0, 0, 1)])
    monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 0, 1)])


# ---- lost channels ---------------------------------------------------------------------------------------------------


def test_a_lost_channel_is_opened_again_without_anybody_noticing() -> None:
    bench = Bench()
    services.read_status(bench.session)
    bench.device.restart()
    assert services.read_status(bench.session).state is AppState.RUN
    bench.device.restart()
    assert monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 0, 1)]).values == [b"\0"]


def test_a_write_that_the_device_did_not_take_is_repeated() -> None:
    bench = Bench()
    services.read_status(bench.session)
    bench.device.restart()
    monitoring.write_memory(bench.session, bench.crc, [Write(AreaRange(0, 0, 1), b"x")])
    assert bench.plc.writes == 1


def test_a_write_whose_answer_is_lost_is_not_repeated() -> None:
    bench = Bench()
    monitoring.read_memory(bench.session, bench.crc, [AreaRange(0, 0, 1)])
    handle = bench.plc.handle

    def answer_and_die(message: bytes) -> bytes:
        bench.line.cut = True
        return handle(message)

    bench.device.handler = answer_and_die
    with pytest.raises(LinkError):
        monitoring.write_memory(bench.session, bench.crc, [Write(AreaRange(0, 0, 1), b"x")])
    assert bench.plc.writes == 1


# ---- download --------------------------------------------------------------------------------------------------------


def test_an_image_arrives_and_progress_is_reported() -> None:
    bench, image, seen = Bench(buffer_size=2048), make_image(20_000, 5), list[int]()
    services.download(bench.session, image, progress=seen.append)
    assert bench.plc.image == image
    assert seen == sorted(seen)
    assert seen[-1] == len(image)
    assert len(seen) > 8


@pytest.mark.parametrize("size", [104, 1888, 1889, 3776, 3777])
def test_images_of_any_size_arrive(size: int) -> None:
    bench, image = Bench(buffer_size=2048), make_image(size, 5)
    services.download(bench.session, image)
    assert bench.plc.image == image


def test_a_refused_image_is_a_device_error_with_the_reason() -> None:
    bench = Bench()
    bench.plc.refuse = "function 'sin' is missing"
    with pytest.raises(DeviceError, match="function 'sin' is missing") as caught:
        services.download(bench.session, make_image(5000, 5))
    assert caught.value.code == "app-unresolved-reference"
    assert services.read_status(bench.session).image_crc == bench.crc


def test_an_image_that_is_there_already_is_not_sent_again_unless_asked() -> None:
    bench = Bench()
    sent = bench.line.sent_bytes
    services.download(bench.session, bench.plc.image)
    assert bench.line.sent_bytes - sent < 500
    services.download(bench.session, bench.plc.image, restart=True)
    assert bench.line.sent_bytes - sent > 1000


def test_a_broken_transfer_continues_where_it_was() -> None:
    bench, image = Bench(buffer_size=2048), make_image(40_000, 5)

    def die_once(done: int) -> None:
        if done > 20_000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        services.download(bench.session, image, progress=die_once)
    sent = bench.line.sent_bytes
    services.download(Session(Connection(bench.line)), image)
    assert bench.plc.image == image
    assert bench.line.sent_bytes - sent < 25_000


def starts(bench: Bench) -> int:
    """How often a start has been asked for."""
    return bench.plc.requests.count((lib.SG_APPLICATION, lib.SRV_APP_START))


def test_a_flashed_program_is_started_with_its_last_block() -> None:
    bench, image = Bench(), make_image(20_000, 5)
    assert Plc(Connection(bench.line)).flash(image, unchecked=True).state is AppState.RUN
    assert (bench.plc.image, starts(bench)) == (image, 0)


def test_older_firmware_is_asked_to_start_the_program() -> None:
    bench = Bench()
    bench.plc.starts_downloads = False
    assert Plc(Connection(bench.line)).flash(make_image(20_000, 5), unchecked=True).state is AppState.RUN
    assert starts(bench) == 1


def test_a_program_that_shall_not_start_does_not() -> None:
    bench = Bench()
    plc = Plc(Connection(bench.line))
    assert plc.flash(make_image(20_000, 5), unchecked=True, start=False).state is AppState.STOP
    assert starts(bench) == 0


def test_a_program_that_takes_the_controller_down_is_not_sent_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The controller has gone back to the previous one, and would do so again."""
    bench = Bench(buffer_size=2048)
    began, before = [], bench.plc.image
    finish, download = bench.plc._finish_download, bench.plc._download

    def go_down(start: bool) -> tuple[int, str]:
        finish(start)
        bench.plc.image = before
        bench.device.restart()
        return lib.ERR_OK, ""

    def count(tags: bintag.Tags) -> list[bintag.Tag]:
        position = tags.bytes(lib.TAG_CDL_POSITION, 16)
        began.extend([1] if position[:8] == bytes([0, 2, *bytes(6)]) else [])
        return download(tags)

    monkeypatch.setattr(bench.plc, "_finish_download", go_down)
    monkeypatch.setattr(bench.plc, "_download", count)
    with pytest.raises(DeviceError, match="The controller went down when it had the new program") as caught:
        Plc(Connection(bench.line)).flash(make_image(20_000, 5), unchecked=True)
    assert caught.value.code == "died"
    assert (bench.plc.image, len(began)) == (before, 1)


def test_a_channel_lost_on_the_way_is_no_reason_to_begin_again() -> None:
    bench, image, restarts = Bench(buffer_size=2048), make_image(40_000, 5), [10_000, 30_000]

    def restart(done: int) -> None:
        if restarts and done > restarts[0]:
            restarts.pop(0)
            bench.device.restart()

    services.download(bench.session, image, progress=restart)
    assert bench.plc.image == image
    assert not restarts
    assert bench.line.sent_bytes < 60_000


def test_a_line_that_comes_back_is_waited_for_and_one_that_does_not_is_an_error() -> None:
    bench, image, outages = Bench(buffer_size=2048), make_image(40_000, 5), [20_000]

    def cut(done: int) -> None:
        if outages and done > outages[0]:
            outages.pop()
            bench.line.cut = True
            bench.line.after(8.0, lambda: setattr(bench.line, "cut", False))

    services.download(bench.session, image, progress=cut)
    assert bench.plc.image == image
    assert not outages

    bench = Bench(buffer_size=2048)
    with pytest.raises(LinkError):
        services.download(bench.session, image, progress=lambda done: setattr(bench.line, "cut", done > 20_000))


def takes(action: Callable[[Session], object]) -> float:
    """Seconds until an action fails on a line that was cut before."""
    bench = Bench()
    services.read_status(bench.session)
    bench.session.application()
    bench.line.cut, begin = True, bench.line.now()
    with pytest.raises(LinkError):
        action(bench.session)
    return bench.line.now() - begin


@pytest.mark.parametrize(
    "action",
    [
        services.start,
        services.stop,
        services.cycle,
        lambda session: services.reset(session, 0),
        lambda session: services.set_password(session, None),
        lambda session: file_services.delete_file(session, "a"),
    ],
)
def test_what_takes_long_is_not_waited_for_on_a_line_that_was_cut_before(action: Callable[[Session], object]) -> None:
    assert takes(action) < 5.5


@pytest.mark.parametrize(
    "action",
    [
        file_services.list_files,
        lambda session: file_services.read_file(session, "a"),
        lambda session: file_services.write_file(session, "a", b"1"),
    ],
)
def test_files_are_not_waited_for_longer_than_flash_takes(action: Callable[[Session], object]) -> None:
    assert takes(action) < 7.0


def test_a_lost_verdict_is_asked_for_again() -> None:
    bench, image = Bench(buffer_size=2048), make_image(10_000, 5)
    handle = bench.plc.handle

    def restart_at_the_end(message: bytes) -> bytes:
        reply = handle(message)
        if bench.plc.image == image and not bench.plc.requests.count((0, 0)):
            bench.plc.requests.append((0, 0))
            bench.device.restart()
        return reply

    bench.device.handler = restart_at_the_end
    services.download(bench.session, image)
    assert bench.plc.image == image


@examples(12)
@given(st.integers(0, 2**32), st.sampled_from([2048, 16384]))
def test_what_arrives_over_a_bad_line_is_what_was_sent(seed: int, buffer_size: int) -> None:
    bench = Bench(buffer_size, to_device=damage(seed, 0.001), to_client=damage(seed + 1, 0.001))
    image = make_image(30_000, seed)
    services.download(bench.session, image)
    assert bench.plc.image == image
    assert services.read_status(bench.session).image_crc == image_crc(image)


def test_a_download_uses_92_percent_of_the_line() -> None:
    bench, image = Bench(), make_image(200_000, 5)
    bench.device.work_time = 0.02
    services.read_status(bench.session)
    begin = bench.line.now()
    services.download(bench.session, image)
    assert len(image) / (bench.line.now() - begin) / bench.line.rate > 0.92
