"""A damaged image is refused with its reason, over the wire, and the running program keeps running."""

import random

import pytest

import plctool
from plctool.errors import DeviceError


@pytest.fixture
def plc(tool, plcrt, counter):
    """A device on which the counter runs."""
    with plctool.connect(f"serial:{plcrt.port}") as connected:
        connected.flash(counter)
        yield connected


def cycles(plc):
    return plc.tasks()[0].cycles


def assert_refused(plc, image: bytes) -> str:
    crc = plc.status().image_crc
    with pytest.raises(DeviceError) as refused:
        plc.flash(image, unchecked=True)
    status = plc.status()
    assert status.state == "run" and status.image_crc == crc
    return str(refused.value)


def test_images_cut_off_anywhere_are_refused(plc, counter, eventually):
    image = counter.read_bytes()
    lengths = sorted({1, 4, 103, 104, 105, len(image) - 1, *random.Random(1).sample(range(len(image)), 40)})
    before = cycles(plc)
    for length in lengths:
        assert len(assert_refused(plc, image[:length])) > 20, "a reason"
    assert eventually(lambda: cycles(plc) > before)


def test_images_with_a_flipped_bit_are_refused(plc, counter, eventually):
    image = counter.read_bytes()
    rng = random.Random(2)
    before = cycles(plc)
    for bit in [*range(0, 104 * 8, 29), *rng.sample(range(len(image) * 8), 40)]:
        damaged = bytearray(image)
        damaged[bit // 8] ^= 1 << bit % 8
        assert_refused(plc, bytes(damaged))
    assert eventually(lambda: cycles(plc) > before)


def test_an_image_for_another_processor_is_refused_by_name(plc, tool, counter):
    other = tool.build("other", "PROGRAM Main VAR x : INT; END_VAR x := x + 1; END_PROGRAM", "--target", "cortex-m3")
    reason = assert_refused(plc, other.read_bytes())
    assert "device" in reason.lower() or "target" in reason.lower()


def test_random_bytes_are_refused(plc):
    for seed in range(10):
        assert_refused(plc, random.Random(seed).randbytes(500))
