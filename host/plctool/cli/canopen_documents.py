"""What the actions of `plctool canopen` return, as `--json` prints it, and how users read it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli.output import table
from plctool.errors import DeviceError, UsageError, counted
from plctool.files import read_regular, write_output
from plctool.io.canopen.data_types import DOMAIN, VISIBLE_STRING, DataType, type_named
from plctool.io.canopen.eds import READABLE, WRITABLE, Eds, Entry, load_eds

if TYPE_CHECKING:
    from plctool.canopen.bus import CanopenBus
    from plctool.canopen.lss import Identity, LssMaster

Document = dict[str, Any]
_STRINGS = (0x1008, 0x1009, 0x100A)  # objects of CiA 301 that are strings in every device
_FOREVER = 1e9  # seconds


# ---- files -----------------------------------------------------------------------------------------------------------


def check(path: Path) -> tuple[Document, list[str]]:
    """Every diagnostic of an EDS or DCF, also as users read them, and what the file describes."""
    from plctool.compiler.base.source import Source
    from plctool.compiler.syntax.diagnostics import Diagnostic, render_all

    eds = load_eds(path)
    found = [Diagnostic(m.pos.file, m.pos.line, m.pos.column, m.severity, "eds", m.message) for m in eds.findings.found]
    document = {
        "file": eds.file,
        "diagnostics": [{name: value for name, value in vars(d).items() if name != "missing"} for d in found],
        "more_diagnostics": eds.more_findings,
        **_contents(eds),
    }
    return document, render_all(found, [Source(eds.file, eds.text)])


def _contents(eds: Eds) -> Document:
    commissioning = eds.commissioning
    return {
        "device": vars(eds.device),
        "commissioning": None if commissioning is None else vars(commissioning),
        "objects": len(eds.objects),
        "rpdos": len(eds.pdos(0x1400)),
        "tpdos": len(eds.pdos(0x1800)),
    }


def check_text(document: Document) -> str:
    """One line: what the file describes, and how many doubts there are."""
    device = document["device"]
    severities = [d["severity"] for d in document["diagnostics"]]
    counts = [counted(severities.count(s), s) for s in ("error", "warning")]
    title = " ".join(filter(None, (device["vendor_name"], device["product_name"]))) or "a device without a name"
    kinds = (("objects", "object"), ("rpdos", "RPDO"), ("tpdos", "TPDO"))
    numbers = [counted(document[key], name) for key, name in kinds]
    more = f"; {document['more_diagnostics']} more are not shown" if document["more_diagnostics"] else ""
    return f"{document['file']}: {title}, {', '.join(numbers)}; {', '.join(counts)}{more}"


def usable_eds(path: Path) -> Eds:
    """An EDS for names and types; its doubts are what `check` prints. Raises UsageError if nothing in it is usable."""
    eds = load_eds(path)
    if not eds.objects:
        raise UsageError(f"{path} describes no objects; see 'plctool canopen check {path}'.", "bad-eds")
    return eds


# ---- nodes -----------------------------------------------------------------------------------------------------------


def scan(bus: CanopenBus, listen: float) -> Document:
    """The nodes that answer or send a heartbeat."""
    from plctool.canopen.scan import scan as nodes_on
    from plctool.canopen.sdo import DEFAULT_TIMEOUT
    from plctool.canopen.words import profile_text, state_text

    return {
        "nodes": [
            {
                "node": n.number,
                "state": None if n.state is None else state_text(n.state),
                "device_type": n.device_type,
                "profile": "" if n.device_type is None else profile_text(n.device_type),
                "vendor": n.vendor,
                "product": n.product,
                "revision": n.revision,
                "serial": n.serial,
                "name": n.name,
                "problem": n.problem,
            }
            for n in nodes_on(bus, listen, DEFAULT_TIMEOUT)
        ]
    }


def scan_text(document: Document) -> str:
    """A line for each node; numbers in hex as in data sheets."""
    columns = ["node", "state", "profile", "vendor", "product", "revision", "serial", "name"]
    if any(n["problem"] for n in document["nodes"]):
        columns.append("problem")
    numbers = ("vendor", "product", "revision", "serial")
    rows = [
        {
            **n,
            "state": n["state"] or "no heartbeat",
            **{k: "-" if n[k] is None else f"0x{n[k]:X}" for k in numbers},
        }
        for n in document["nodes"]
    ]
    return table(rows, columns)


def nmt(bus: CanopenBus, name: str, node: int, timeout: float) -> Document:
    """Sends a command; the states that heartbeats show afterwards."""
    from plctool.canopen.nmt import COMMANDS, command
    from plctool.canopen.words import state_text

    states = command(bus, COMMANDS[name], node, timeout)
    return {
        "command": name,
        "node": node or "all",
        "states": {str(number): state_text(state) for number, state in states.items()},
    }


def nmt_text(document: Document) -> str:
    """The state of each node that shows one."""
    if document["states"]:
        return "\n".join(f"node {node}: {state}" for node, state in document["states"].items())
    which = "No node" if document["node"] == "all" else f"Node {document['node']}"
    verb = "sends" if document["node"] == "all" else "does not send"
    return f"The command was sent. {which} {verb} a heartbeat, so the state is not known."


# ---- objects ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Access:
    """An object that a user names, with what is known of it."""

    index: int
    sub: int
    type: DataType | None
    entry: Entry | None = None

    @property
    def place(self) -> str:
        """`6041:00`."""
        return f"{self.index:04X}:{self.sub:02X}"

    @property
    def name(self) -> str:
        """What the EDS calls it, "" without one."""
        return "" if self.entry is None else self.entry.name


def access_to(place: tuple[int, int], type_name: str | None, path: Path | None) -> Access:
    """An object with its type: the one that is named, or that of the EDS. Raises UsageError."""
    index, sub = place
    eds = None if path is None else usable_eds(path)
    entry = None if eds is None else eds.entry(index, sub)
    if eds is not None and entry is None and type_name is None:
        raise UsageError(f"{eds.file} has no object {index:04X}:{sub:02X}; give --type to use it anyway.", "no-object")
    if type_name is not None:
        try:
            return Access(index, sub, type_named(type_name), entry)
        except ValueError as error:
            raise UsageError(f"{error}.", "bad-type") from None
    known = entry.type if entry is not None else VISIBLE_STRING if index in _STRINGS else None
    return Access(index, sub, known, entry)


def sdo_read(bus: CanopenBus, node: int, access: Access, timeout: float, file: Path | None, block: bool) -> Document:
    """Reads an object; its bytes go to a file if there is one."""
    from plctool.canopen.sdo import SdoClient

    if access.entry is not None and access.entry.access not in READABLE:
        raise UsageError(f"{access.place} is {access.entry.access}: it can only be written.", "access")
    is_long = file is not None or access.type is DOMAIN
    size = 0 if access.type is None else access.type.size
    data = SdoClient(bus, node, timeout).read(access.index, access.sub, block=block and is_long, expected=size)
    if file is not None:
        write_output(file, data)
        return {**_about(node, access), "size": len(data), "file": str(file)}
    return {**_about(node, access), **_value(node, access, data)}


def _about(node: int, access: Access) -> Document:
    return {"node": node, "object": access.place, "name": access.name}


def _value(node: int, access: Access, data: bytes) -> Document:
    """The value in the bytes of a device: by its type, else a number without sign if it has 1, 2, 4 or 8 bytes."""
    if access.type is None:
        if len(data) in (1, 2, 4, 8):
            number = int.from_bytes(data, "little")
            return {"value": number, "text": f"{number} (0x{number:0{2 * len(data)}X})", "data": data.hex()}
        return {"value": data.hex(), "text": data.hex(" ") or "no bytes", "data": data.hex()}
    try:
        value = access.type.decode(data)
    except ValueError as error:
        raise DeviceError(f"{access.place} of node {node} has another type: {error}.", "bad-type") from None
    text = access.type.text(value)
    if access.type.kind == "unsigned" and isinstance(value, int):
        text += f" (0x{value:0{2 * access.type.size}X})"
    return {"value": value.hex() if isinstance(value, bytes) else value, "text": text, "data": data.hex()}


def sdo_data(access: Access, text: str | None, file: Path | None) -> bytes:
    """The bytes to write, checked against type, access and limits. Raises UsageError."""
    entry = access.entry
    if entry is not None and entry.access not in WRITABLE:
        raise UsageError(f"{access.place} is {entry.access}: it cannot be written.", "access")
    if file is not None:
        return _bytes_of(file)
    if access.type is None:
        raise UsageError(f"Say the type of {access.place}: --type U16, for example, or --eds FILE.", "bad-type")
    try:
        value = access.type.parse(text or "")
    except ValueError as error:
        raise UsageError(f"{access.place}: {error}.", "bad-value") from None
    for limit, what in ((entry.low, "below its low limit"), (entry.high, "above its high limit")) if entry else ():
        bound = None if limit is None or limit.node_id else limit.value
        if isinstance(value, int | float) and isinstance(bound, int | float):
            outside = value < bound if limit is entry.low else value > bound  # type: ignore[union-attr]
            if outside:
                raise UsageError(f"{access.place}: {text} is {what} {bound}.", "bad-value")
    return access.type.encode(value)


def _bytes_of(file: Path) -> bytes:
    from plctool.canopen.sdo import MAX_VALUE

    try:
        return read_regular(file, MAX_VALUE)
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}.", "no-file") from None


def sdo_write(bus: CanopenBus, node: int, access: Access, data: bytes, timeout: float, block: bool) -> Document:
    """Writes an object."""
    from plctool.canopen.sdo import SdoClient

    SdoClient(bus, node, timeout).write(access.index, access.sub, data, block=block)
    return {**_about(node, access), "size": len(data), "written": True}


def sdo_text(document: Document) -> str:
    """`6041:00 Statusword = 39 (0x0027)`."""
    name = " ".join(filter(None, (document["object"], document["name"])))
    if "text" in document:
        return f"{name} = {document['text']}"
    if "file" in document:
        return f"{document['file']}: {document['size']} bytes of {name}"
    return f"{name}: {document['size']} bytes written"


# ---- what a bus says over time ---------------------------------------------------------------------------------------


def emergencies(bus: CanopenBus, node: int | None) -> Iterator[Document]:
    """Emergency messages as they come, of one node or of all."""
    from plctool.canopen.emcy import emergency_of
    from plctool.canopen.words import emcy_text, register_text

    begin = bus.now()
    for frame in bus.frames(_FOREVER):
        found = emergency_of(frame)
        if found is None or node not in (None, found.node):
            continue
        yield {
            "time_s": round(frame.time - begin, 6),
            "node": found.node,
            "code": found.code,
            "text": emcy_text(found.code),
            "register": found.register,
            "register_text": register_text(found.register),
            "data": found.data.hex(),
        }


def emergency_text(document: Document) -> str:
    """A line: time, node, code and what it means."""
    register = f"; register: {document['register_text']}" if document["register"] else ""
    return (
        f"{document['time_s']:8.3f} s  node {document['node']}  {document['code']:04X}  {document['text']}"
        f"{register}; data {document['data']}"
    )


def pdos(bus: CanopenBus, node: int, eds: Eds | None, timeout: float, *, passive: bool) -> Iterator[Document]:
    """The values of PDOs as they come. `passive`: their mapping is that of the EDS, and nothing is sent."""
    from plctool.canopen.pdo import RPDO, TPDO, naming_by, pdos_of_device, pdos_of_eds, values_in
    from plctool.canopen.sdo import SdoClient

    if passive and eds is not None:
        found = [pdo for base in (TPDO, RPDO) for pdo in pdos_of_eds(eds, node, base)]
    else:
        client = SdoClient(bus, node, timeout)
        found = [pdo for base in (TPDO, RPDO) for pdo in pdos_of_device(client, base)]
    by_identifier = {pdo.identifier: pdo for pdo in found}
    if not by_identifier:
        raise DeviceError(f"Node {node} has no PDO that is switched on.", "no-pdo")
    naming, begin = naming_by(eds), bus.now()
    for frame in bus.frames(_FOREVER):
        pdo = by_identifier.get(frame.identifier)
        if pdo is None:
            continue
        parts = values_in(pdo, frame, naming)
        yield {
            "time_s": round(frame.time - begin, 6),
            "node": node,
            "pdo": pdo.name,
            "data": frame.data.hex(),
            "values": None
            if parts is None
            else [
                {"name": p.name, "value": p.value.hex() if isinstance(p.value, bytes) else p.value, "text": p.text}
                for p in parts
            ],
        }


def pdo_text(document: Document) -> str:
    """A line: time, PDO and its values."""
    head = f"{document['time_s']:8.3f} s  {document['pdo']}"
    if document["values"] is None:
        return f"{head}  {document['data'] or 'no data'}: shorter than its mapping"
    return "  ".join([head, *(f"{v['name']} = {v['text']}" for v in document["values"])])


def watch(
    bus: CanopenBus, node: int, accesses: Sequence[Access], interval: float, timeout: float
) -> Iterator[Document]:
    """Values of objects, read one after the other each `interval` seconds."""
    from plctool.canopen.sdo import SdoClient

    client, begin = SdoClient(bus, node, timeout), bus.now()
    following = begin
    while True:
        for _ in bus.frames(following - bus.now()):
            pass
        following = max(following + interval, bus.now())
        moment = bus.now() - begin
        values = []
        for access in accesses:
            size = 0 if access.type is None else access.type.size
            data = client.read(access.index, access.sub, expected=size)
            values.append({"object": access.place, "name": access.name, **_value(node, access, data)})
        yield {"time_s": round(moment, 6), "node": node, "values": values}


def watch_text(document: Document) -> str:
    """A line: time and values."""
    return "  ".join([f"{document['time_s']:8.3f} s", *map(sdo_text, document["values"])])


# ---- LSS -------------------------------------------------------------------------------------------------------------


def lss_scan(master: LssMaster) -> Document:
    """The devices without a number."""
    try:
        found = list(master.find_all())
    finally:
        master.release()
    return {"devices": [{**vars(identity), "identity": str(identity)} for identity in found]}


def lss_scan_text(document: Document) -> str:
    """The identity of each device, as `lss set-node` takes it."""
    return "\n".join(d["identity"] for d in document["devices"]) or "No device without a node number answers."


def lss_set(master: LssMaster, action: str, number: int, identity: Identity | None) -> Document:
    """Gives a device a node number or a bit rate, and has it stored. `identity` None: the only one without a number.
    Raises UsageError if there are several, DeviceError if it refuses."""
    chosen = _only_one(master) if identity is None else identity
    try:
        master.select(chosen)
        if action == "set-node":
            master.set_node(number)
            if (shown := master.node()) != number:
                raise DeviceError(f"The device took node number {number}, but reports {shown}.", "lss-refused")
        else:
            master.set_bit_rate(number)
        master.store()
    finally:
        master.release()
    return {"identity": str(chosen), "node" if action == "set-node" else "bitrate_kbit": number, "stored": True}


def _only_one(master: LssMaster) -> Identity:
    try:
        found = list(master.find_all())
    finally:
        master.release()
    if not found:
        raise DeviceError("No device without a node number answers; name the device by its identity.", "lss-none")
    if len(found) > 1:
        names = ", ".join(map(str, found))
        raise UsageError(f"{len(found)} devices have no node number; name one of them: {names}.", "lss-several")
    return found[0]


def lss_set_text(document: Document) -> str:
    """What the device has taken."""
    if "node" in document:
        return f"{document['identity']} is node {document['node']} now, and keeps that."
    return f"{document['identity']} uses {document['bitrate_kbit']} kbit/s after its next power-up."
