"""The arguments of the command line. What reads values is imported when it is needed, so that every start is quick."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from plctool.errors import UsageError, did_you_mean
from plctool.files import STDIN, file_path, usable_path
from plctool.iec.dialect import DIALECTS
from plctool.image.targets import DEFAULT_TARGET, TARGETS
from plctool.link.transports import TRANSPORTS, Value
from plctool.templates import DEFAULT_TEMPLATE, TEMPLATES

if TYPE_CHECKING:
    from plctool.compiler import Level

DEFAULT_INTERVAL = 0.5  # seconds between two readings
BENCH_CYCLES = 10000
_ONE_DOCUMENT = "print one JSON document and nothing else"


class _Parser(argparse.ArgumentParser):
    """Reports wrong arguments as UsageError, like all other wrong use. Options are written whole, so that they mean the
    same when there are more of them."""

    def __init__(self, **words: Any) -> None:
        super().__init__(allow_abbrev=False, **words)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Of what a command does not know, it says so itself."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        message = self._without_value(message) or message + self._meant(message)
        raise UsageError(f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.", "usage")

    def _without_value(self, message: str) -> str:
        """What to say of an option without its value, "" for other mistakes."""
        found = re.match(r"argument (\S+): expected (?:at least )?one argument", message)
        option = "" if found is None else found[1].rpartition("/")[2]
        action = self._option_string_actions.get(option)
        if action is None:
            return ""
        value = action.metavar or "|".join(map(str, action.choices or ())) or action.dest.upper()
        return f"{option} is followed by {value}"

    def _meant(self, message: str) -> str:
        """`(did you mean --version?)` for an option that is not known, if there is one like it."""
        found = re.match(r"unrecognized arguments: (-\S+)", message)
        hint = "" if found is None else did_you_mean(found[1], self._option_string_actions)
        return f" ({hint.removeprefix('; ')})" if hint else ""


def parser() -> argparse.ArgumentParser:
    """Reads the words after `plctool`; `command` is the name of one in the result, "" if there is none."""
    root = _Parser(prog="plctool", description="Compile IEC 61131-3 Structured Text and run it on small controllers.")
    root.add_argument("--version", action="store_true", help="print the version and exit")
    root.set_defaults(command="")
    commands = root.add_subparsers(title="commands", metavar="COMMAND", parser_class=_Parser)

    def command(name: str, text: str, json: str = _ONE_DOCUMENT) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text[:1].upper() + text[1:] + ".")
        sub.add_argument("--json", action="store_true", help=json)
        sub.set_defaults(command=name)
        return sub

    _add_file_commands(command)
    _add_device_commands(command)
    _add_io_commands(command)
    _add_canopen_commands(command)
    command("demo", "run a demonstration of all of it on this machine")
    completion = command("completion", "print the script that makes a shell complete this command")
    completion.add_argument("shell", choices=["bash", "zsh", "fish"], metavar="bash|zsh|fish", help="your shell")
    command("man", "print the manual page, for 'man -l -'")
    return root


def _add_file_commands(command: Callable[..., argparse.ArgumentParser]) -> None:
    build = command("build", "compile a program to an image")
    _add_sources(build)
    build.add_argument(
        "-o", "--output", type=file_path, metavar="IMAGE", help="default: app.cdl, of a project beside plc.toml"
    )
    _add_target(build, f"processor; default: that of the board, or {DEFAULT_TARGET}")
    _add_board(build, "whose limits the program must keep, such as mps2-an385/standard")
    _add_firmware(build, "the same for a board of your own: what runs on it")
    build.add_argument(
        "--no-limits", action="store_true", help="build also what no device that plctool knows has room for"
    )
    _add_build_options(build)
    _add_warnings(build)
    _add_io_files(build)

    check = command("check", "print every diagnostic of a program")
    _add_sources(check)
    check.add_argument(
        "--missing", action="store_true", help="print one table: the names it needs of libraries of other systems"
    )
    check.add_argument(
        "--sarif", type=file_path, metavar="FILE", help="write a report for code scanning (SARIF) as well"
    )
    check.add_argument("--junit", type=file_path, metavar="FILE", help="write a report in JUnit's format as well")
    _add_warnings(check)
    _add_io_files(check)

    fmt = command("fmt", "format Structured Text: one style, the program stays the same")
    fmt.add_argument(
        "sources", nargs="*", type=_input, metavar="FILE.st|DIR|-",
        help="for a folder, all sources in it; -: from the standard input to the standard output; without any, the "
        "project of the current folder (plc.toml)",
    )  # fmt: skip
    fmt.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a file is not formatted")
    fmt.add_argument("--diff", action="store_true", help="the same, and print what would change")
    fmt.add_argument(
        "--lines", action="append", default=[], type=_lines, metavar="A:B",
        help="only lines A to B, from 1, of one file; may be repeated",
    )  # fmt: skip

    info = command("info", "describe an image, or the programs in a .bin or .hex of 'plctool image'")
    _add_image(info)

    image = command("image", "write what a production programmer burns: a flash with its program")
    _add_image(image)
    _add_board(image, "such as plcrt, mps2-an385/standard")
    _add_firmware(image, "burn it as well; a board of your own is read from it")
    image.add_argument("-o", "--output", type=file_path, required=True, metavar="FILE.hex|.bin")

    symbols = command("symbols", "list the variables of an image with their types")
    _add_image(symbols)
    symbols.add_argument("patterns", nargs="*", type=_text, metavar="PATTERN", help="names with * and ?: 'Main.pump.*'")

    new = command("new", "make a project that builds, runs and has a passing test")
    new.add_argument(
        "folder", type=usable_path, metavar="NAME", help="of the project, and of the folder that is made for it"
    )
    kinds = "; ".join(f"{name}: {text}" for name, text in TEMPLATES.items())
    new.add_argument(
        "--template", choices=TEMPLATES, default=DEFAULT_TEMPLATE, help=f"{kinds}; default: {DEFAULT_TEMPLATE}"
    )

    run = command("run", "run a program in this process, on a virtual clock")
    _add_image(run, "which is compiled for this machine")
    length = run.add_mutually_exclusive_group()
    length.add_argument("--cycles", type=_count, metavar="N", help="number of cycles of the first task; default: 1")
    length.add_argument("--time", type=_duration_ms, metavar="T#10s", help="how much virtual time, instead of cycles")
    run.add_argument(
        "--set",
        action="append",
        default=[],
        type=_text,
        metavar="NAME=VALUE",
        help="set before the first cycle; may be repeated",
    )
    run.add_argument(
        "--get",
        action="append",
        default=[],
        type=_text,
        metavar="NAME",
        help="print after the last cycle; may be repeated",
    )

    run.add_argument(
        "--plant",
        type=usable_path,
        metavar="FILE.py|.st|.cdl",
        help="what the inputs and outputs are connected to: Python with 'def step(plc)', or a program (docs/io.md)",
    )
    run.add_argument(
        "--fault",
        action="append",
        default=[],
        type=_text,
        metavar="DEVICE=FAULT",
        help="of a simulated device, with value and time: Tank=late:150@T#5s (docs/io.md); may be repeated",
    )
    run.add_argument(
        "--trace", nargs="+", action="extend", default=[], type=_text, metavar="NAME",
        help="write the values after each cycle to a CSV file; may be repeated",
    )  # fmt: skip
    run.add_argument(
        "-o",
        "--output",
        type=usable_path,
        metavar="FILE",
        help="of --trace, - for the standard output; default: trace.csv",
    )

    test = command("test", "run the unit tests of a program in this process, on a virtual clock")
    _add_sources(test)
    test.add_argument(
        "-k",
        "--filter",
        default="*",
        type=_text,
        metavar="PATTERN",
        help="only tests whose name contains PATTERN (or matches it, with * and ?)",
    )
    test.add_argument("--junit", type=file_path, metavar="FILE", help="write a report in JUnit's format as well")
    test.add_argument(
        "--coverage",
        type=file_path,
        metavar="DIR",
        help="say which lines ran, and write index.html and cobertura.xml into this folder",
    )
    test.add_argument("-O", dest="level", type=int, choices=range(4), default=0, help="optimisation; default: 0")
    _add_warnings(test)
    _add_io_files(test)

    xml = command("export", "write a program as PLCopen XML, for CODESYS, TwinCAT, OpenPLC Editor and Beremiz")
    _add_sources(xml)
    xml.add_argument("-o", "--output", dest="xml", type=file_path, required=True, metavar="FILE.xml")
    _add_warnings(xml)
    _add_io_files(xml)

    export = command("export-itf", "write a C header, and a C file to fill in, for functions implemented in C")
    _add_sources(export)
    export.add_argument(
        "-o", "--output", type=file_path, default=Path(), metavar="DIR", help="default: the current folder"
    )
    export.add_argument("--force", action="store_true", help="also replace an implementation that is there already")
    _add_dialect(export)
    _add_io_files(export, "write the C header of this board instead")

    bench = command("bench", "measure the time of a cycle on this machine")
    _add_image(bench, "which is compiled for this machine")
    bench.add_argument("--cycles", type=_count, default=BENCH_CYCLES, metavar="N", help=f"default: {BENCH_CYCLES}")


def _add_device_commands(command: Callable[..., argparse.ArgumentParser]) -> None:
    flash = command("flash", "send an image to a device and start it")
    _add_image(flash)
    flash.add_argument("--no-start", action="store_true", help="do not start it; it starts at the next power-up")
    flash.add_argument("--force", action="store_true", help="send it even if the device has it already")
    flash.add_argument(
        "--with-source", nargs="*", type=usable_path, metavar="FILE.st|DIR",
        help="also keep its sources and symbols on the device; without any, those of the project of the current folder",
    )  # fmt: skip
    _add_link(flash)

    scan = command("scan", "list the devices that answer; without a link, on all serial ports")
    scan.add_argument("--long", action="store_true", help="also show the state and the program of each device")
    _add_link(scan)
    _add_link(command("status", "show the state of the program"))
    _add_link(command("start", "start the program"))
    _add_link(command("stop", "stop the program"))
    _add_link(command("cycle", "run one cycle of each task of a stopped program"))
    reset = command("reset", "reset the program; it is stopped afterwards")
    reset.add_argument(
        "option", choices=["warm", "cold", "origin"], metavar="warm|cold|origin",
        help="warm keeps RETAIN variables, cold only PERSISTENT ones, origin deletes the program",
    )  # fmt: skip
    _add_link(reset)
    _add_link(command("tasks", "show the times of the tasks"))
    _add_link(command("log", "print the log of a device"))
    shell = command("shell", "send a command to the PLC shell of a device; ? lists them")
    _add_link(shell)
    shell.add_argument(
        "words", nargs="+", type=_text, metavar="COMMAND", help="for example ?, rtsinfo, tasklist, plcload"
    )

    passwd = command("passwd", "set, change or remove the password of a device")
    _add_link(passwd)
    passwd.add_argument("--remove", action="store_true", help="every tool that reaches the device may use it again")
    passwd.add_argument(
        "--new-password-file", type=Path, metavar="FILE",
        help="its first line; else the environment's PLC_NEW_PASSWORD, or what you type",
    )  # fmt: skip

    _add_file_actions(command)

    port = command("port-check", "check a port: run programs on a board and compare the results with what is expected")
    port.add_argument("--yes", action="store_true", help="replace the program that is on the board")
    port.add_argument("--power-cycle", action="store_true", help="also ask for the board to be switched off and on")
    port.add_argument(
        "--max-drift", type=_percent, default=0.01, metavar="PERCENT",
        help="largest error of its clock; default: 1; a simulated board on a busy host needs more",
    )  # fmt: skip
    port.add_argument(
        "--wire", action="append", default=[], metavar="OUTPUT=INPUT",
        help="lines of the board that are wired: the input has to follow the output; may be given several times",
    )  # fmt: skip
    port.add_argument("--device", type=usable_path, metavar="FILE.toml", help="names of its lines, and its modules")
    _add_link(port)

    read = command("read", "print values of variables")
    _add_names(read)
    _add_link(read, symbols=True)
    write = command("write", "set variables")
    write.add_argument(
        "values", nargs="+", type=_text, metavar="NAME=VALUE", help="value as 'read' shows it: Main.pause=T#2s"
    )
    _add_link(write, symbols=True)
    force = command("force", "keep variables, inputs and outputs at a value, whatever the program and devices write")
    force.add_argument(
        "values",
        nargs="+",
        type=_text,
        metavar="NAME=VALUE",
        help="value as 'read' shows it: Main.pause=T#2s, %%IX0.3=1",
    )
    _add_link(force, symbols=True)
    unforce = command("unforce", "end what 'force' did")
    unforce.add_argument(
        "names", nargs="*", type=_text, metavar="NAME", help="a variable, as 'force' or 'forced' names it"
    )
    unforce.add_argument("--all", action="store_true", help="all that is forced")
    _add_link(unforce, symbols=True)
    _add_link(command("forced", "print what is forced"), symbols=True)
    watch = command(
        "watch", "print values of variables periodically", json="print a JSON document a line for each reading"
    )
    _add_names(watch)
    watch.add_argument("--interval", type=_seconds, default=DEFAULT_INTERVAL, metavar="S", help="seconds; default: 0.5")
    watch.add_argument("--count", type=_count, metavar="N", help="readings; default: until Ctrl-C")
    watch.add_argument(
        "--csv", type=usable_path, metavar="FILE", help="write a line a reading to this file, - for the standard output"
    )
    _add_link(watch, symbols=True)

    page = command("ui", "show a page in a browser: live values, write, force, tasks, log, inputs and outputs")
    page.add_argument(
        "--sim", dest="image", type=usable_path, nargs="?", const=Path(), metavar="IMAGE|PROJECT",
        help="of a program that runs in this process instead; without a name, of the project of the current folder",
    )  # fmt: skip
    page.add_argument(
        "--plant", type=usable_path, metavar="FILE", help="of --sim: what the inputs and outputs are connected to"
    )
    page.add_argument(
        "--port-number",
        type=_port_number,
        default=0,
        metavar="N",
        help="of the page on this machine; default: a free one",
    )
    page.add_argument("--open", action="store_true", help="open the page in the browser of this machine")
    _add_link(page, symbols=True)

    gateway = command("gateway", "show or end the processes that share a serial line among tools")
    gateway.add_argument(
        "what", choices=["status", "stop"], metavar="status|stop",
        help="status: tools of each line; stop: end it, its tools get an error",
    )  # fmt: skip
    gateway.add_argument("--port", metavar="PORT", help="only the gateway of this port; default: all of this user")


def _add_file_actions(command: Callable[..., argparse.ArgumentParser]) -> None:
    action = _actions(command("files", "list, get, put and delete the files of a device"))
    _add_link(action("list", "list the files"))
    get = action("get", "copy a file from the device")
    get.add_argument("name", type=_text, metavar="NAME", help="as 'plctool files list' shows it")
    get.add_argument(
        "-o", "--output", type=usable_path, metavar="FILE",
        help="- for the standard output; default: its name, in this folder",
    )  # fmt: skip
    _add_link(get)
    put = action("put", "copy a file to the device, in place of the previous one of its name")
    put.add_argument("file", type=usable_path, metavar="FILE")
    put.add_argument("--name", type=_text, metavar="NAME", help="on the device; default: that of the file")
    _add_link(put)
    delete = action("delete", "delete a file of the device")
    delete.add_argument("name", type=_text, metavar="NAME", help="as 'plctool files list' shows it")
    _add_link(delete)

    action = _actions(command("source", "keep the sources of the program on the device, and get them back"))
    get = action("get", "write the sources that the device keeps into a folder")
    get.add_argument("-o", "--output", type=file_path, metavar="DIR", help="default: source")
    _add_link(get)
    put = action("put", "put the sources of the program that is on the device there as well")
    put.set_defaults(no_warn=[], werror=None)
    _add_sources(put)
    _add_target(put, "processor, where it is not that of the board in plc.toml")
    _add_board(put, "that the program was built for, such as mps2-an385/full")
    _add_build_options(put)
    _add_dialect(put)
    _add_io_files(put)
    _add_link(put)


def _actions(command: argparse.ArgumentParser) -> Callable[[str, str], argparse.ArgumentParser]:
    """Adds the actions of a command, one by one."""
    actions = command.add_subparsers(title="what", metavar="WHAT", dest="what", required=True, parser_class=_Parser)

    def action(name: str, text: str) -> argparse.ArgumentParser:
        sub = actions.add_parser(name, help=text, description=text[:1].upper() + text[1:] + ".")
        sub.add_argument("--json", action="store_true", help=_ONE_DOCUMENT)
        return sub

    return action


def _add_io_commands(command: Callable[..., argparse.ArgumentParser]) -> None:
    action = _actions(command("io", "show and check what is connected to the inputs and outputs"))

    io_map = action("map", "list the channels of an image with their variables and tasks")
    _add_image(io_map)
    init = action("init", "write a description with comments, to begin with")
    init.add_argument("file", type=file_path, nargs="?", default=Path("main.io.toml"), metavar="FILE.io.toml")
    init.add_argument("--device", type=usable_path, metavar="FILE.toml", help="what the vendor says of the board")
    _add_link(action("status", "show how the devices of the running program are"))
    scan = action("scan", "list what is on a bus")
    scan.add_argument("io_device", type=_text, metavar="BUS", help="its name in 'plctool io status'")
    _add_link(scan)
    identify = action("identify", "let a device show itself")
    identify.add_argument("io_device", type=_text, metavar="DEVICE", help="its name in 'plctool io status'")
    _add_link(identify)
    param = action("param", "read or set a parameter of a device, until the program is loaded again")
    param.add_argument("verb", choices=["get", "set"], metavar="get|set")
    param.add_argument("io_device", type=_text, metavar="DEVICE", help="its name in 'plctool io status'")
    param.add_argument("parameter", type=_text, metavar="NAME|ID[=VALUE]", help="set: with its value")
    param.add_argument("--type", metavar="TYPE", help="of one that the description does not have; default: UDINT")
    _add_link(param, symbols=True)


def _add_canopen_commands(command: Callable[..., argparse.ArgumentParser]) -> None:
    action = _actions(command("canopen", "find, set up and watch CANopen devices; check EDS files"))

    check = action("check", "print every diagnostic of an EDS or DCF")
    check.add_argument("eds", type=usable_path, metavar="FILE.eds|.dcf")

    scan = action("scan", "list the nodes with their state and identity")
    _add_canopen_link(scan, "and for heartbeats", 1.2)

    nmt = action("nmt", "change the state of a node or of all")
    nmt.add_argument("command_name", choices=_NMT, metavar="|".join(_NMT))
    nmt.add_argument("node_number", type=_canopen_node_or_all, metavar="NODE|all")
    _add_canopen_link(nmt, "for the heartbeat that shows the state", 1.2)

    sdo = action("sdo", "read or write an object of a node")
    sdo.add_argument("verb", choices=["read", "write"], metavar="read|write")
    sdo.add_argument("node_number", type=_canopen_node, metavar="NODE", help="1 to 127")
    sdo.add_argument("object", type=_canopen_object, metavar="INDEX[:SUB]", help="in hex: 6041, 1018:01")
    sdo.add_argument("value", nargs="?", type=_text, metavar="VALUE", help="to write, unless --file has it")
    sdo.add_argument("--type", metavar="TYPE", help="U16, INTEGER32, REAL32, STRING and so on, if no EDS says it")
    sdo.add_argument("--file", type=usable_path, metavar="FILE", help="write its bytes, or read into it")
    sdo.add_argument("--no-block", action="store_true", help="do not try block transfer")
    _add_eds(sdo)
    _add_canopen_link(sdo, "for a reply", 1.0)

    emcy = action("emcy", "print emergency messages")
    emcy.add_argument("--node", dest="node_number", type=_canopen_node, metavar="NODE", help="only of this node")
    _add_canopen_stream(emcy)
    pdo = action("pdo", "print the values in the PDOs of a node")
    pdo.add_argument("node_number", type=_canopen_node, metavar="NODE")
    pdo.add_argument("--passive", action="store_true", help="send nothing: take the mapping from the EDS")
    _add_eds(pdo)
    _add_canopen_stream(pdo)
    watch = action("watch", "print values of objects periodically")
    watch.add_argument("node_number", type=_canopen_node, metavar="NODE")
    watch.add_argument("objects", nargs="+", type=_canopen_object, metavar="INDEX[:SUB]")
    watch.add_argument("--type", metavar="TYPE", help="of all of them, if no EDS says it")
    watch.add_argument(
        "--interval", type=_seconds, default=DEFAULT_INTERVAL, metavar="S", help=f"seconds; default: {DEFAULT_INTERVAL}"
    )
    _add_eds(watch)
    _add_canopen_stream(watch)

    lss = action("lss", "find nodes without a number; set numbers and bit rates")
    lss.add_argument("lss_action", choices=["scan", "set-node", "set-bitrate"], metavar="scan|set-node|set-bitrate")
    lss.add_argument("number", nargs="?", type=_count, metavar="NODE|KBIT", help="the new node number, or kbit/s")
    lss.add_argument(
        "identity", nargs="?", type=_text, metavar="VENDOR:PRODUCT:REVISION:SERIAL",
        help="which device, as 'lss scan' lists it; default: the only one without a number",
    )  # fmt: skip
    lss.add_argument("--yes", action="store_true", help="set-bitrate: the device cannot be reached at the old one")
    lss.add_argument(
        "--question", type=_seconds, default=0.05, metavar="S", help="time for a reply of a scan; default: 0.05"
    )
    _add_canopen_link(lss, "for a reply to a setting", 1.0)


_NMT = ("start", "stop", "preop", "reset", "reset-comm")


def _add_eds(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--eds", type=usable_path, metavar="FILE", help="EDS or DCF with names, types and limits")


def _add_canopen_stream(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--count", type=_count, metavar="N", help="lines; default: until Ctrl-C")
    _add_canopen_link(parser, "for a reply", 1.0)


def _add_canopen_link(parser: argparse.ArgumentParser, what: str, seconds: float) -> None:
    link = parser.add_argument_group("bus")
    can = TRANSPORTS["can"]
    link.add_argument("--can", metavar=can.shape, help="any interface of python-can; default: as for other commands")
    link.add_argument("--bitrate", metavar="N", help=can.options["bitrate"].help)
    parser.add_argument(
        "--timeout", type=_seconds, default=seconds, metavar="S", help=f"seconds to wait {what}; default: {seconds:g}"
    )
    flags = [kind.flag for kind in TRANSPORTS.values() if kind.flag]
    others = {name.replace("-", "_"): None for name in [*flags, *_option_helps()]}
    parser.set_defaults(**{name: None for name in others if name not in ("can", "bitrate")})


def _canopen_node(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and 1 <= int(text[:4]) <= 127):
        raise argparse.ArgumentTypeError(f"'{text}' is not the number of a node, 1 to 127")
    return int(text)


def _canopen_node_or_all(text: str) -> int:
    return 0 if text == "all" else _canopen_node(text)


def _canopen_object(text: str) -> tuple[int, int]:
    """Index and sub-index of 6041, 0x6041, 1018:01."""
    found = re.fullmatch(r"(?:0x)?([0-9a-f]{4})(?::(?:0x)?([0-9a-f]{1,2}))?", text, re.IGNORECASE)
    if found is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not an object; write its index in hex: 6041 or 1018:01")
    return int(found[1], 16), int(found[2] or "0", 16)


def _add_target(parser: argparse.ArgumentParser, text: str) -> None:
    target = parser.add_argument("--target", metavar="NAME", help=text)
    target.completer = lambda **words: TARGETS  # type: ignore[attr-defined]  # for argcomplete


def _add_firmware(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--firmware", type=usable_path, metavar="FILE.elf", help=text)


def _add_board(parser: argparse.ArgumentParser, text: str) -> None:
    def names(**words: object) -> list[str]:
        from plctool.image.board import known_boards

        return [board.slug for board in known_boards()]

    parser.add_argument("--board", metavar="NAME", help=text).completer = names  # type: ignore[attr-defined]


def _add_sources(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "sources", nargs="*", type=usable_path, metavar="FILE.st|DIR",
        help="for a folder, all sources in it; without any, the project of the current folder (plc.toml)",
    )  # fmt: skip
    parser.add_argument(
        "--library", action="append", default=[], type=usable_path, metavar="DIR|FILE.zip",
        help="a library (with library.toml), or a folder of them; may be repeated",
    )  # fmt: skip


def _add_build_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-O", dest="level", type=_level, metavar="0..3|s",
        help="optimisation, 3 for the fastest code, s for the smallest, both with fewer variables of blocks to watch; "
        "default: 2",
    )  # fmt: skip
    parser.add_argument(
        "--checks",
        metavar="all|none|LIST",
        help="run-time checks: div, bounds, subrange, null; default: all",
    )
    parser.add_argument(
        "--debug", action=argparse.BooleanOptionalAction, help="optimise less, so that the code is close to its source"
    )


def _add_image(parser: argparse.ArgumentParser, built: str = "which is built first if it has changed") -> None:
    parser.add_argument(
        "image", type=usable_path, nargs="?", metavar="IMAGE|PROJECT",
        help=f"what 'plctool build' wrote, or a project, {built}; default: the project of this folder (plc.toml)",
    )  # fmt: skip


def _add_names(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "names", nargs="+", type=_text, metavar="NAME", help="such as Main.lamp, Main.list[3], Main.pump.*"
    )


def _add_dialect(parser: argparse.ArgumentParser) -> None:
    dialect = parser.add_argument(
        "--dialect", metavar="|".join(DIALECTS), help="the system whose rules hold where they disagree"
    )
    dialect.completer = lambda **words: DIALECTS  # type: ignore[attr-defined]


def _add_warnings(parser: argparse.ArgumentParser) -> None:
    _add_dialect(parser)
    parser.add_argument(
        "--no-warn",
        action="append",
        default=[],
        metavar="NAME,...",
        help="do not report these warnings; may be repeated",
    )
    parser.add_argument("--werror", action=argparse.BooleanOptionalAction, help="treat warnings as errors")


def _add_io_files(parser: argparse.ArgumentParser, device: str = "what the vendor says of the board") -> None:
    parser.add_argument(
        "--io", type=usable_path, metavar="FILE.io.toml", help="inputs and outputs; default: what is beside the sources"
    )
    parser.add_argument("--device", type=usable_path, metavar="FILE.toml", help=device)


def _add_link(parser: argparse.ArgumentParser, symbols: bool = False) -> None:
    link = parser.add_argument_group("link")
    for kind in TRANSPORTS.values():
        if kind.flag:
            link.add_argument(f"--{kind.flag}", metavar=kind.shape, help=kind.help)
    for name, text in _option_helps().items():
        link.add_argument(f"--{name}", metavar="N", help=text)
    link.add_argument("--no-gateway", action="store_true", help="do not share the port, as with PLCTOOL_GATEWAY=off")
    link.add_argument(
        "--password-file", type=Path, metavar="FILE",
        help="first line: the device's password, if it has one; else the environment's PLC_PASSWORD, or what you type",
    )  # fmt: skip
    if symbols:
        parser.add_argument(
            "--symbols", type=usable_path, metavar="FILE.sym", help="if they are not found automatically"
        )


def _option_helps() -> dict[str, str]:
    """What is said of each option of links; one that several kinds have may have a default of its own in each."""
    helps: dict[str, str] = {}
    defaults: dict[str, dict[Value, str]] = {}
    for kind in TRANSPORTS.values():
        for name, option in kind.options.items():
            helps[name] = option.help
            defaults.setdefault(name, {}).setdefault(option.default, kind.flag)
    for name, of_kinds in defaults.items():
        texts = [
            f"{value} with --{flag}" if i else f"default: {value}" for i, (value, flag) in enumerate(of_kinds.items())
        ]
        helps[name] += "; " + ", ".join(texts) if any(of_kinds) else ""
    return helps


def _text(text: str) -> str:
    """What is no path. The bytes that the encoding of the locale does not have came as surrogates: they are UTF-8."""
    if text.isascii():
        return text
    try:
        return text.encode("utf-8", "surrogateescape").decode("utf-8")
    except UnicodeError:
        shown = text.encode("ascii", "backslashreplace").decode()
        raise UsageError(f"{shown} is not UTF-8; type it in the encoding of this terminal.", "usage") from None


def _input(text: str) -> Path:
    """A path, or - for the standard input."""
    return STDIN if text == str(STDIN) else usable_path(text)


def _lines(text: str) -> tuple[int, int]:
    """The first and the last line of a range."""
    found = re.fullmatch(r"(\d{1,9}):(\d{1,9})", text, re.ASCII)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise UsageError(f"--lines {text} is not a range of lines; write for example --lines 10:20.", "usage")
    return int(found[1]), int(found[2])


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number above 0")
    return int(text)


def _port_number(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 1 to 65535")
    return int(text)


def _seconds(text: str) -> float:
    with suppress(ValueError):
        if 0 <= (seconds := float(text)) < 1e6:
            return seconds
    raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds")


def _level(text: str) -> Level:
    if text == "s":
        return "s"
    if text not in ("0", "1", "2", "3"):
        raise argparse.ArgumentTypeError(f"'{text}' is not an optimisation level; use 0, 1, 2, 3 or s")
    return int(text)


def _percent(text: str) -> float:
    return _seconds(text.removesuffix("%")) / 100


def _duration_ms(text: str) -> float:
    from plctool.iec.value_texts import parse_milliseconds

    milliseconds = parse_milliseconds(text)
    if milliseconds < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is in the past")
    return milliseconds


def pairs(texts: Sequence[str]) -> dict[str, str]:
    """NAME=VALUE or NAME:=VALUE arguments."""
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip().removesuffix(":").strip()
        if not equals or not name:
            raise UsageError(f"'{text}' is not NAME=VALUE; write for example Main.speed=5.", "usage")
        found[name] = value
    return found
