"""The device object: flashing, reading by name with the right symbols only, what it says of exceptions."""

from __future__ import annotations

from pathlib import Path

import pytest
from fake_device import FakeDevice, FakeLine, FakePlc
from small_app import make_application

import plctool
from plctool.core import lib
from plctool.debug.symbols import SymbolTable, cache_path, symbol_path
from plctool.device import Plc
from plctool.errors import DeviceError, LinkError, UsageError
from plctool.link.connection import Connection
from plctool.link.transports import parse_link


class Controller:
    """A fake controller, the device object for it and an application in a folder."""

    def __init__(self, folder: Path) -> None:
        self.fake = FakePlc()
        self.fake.image = b""
        self.device = FakeDevice(self.fake.handle)
        self.line = FakeLine(self.device)
        self.plc = Plc(Connection(self.line))
        self.data, self.symbols = make_application()
        self.image = folder / "small.cdl"
        self.image.write_bytes(self.data)
        symbol_path(self.image).write_text(self.symbols.to_json())
        self.fake.tasks = [([0, 1, 10_000, 5, 1, 1, 1, 2, 3, 0], "Main")]

    @property
    def data_area(self) -> bytearray:
        return self.fake.memory[int(lib.APP_AREA_DATA)]


@pytest.fixture
def controller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Controller:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return Controller(tmp_path)


# ---- flash -----------------------------------------------------------------------------------------------------------


def test_flash_brings_the_image_and_starts_it(controller: Controller) -> None:
    result = controller.plc.flash(controller.image)
    assert controller.fake.image == controller.data
    assert (result.bytes, result.skipped, result.state) == (len(controller.data), False, "run")
    assert result.seconds > 0


def test_flash_starts_by_its_last_block_and_asks_what_became_of_it(controller: Controller) -> None:
    controller.plc.flash(controller.image)
    app = lib.SG_APPLICATION
    status, download = (app, lib.SRV_APP_READ_STATUS), (app, lib.SRV_APP_DOWNLOAD_COMPACT)
    assert controller.fake.requests[1:] == [status, download, download, status]
    assert controller.plc.status().state == "run"


def test_flash_takes_bytes_as_well(controller: Controller) -> None:
    controller.plc.flash(controller.data, start=False)
    assert controller.fake.image == controller.data
    assert controller.plc.status().state == "stop"


def test_flash_of_what_is_there_is_skipped_but_starts(controller: Controller) -> None:
    controller.plc.flash(controller.image, start=False)
    result = controller.plc.flash(controller.image)
    assert (result.skipped, result.state) == (True, "run")


def test_flash_by_force_is_not_skipped(controller: Controller) -> None:
    controller.plc.flash(controller.image)
    sent = controller.line.sent_bytes
    assert not controller.plc.flash(controller.image, force=True).skipped
    assert controller.line.sent_bytes - sent > len(controller.data)


def test_flash_after_an_exception_is_not_skipped(controller: Controller) -> None:
    controller.plc.flash(controller.image)
    controller.fake.exception = (lib.RTSEXCPT_DIVIDEBYZERO, 0x21, 0)
    controller.fake.operating = lib.OS_EXCEPTION
    assert not controller.plc.flash(controller.image).skipped


def test_a_damaged_image_is_refused_before_anything_is_sent(controller: Controller) -> None:
    damaged = bytearray(controller.data)
    damaged[150] ^= 1
    with pytest.raises(UsageError, match="not a valid application image"):
        controller.plc.flash(bytes(damaged))
    assert controller.line.sent_bytes == 0


def test_unchecked_sends_even_that(controller: Controller) -> None:
    controller.plc.flash(controller.image)
    controller.fake.refuse = "the CRC is wrong"
    damaged = bytearray(controller.data)
    damaged[150] ^= 1
    with pytest.raises(DeviceError, match="the CRC is wrong"):
        controller.plc.flash(bytes(damaged), unchecked=True)
    assert controller.fake.image == controller.data


