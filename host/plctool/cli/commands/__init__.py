"""The commands of plctool: a row for each, in the order of `plctool --help`. What a command needs is in its module.

The function `NAME_arguments` of the module (`export_itf_arguments` of `export-itf`) adds the arguments, and names the
function that runs the command by `set_defaults(action=...)`. Only the module of the command that is typed is imported.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """A command: its name, the module in this package, and what `--help` says of it."""

    name: str
    module: str
    summary: str


GROUPS: dict[str, tuple[Row, ...]] = {
    "everyday commands": (
        Row("new", "programs", "make a project that builds, runs and has a passing test"),
        Row("build", "programs", "compile a program to an image"),
        Row("check", "programs", "print every diagnostic of a program"),
        Row("test", "unit_tests", "run the unit tests of a program in this process, on a virtual clock"),
        Row("run", "simulation", "run a program in this process, on a virtual clock"),
        Row("flash", "flash", "send an image to a device and start it"),
        Row("scan", "scan", "list the devices that answer; without a link, on serial ports, CAN and networks"),
        Row("status", "device", "show the state of the program"),
        Row("start", "device", "start the program"),
        Row("stop", "device", "stop the program"),
        Row("log", "device", "print the log of a device"),
        Row("read", "values", "print values of variables"),
        Row("write", "values", "set variables"),
        Row("force", "values", "keep variables, inputs and outputs at a value, whatever the program and devices write"),
        Row("unforce", "values", "end what 'force' did"),
        Row("watch", "values", "print values of variables periodically"),
        Row("trace", "trace", "record variables in each cycle of a task, as an oscilloscope does"),
        Row("debug", "debug", "set breakpoints, step, look at variables in the terminal"),
        Row("ui", "ui", "show a page in a browser: live values, write, force, tasks, log, inputs and outputs"),
    ),
    "programs and images": (
        Row("fmt", "fmt", "format Structured Text: one style, the program stays the same"),
        Row("doc", "doc", "write pages of a library or program from its comments, with diagrams"),
        Row("render", "render", "draw a unit in LD, FBD, CFC or SFC as SVG, with values"),
        Row("symbols", "images", "list the variables of an image with their types"),
        Row("info", "images", "describe an image, a .bin or .hex of 'plctool image', or what a device has"),
        Row("image", "images", "write what a production programmer burns: a flash with its program"),
        Row("export", "exports", "write a program as PLCopen XML, for CODESYS, TwinCAT, OpenPLC Editor and Beremiz"),
        Row("export-itf", "exports", "write a C header, and a C file to fill in, for functions implemented in C"),
        Row("cache", "cache", "show or empty the folder of compiled code, which makes builds quicker"),
        Row("bench", "simulation", "measure the time of a cycle on this machine"),
    ),
    "devices": (
        Row("reset", "device", "reset the program; it is stopped afterwards"),
        Row("boot", "device", "make the program what starts at power-up, after 'flash --no-boot'"),
        Row("cycle", "device", "run one cycle of each task of a stopped program"),
        Row("tasks", "device", "show the times of the tasks"),
        Row("latency", "latency", "show how late the cycles of each task began"),
        Row("forced", "values", "print what is forced"),
        Row("alarms", "alarms", "list the alarms of a program, show their history, acknowledge them"),
        Row("recipe", "recipe", "save values to a file, check it against a program, load and compare it"),
        Row("dump", "dump", "write what the controller has in memory to a file, as after an exception"),
        Row("inspect", "dump", "print exception, calls and variables of a dump"),
        Row("files", "files", "list, get, put and delete the files of a device"),
        Row("settings", "settings", "show, check and put the settings of a device"),
        Row("source", "source", "keep the sources of the program on the device, and get them back"),
        Row("passwd", "device", "set, change or remove the password of a device"),
        Row("shell", "device", "send a command to the PLC shell of a device; ? lists them"),
        Row("gateway", "gateway", "show or end the processes that share a serial line among tools"),
        Row(
            "port-check",
            "port_check",
            "check a port: run programs on a board and compare the results with what is expected",
        ),
    ),
    "inputs, outputs and buses": (
        Row("io", "io", "show and check what is connected to the inputs and outputs"),
        Row("canopen", "canopen", "find, set up and watch CANopen devices; check EDS files"),
    ),
    "editors": (
        Row("lsp", "lsp", "serve an editor: diagnostics, completion, hover and more (Language Server Protocol)"),
        Row("dap", "debug", "be the debug adapter of an editor, at the standard input and output"),
    ),
    "plctool itself": (
        Row("demo", "about", "run a demonstration of all of it on this machine"),
        Row("completion", "about", "print the script that makes a shell complete this command"),
        Row("man", "about", "print the manual page, for 'man -l -'"),
    ),
}

ROWS = {row.name: row for rows in GROUPS.values() for row in rows}
