"""Layer 7 messages: header, service errors (codesys-v3-protocol 4.1, 4.2)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from plctool.core import error_name, lib
from plctool.errors import DeviceError, LinkError
from plctool.image.file import built_for, target_name
from plctool.link import bintag
from plctool.link.wire import Layout

_HEADER = Layout("L7_HEADER")
_SHORT_HEADER = Layout("L7_HEADER", before="customer")
_LENGTH_BASE = Layout("L7_HEADER", before="group").size  # the length of the header counts from here

_ADVICE = {
    lib.ERR_INVALID_STATE: "it stopped with an exception, reset it first",
    lib.ERR_CALL_AGAIN: "it runs, stop it first",
    lib.ERR_EXCEPTION: "it stopped with an exception, which status shows",
    lib.ERR_NOTINITIALIZED: "a component of its firmware failed to start, which 'plctool log' names",
    lib.ERR_APP_NOT_LOADED: "there is no application, flash one first",
    lib.ERR_NOMEMORY: "it is too large for the device",
    lib.ERR_OPERATION_DENIED: "the running program forbids it (PlcOperationControlInstance), as status shows",
    lib.ERR_DEVICE: "its flash or disk cannot be read or written, as 'plctool log' shows",
    lib.ERR_BUFFERSIZE: "it is too large for the device",
}


@dataclass(frozen=True)
class Message:
    group: int
    service: int
    session: int
    content: bytes


def encode(message: Message) -> bytes:
    head = _HEADER.pack(
        protocol=lib.L7_PROTOCOL,
        length=lib.L7_HEADER_LENGTH,
        group=message.group,
        service=message.service,
        session=message.session,
        size=len(message.content),
    )
    return head + message.content


def decode(data: bytes) -> Message:
    """The message in `data`; raises LinkError when it is malformed."""
    if len(data) >= _SHORT_HEADER.size:
        head = _SHORT_HEADER.unpack(data)
        content_at = _LENGTH_BASE + head.length
        known_length = lib.L7_HEADER_LENGTH_SHORT <= head.length <= lib.L7_HEADER_LENGTH_MAX
        if head.protocol == lib.L7_PROTOCOL and known_length and content_at + head.size <= len(data):
            return Message(head.group, head.service, head.session, data[content_at : content_at + head.size])
    raise LinkError("The device sent a malformed message; update plctool or the device.", "protocol")


def decode_reply(data: bytes, request: Message) -> bintag.Tags:
    """The elements of the reply to `request`. Raises DeviceError when the service was refused."""
    reply = decode(data)
    if (reply.group, reply.service) != (request.group | lib.L7_REPLY, request.service):
        raise LinkError("The reply of the device is not for the request that was sent.", "protocol")
    tags = bintag.decode(reply.content)
    if tags.find(lib.TAG_ERROR) is not None:
        check_result(tags.u16(lib.TAG_ERROR), f"service {request.group}/0x{request.service:X}")
    return tags


def check_result(result: int, action: str, reason: str = "") -> None:
    """Raises DeviceError unless `result` is ERR_OK. `action`: what was asked for; `reason`: the device's own words."""
    if result != lib.ERR_OK:
        name = error_name(result)
        raise DeviceError(f"The device refused the {action}: {why(result, reason)}.", slug(name), result)


def why(result: int, reason: str = "") -> str:
    """The end of a sentence about an error, with its name. `reason`: the device's own words."""
    known = _WRONG_TARGET.sub(_named_targets, reason.rstrip(".")) or _ADVICE.get(result, "")
    return f"{known} ({error_name(result)})" if known else error_name(result)


_WRONG_TARGET = re.compile(r"for device id 0x([0-9A-F]{1,8}), this device is 0x([0-9A-F]{1,8}): .*")


def _named_targets(found: re.Match[str]) -> str:
    """A device knows its targets by number, users by name."""
    image, device = (int(number, 16) for number in found.groups())
    return f"for {target_name(image)}, this device is {target_name(device)}: build it {built_for(device)}"


def monitoring_error_name(error: int) -> str:
    """MONITORING_ERR_* name of an error, its number when it has none."""
    names = {getattr(lib, name): name for name in dir(lib) if name.startswith("MONITORING_ERR_")}
    return names.get(error, f"monitoring error 0x{error:02X}")


def slug(name: str) -> str:
    """ERR_APP_NOT_LOADED -> app-not-loaded."""
    return name.removeprefix("ERR_").lower().replace("_", "-").replace(" ", "-")