def test_flash_tells_its_progress(controller: Controller) -> None:
    seen: list[tuple[int, int]] = []
    controller.plc.flash(controller.image, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (len(controller.data), len(controller.data))


def test_a_missing_file_is_named(controller: Controller, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nothing\.cdl cannot be read"):
        controller.plc.flash(tmp_path / "nothing.cdl")


def test_another_image_on_the_device_than_sent_is_an_error(controller: Controller) -> None:
    finish = controller.fake._finish_download

    def swap(start: bool) -> tuple[int, str]:
        result = finish(start)
        controller.fake.image = make_application("2")[0]
        return result

    controller.fake._finish_download = swap  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match="has the previous one"):
        controller.plc.flash(controller.image)


# ---- variables -------------------------------------------------------------------------------------------------------


@pytest.fixture
def running(controller: Controller) -> Controller:
    controller.plc.flash(controller.image)
    return controller


def test_one_name_gives_its_value_and_several_a_dict(running: Controller) -> None:
    running.data_area[:5] = (-5).to_bytes(4, "little", signed=True) + b"\1"
    assert running.plc.read("Main.count") == -5
    assert running.plc.read("Main.count", "main.OK") == {"Main.count": -5, "main.OK": True}


def test_arrays_and_elements_are_read(running: Controller) -> None:
    running.data_area[28:34] = bytes([1, 0, 2, 0, 3, 0])
    assert running.plc.read_all(["Main.list", "Main.list[2]"]) == {"Main.list": [1, 2, 3], "Main.list[2]": 2}


def test_values_are_written_as_python_values_or_strings(running: Controller) -> None:
    running.plc.write({"Main.count": 7, "Main.pause": "T#1s", "Main.name": "abc", "Main.level": 1.5})
    values = running.plc.read_all(["Main.count", "Main.pause", "Main.name", "Main.level"])
    assert values == {"Main.count": 7, "Main.pause": "T#1s", "Main.name": "abc", "Main.level": 1.5}


@pytest.mark.parametrize(
    ("name", "value"), [("Main.nothing", 1), ("Main.count", "many"), ("Main.count", 2**31), ("Main.limit", 1)]
)
def test_what_cannot_be_written_is_a_usage_error_and_nothing_is_written(
    running: Controller, name: str, value: object
) -> None:
    with pytest.raises(UsageError):
        running.plc.write({"Main.ok": True, name: value})
    assert running.fake.writes == 0


def test_symbols_are_kept_at_flash_and_found_again(running: Controller, tmp_path: Path) -> None:
    symbol_path(running.image).unlink()
    plc = Plc(Connection(FakeLine(running.device)))
    assert plc.read("Main.count") == 0


def test_kept_symbols_are_replaced_as_a_whole(running: Controller, tmp_path: Path) -> None:
    """Another process that reads them while they are kept again has all of the old ones."""
    kept = cache_path(running.symbols.image_crc)
    (tmp_path / "being_read").hardlink_to(kept)
    running.plc.flash(running.image)
    assert not kept.samefile(tmp_path / "being_read")
    assert kept.read_bytes() == (tmp_path / "being_read").read_bytes()


def test_without_symbols_nothing_is_read(running: Controller) -> None:
    cache_path(running.symbols.image_crc).unlink()
    plc = Plc(Connection(FakeLine(running.device)))
    with pytest.raises(UsageError, match="no symbols"):
        plc.read("Main.count")


def test_the_symbols_of_another_image_are_refused(running: Controller, tmp_path: Path) -> None:
    other = tmp_path / "other.sym"
    other.write_text(make_application("2")[1].to_json())
    plc = Plc(Connection(FakeLine(running.device)), symbols=other)
    with pytest.raises(UsageError, match="another image") as caught:
        plc.read("Main.count")
    assert caught.value.code == "wrong-symbols"


def test_a_symbol_file_that_is_named_is_used(running: Controller) -> None:
    plc = Plc(Connection(FakeLine(running.device)), symbols=symbol_path(running.image))
    assert plc.read("Main.count") == 0


def test_an_image_that_changed_meanwhile_is_never_read_with_old_symbols(running: Controller) -> None:
    running.plc.read("Main.count")
    running.fake.image = make_application("2")[0]
    with pytest.raises(DeviceError, match="Another application"):
        running.plc.read("Main.count")
    with pytest.raises(UsageError):
        running.plc.read("Main.count")


def test_an_image_that_changed_while_the_channel_was_lost_is_never_read_with_old_symbols(running: Controller) -> None:
    def restart_with_another() -> None:
        running.device.restart()
        running.fake.image = make_application("2")[0]

    table = running.plc.symbols()
    restart_with_another()
    running.plc._find_symbols = lambda crc: table  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match="Another application"):
        running.plc.read("Main.count")


