"""Forced variables over the line: the list in several replies, and one too many."""

from __future__ import annotations

import pytest
from test_services import Bench

from plctool.core import lib
from plctool.debug.forced import ForcedPlace
from plctool.errors import DeviceError
from plctool.link import services
from plctool.link.monitoring import force_memory, read_forced, unforce_memory


def places(count: int) -> list[ForcedPlace]:
    return [ForcedPlace(lib.APP_AREA_DATA, 4 * i, (), 4, value=bytes([i, 0, 0, 0])) for i in range(count)]


def test_a_list_that_takes_several_replies_is_read_whole():
    bench = Bench()
    session, plc, image_crc = bench.session, bench.plc, bench.crc
    force_memory(session, image_crc, places(3))
    listed = read_forced(session)
    assert (listed.room, listed.places) == (plc.FORCE_ROOM, places(3))
    unforce_memory(session, image_crc, places(2))
    assert read_forced(session).places == places(3)[2:]
    services.end_all_forces(session)
    assert read_forced(session).places == []


def test_one_too_many_is_an_error_of_monitoring():
    bench = Bench()
    session, plc, image_crc = bench.session, bench.plc, bench.crc
    with pytest.raises(DeviceError) as failed:
        force_memory(session, image_crc, places(plc.FORCE_ROOM + 1))
    assert failed.value.result == lib.MONITORING_ERR_FORCE_FAILED
