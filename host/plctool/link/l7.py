"""Layer 7 messages: header, service errors (codesys-v3-protocol 4.1, 4.2)."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from plctool.core import error_name, lib
from plctool.errors import DeviceError, LinkError
from plctool.link import bintag

_HEADER = struct.Struct("<HHHHIIHH")
_SHORT_LENGTH, _LONGEST_LENGTH = 12, 64
_LENGTH_BASE = 4  # the header length field counts from here

_ADVICE = {
    lib.ERR_INVALID_STATE: "it stopped with an exception, reset it first",
    lib.ERR_APP_NOT_LOADED: "there is no application, flash one first",
    lib.ERR_NOMEMORY: "it is too large for the device",
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
        lib.L7_PROTOCOL,
        lib.L7_HEADER_LENGTH,
        message.group,
        message.service,
        message.session,
        len(message.content),
        0,
        0,
    )
    return head + message.content


def decode(data: bytes) -> Message:
    """The message in `data`; raises LinkError when it is none."""
    if len(data) >= _LENGTH_BASE + _SHORT_LENGTH:
        protocol, length, group, service, session, size = struct.unpack_from("<HHHHII", data)
        content_at = _LENGTH_BASE + length
        fits = _SHORT_LENGTH <= length <= _LONGEST_LENGTH and content_at + size <= len(data)
        if protocol == lib.L7_PROTOCOL and fits:
            return Message(group, service, session, data[content_at : content_at + size])
    raise LinkError("The device sent an answer that is none; update plctool or the device.", "protocol")


def decode_reply(data: bytes, request: Message) -> bintag.Tags:
    """The elements of the reply to `request`. Raises DeviceError when the service was refused."""
    reply = decode(data)
    if (reply.group, reply.service) != (request.group | lib.L7_REPLY, request.service):
        raise LinkError("The device answered another request than the one sent.", "protocol")
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
    known = reason.rstrip(".") or _ADVICE.get(result, "")
    return f"{known} ({error_name(result)})" if known else error_name(result)


def monitoring_error_name(error: int) -> str:
    """MONITORING_ERR_* name of an error, its number when it has none."""
    names = {getattr(lib, name): name for name in dir(lib) if name.startswith("MONITORING_ERR_")}
    return names.get(error, f"monitoring error 0x{error:02X}")


def slug(name: str) -> str:
    """ERR_APP_NOT_LOADED -> app-not-loaded."""
    return name.removeprefix("ERR_").lower().replace("_", "-").replace(" ", "-")