def test_watch_reads_as_often_as_asked(running: Controller) -> None:
    samples = list(running.plc.watch(["Main.count"], interval=0, count=3))
    assert [reading.values for _, reading in samples] == [{"Main.count": 0}] * 3
    times = [seconds for seconds, _ in samples]
    assert times == sorted(times)


# ---- state -----------------------------------------------------------------------------------------------------------


def fail(controller: Controller, code: int, offset: int, task: int = 0) -> None:
    controller.fake.state, controller.fake.operating = lib.AS_STOP, lib.OS_EXCEPTION
    controller.fake.exception = (code, offset, task)


@pytest.mark.parametrize(
    ("code", "offset", "line"),
    [
        ("RTSEXCPT_DIVIDEBYZERO", 0x1F, 7),  # the last byte of the call that raised it
        ("RTSEXCPT_DIVIDEBYZERO", 0x20, 8),
        ("RTSEXCPT_WATCHDOG", 0x20, 8),  # where the processor was
    ],
)
def test_an_exception_comes_with_task_and_source_line(running: Controller, code: str, offset: int, line: int) -> None:
    fail(running, getattr(lib, code), offset)
    exception = running.plc.status().exception
    assert exception is not None
    assert (exception.name, exception.task) == (code.removeprefix("RTSEXCPT_"), "Main")
    assert (exception.pou, exception.file, exception.line) == ("Main", "main.st", line)
    assert str(exception) == f"{exception.name} in task Main, Main, main.st:{line}"


def test_an_exception_without_symbols_has_no_place(running: Controller) -> None:
    cache_path(running.symbols.image_crc).unlink()
    fail(running, lib.RTSEXCPT_DIVIDEBYZERO, 0x20)
    exception = Plc(Connection(FakeLine(running.device))).status().exception
    assert exception is not None
    assert (exception.name, exception.task, exception.file) == ("DIVIDEBYZERO", "Main", None)


def test_an_exception_of_the_initialisation_has_no_task(running: Controller) -> None:
    fail(running, lib.RTSEXCPT_ACCESS_VIOLATION, 0xFFFFFFFF, task=-1)
    exception = running.plc.status().exception
    assert exception is not None
    assert (exception.task, exception.line) == (None, None)


def test_start_stop_reset(running: Controller) -> None:
    running.plc.stop()
    assert running.plc.status().state == "stop"
    running.plc.start()
    assert running.plc.status().state == "run"
    running.plc.reset("origin")
    assert running.plc.status().state == "none"


def test_an_unknown_reset_is_a_usage_error(running: Controller) -> None:
    with pytest.raises(UsageError, match="warm, cold, origin"):
        running.plc.reset("hot")


def test_tasks_log_and_info(running: Controller) -> None:
    running.fake.log = [(1, 5, lib.LOG_INFO, "CmpApp", "hello")]
    assert [t.name for t in running.plc.tasks()] == ["Main"]
    assert [e.text for e in running.plc.log()] == ["hello"]
    assert running.plc.info()["project"] == "demo"
    assert running.plc.identity().device_name == "Fake controller"


# ---- links -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("link", ["can:", "udp:", "tcp:", "/dev/ttyS0", "serial:", ""])
def test_links_that_are_none_are_usage_errors(link: str) -> None:
    with pytest.raises(UsageError):
        parse_link(link)


@pytest.mark.parametrize(
    ("port", "advice"),
    [("/dev/no-such-port", "no such port"), ("socket://127.0.0.1:1", "Cannot open")],
)
def test_ports_that_cannot_be_opened_are_link_errors_with_advice(port: str, advice: str) -> None:
    with pytest.raises(LinkError, match=advice):
        plctool.connect(f"serial:{port}")


def test_a_device_is_used_as_a_context_manager(controller: Controller) -> None:
    with controller.plc as plc:
        assert plc.status().state == "none"
    controller.line.receive(1.0)
    assert controller.device._id == 0


def test_the_package_offers_what_it_names() -> None:
    for name in plctool.__all__:
        assert getattr(plctool, name)
    with pytest.raises(AttributeError):
        plctool.nothing  # noqa: B018


def test_symbol_tables_survive_their_file(controller: Controller) -> None:
    assert SymbolTable.from_json(symbol_path(controller.image).read_text()).image_crc == controller.symbols.image_crc
