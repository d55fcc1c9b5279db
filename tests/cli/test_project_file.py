"""plc.toml: commands without sources take it, the command line holds before it, its mistakes have their lines."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "compiler"))

from library_support import library

from plctool import Simulator
from plctool.cli.command_line import parser
from plctool.cli.commands.source import prepared_source
from plctool.cli.projects import settings_of, settings_of_sources
from plctool.image.file import image_crc

LONG = "x" * 256  # bytes; a name has 255
PATHS = ("sources", "libraries", "output", "device", "io")
MAIN = "PROGRAM Main\nVAR n : INT; a : ARRAY[0..1] OF INT; i : INT := 5; END_VAR\nn := n + 1;\nEND_PROGRAM\n"


@pytest.fixture
def project(scratch: Path) -> Path:
    """A folder with a program in `src`, whose plc.toml the test writes."""
    (scratch / "src").mkdir()
    (scratch / "src/main.st").write_text(MAIN)
    return scratch


def write(folder: Path, text: str) -> None:
    (folder / "plc.toml").write_text(text)


@pytest.mark.parametrize("template", ["minimal", "io", "library"])
def test_new_project_is_checked_tested_run_and_built_without_arguments(
    tool: Any, scratch: Path, monkeypatch: pytest.MonkeyPatch, template: str
) -> None:
    assert tool("new", "pump", "--template", template).status == 0
    monkeypatch.chdir(scratch / "pump")
    done = tool("check", "--json")
    assert (done.status, done.json["diagnostics"]) == (0, [])
    assert "1 passed, 0 failed" in tool("test").out
    done = tool("run", "--time", "T#1s", "--json")
    assert (done.status, done.json["cycles"], done.err) == (0, 100, "")
    assert tool("build").status == 0
    done = tool("info", "app.cdl", "--json")
    assert done.json["info"]["project"] == "pump"
    assert done.json["info"]["version"] == "0.1.0"


def test_project_is_found_from_a_folder_below_it(tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(project, 'sources = ["src"]')
    monkeypatch.chdir(project / "src")
    assert tool("build").status == 0
    assert (project / "app.cdl").exists()


def test_project_may_be_named(tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    write(project, 'sources = ["src"]\noutput = "out/x.cdl"')
    other = tmp_path / "elsewhere"
    other.mkdir()
    monkeypatch.chdir(other)
    assert tool("build", "..").status == 0
    assert tool("build", "../plc.toml").status == 0
    assert (project / "out/x.cdl").exists()
    assert "Main.n = 3" in tool("run", "..", "--cycles", "3", "--get", "Main.n").out
    with Simulator.from_sources(project) as plc:
        assert plc.read("Main.i") == 5


def test_without_sources_and_without_project_the_message_says_what_to_do(tool: Any) -> None:
    for command in ("build", "check", "test", "run"):
        done = tool(command)
        assert done.status == 2 and "plctool new NAME" in done.err


def test_named_sources_leave_the_project_out(tool: Any, project: Path) -> None:
    write(project, "nonsense = 1")
    assert tool("check", "src").status == 0
    assert tool("check", "src/main.st").status == 0
    assert tool("check", "src", "plc.toml").status == 2


def test_sources_are_files_folders_and_patterns(tool: Any, project: Path) -> None:
    (project / "src/deep").mkdir()
    for name in ("a.st", "deep/b.st", "deep/c.txt"):
        (project / "src" / name).write_text(
            f"FUNCTION f_{Path(name).stem} : INT\nf_{Path(name).stem} := 1;\nEND_FUNCTION"
        )
    (project / "src/main.st").write_text(MAIN.replace("n + 1", "f_a() + f_b()"))
    (project / "spare.st").write_text("not a source")
    for sources in (
        '["src"]',
        '"src"',
        '["src/**/*.st"]',
        '["src/main.st", "src/a.st", "src/deep"]',
        '["src/*", "src/deep/*"]',
    ):
        write(project, f"sources = {sources}")
        assert tool("check").status == 0, sources
    write(project, 'sources = ["src/*.st"]')
    assert "unknown function f_b" in tool("check").out


def test_a_name_that_no_file_can_have_is_refused(tool: Any, project: Path) -> None:
    for words in (["check", LONG], ["build", LONG], ["run", LONG], ["check", "src", "--library", LONG]):
        done = tool(*words)
        assert done.status == 2 and f"{LONG[:80]}... cannot be the path of a file" in done.err


def test_options_of_the_project_hold_where_the_command_line_says_nothing(tool: Any, project: Path) -> None:
    (project / "src/main.st").write_text(MAIN.replace("n + 1", "a[i]"))
    write(project, 'sources = "src"\ntarget = "cortex-m3"\n[options]\nchecks = ["div"]\nno-warn = ["unused"]')
    assert tool("build", "--json").json["target"] == "cortex-m3"
    assert tool("build", "--target", "cortex-m4f", "--json").json["target"] == "cortex-m4f"
    with_file = tool("build", "--json").json["size"]
    assert tool("build", "--checks", "all", "--json").json["size"] > with_file
    write(project, 'sources = "src"\n[options]\noptimisation = 0')
    unoptimised = tool("build", "--json").json["size"]
    assert tool("build", "-O2", "--json").json["size"] < unoptimised


def test_warnings_of_the_project_are_errors_or_not_wanted(tool: Any, project: Path) -> None:
    (project / "src/main.st").write_text("PROGRAM Main\nVAR a, b : INT; END_VAR\na := 1;\nEND_PROGRAM\n")
    write(project, 'sources = "src"')
    assert "b is never used" in tool("check").out
    write(project, 'sources = "src"\n[options]\nwerror = true')
    assert tool("check").status == 2
    assert tool("check", "--no-werror").status == 0
    write(project, 'sources = "src"\n[options]\nwerror = true\nno-warn = ["unused"]')
    assert tool("check").status == 0


def test_information_is_in_the_image(tool: Any, project: Path) -> None:
    information = '[information]\nname = "Pump"\nversion = "2.1"\nauthor = "A. N. Other"\ndescription = "x"'
    write(project, f'sources = "src"\n{information}')
    tool("build")
    info = tool("info", "app.cdl", "--json").json["info"]
    del info["profile"], info["date"]
    assert info == {"project": "Pump", "version": "2.1", "author": "A. N. Other", "description": "x"}


def test_inputs_and_outputs_are_those_that_the_project_names(tool: Any, project: Path) -> None:
    (project / "io").mkdir()
    (project / "io/field.io.toml").write_text('[[sim]]\nname = "Field"\n[sim.in]\nn = "Main.i"\n')
    write(project, 'sources = "src"\nio = "io/field.io.toml"')
    assert "1 channel of" in tool("build").out
    (project / "plc.toml").write_text('sources = "src"')
    assert "channels" not in tool("build").out
    (project / "main.io.toml").write_text('[[sim]]\nname = "Field"\n[sim.in]\nn = "Main.i"\n')
    assert "1 channel of" in tool("build").out  # beside plc.toml


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('libraries = ["src", "nowhere"]', "1:14: error: src is not a library: it has no library.toml"),
        ('libraries = ["Tc2_Standrad"]', "1:14: error: there is no library Tc2_Standrad; a library is a folder"),
        ('souces = ["src"]', "1:1: error: there is no 'souces' here; did you mean sources?"),
        ("zzz = 1", "1:1: error: there is no 'zzz' here; plc.toml has"),
        ('sources = ["src"]\n[options]\ncheks = "all"', "3:1: error: there is no 'cheks' here; did you mean checks?"),
        ('[information]\nnames = "a"', "2:1: error: there is no 'names' here; did you mean name?"),
        ('sources = ["src", "scr"]', "1:19: error: there is no file or folder scr"),
        ('sources = ["*.exp"]', "1:12: error: no source fits *.exp"),
        ('sources = ["/*.st"]', "1:12: error: /*.st is outside the folder of plc.toml; "),
        ('sources = ["src/**.st"]', "1:12: error: ** is for folders, and stands alone between two /"),
        ('sources = ["***"]', "1:12: error: ** is for folders, and stands alone between two /"),
        *((f'{key} = "{LONG}"', f"1:{len(key) + 4}: error: {LONG} cannot be used: File name too") for key in PATHS),
        (f'sources = "{LONG}*"', f"1:11: error: {LONG}* cannot be used: File name too long"),
        ('sources = ["\\u0000"]', "1:12: error: a path is not empty, and has no control characters"),
        ('sources = "src"\noutput = "a\\u0000"', "2:10: error: a path is not empty, and has no control characters"),
        ('libraries = "\\n"', "1:13: error: a path is not empty, and has no control characters"),
        ('io = ""', "1:6: error: a path is not empty, and has no control characters"),
        ('output = "src"', '1:10: error: src is a folder; write for example output = "app.cdl"'),
        ("sources = []", "1:11: error: there are no sources here"),
        ("sources = [1]", "1:12: error: this is a number; it has to be a text in quotes"),
        ("sources = 1", "1:11: error: sources is a number; it has to be a list"),
        ('target = "cortex-m33x"', "1:10: error: target cannot be 'cortex-m33x'"),
        ('device = "board.toml"', "1:10: error: there is no file board.toml"),
        ('io = "src"', "1:6: error: there is no file src"),
        ("link = 5", "1:8: error: link is a number"),
        ("[options]\noptimisation = 4", "2:16: error: optimisation can be 0, 1, 2 or 3"),
        ("[options]\noptimisation = true", "2:16: error: optimisation can be 0, 1, 2 or 3"),
        ('[options]\nchecks = ["bond"]', "2:10: error: 'bond' is not a choice of checks"),
        ("[options]\nchecks = 7", '2:10: error: checks can be "all", "none" or a list'),
        ('[options]\nno-warn = ["unusd"]', "2:12: error: there is no warning 'unusd'; did you mean unused?"),
        ('[options]\nwerror = "yes"', "2:10: error: werror is a text in quotes; it has to be true or false"),
        ('[information]\nname = "a\\nb"', "2:8: error: name has a line break or another character that cannot be seen"),
        ('[information]\nauthor = "J\u00fcrgen"', "2:10: error: author goes into the image, which takes ASCII only"),
        (f'[information]\nauthor = "{"x" * 256}"', "2:10: error: author has 256 characters; it can have 255"),
        ("options = 1", "1:11: error: options is a number; it has to be a table"),
        ("sources = ", "1:10: error: this is not TOML: invalid value"),
    ],
)  # fmt: skip
def test_mistakes_have_their_line_and_a_hint(tool: Any, project: Path, text: str, found: str) -> None:
    write(project, text)
    for command in ("check", "build", "test", "run"):
        done = tool(command)
        assert done.status == 2
        assert done.err.startswith(f"plc.toml:{found}"), done.err
    assert text.splitlines()[int(found[0]) - 1][:80] in done.err.splitlines()[1]  # the line is quoted
    assert tool("check", "--json").json["diagnostics"][0]["line"] == int(found[0])


def test_all_mistakes_are_said_at_once(tool: Any, project: Path) -> None:
    write(project, 'a = 1\nsources = ["nowhere"]\n[options]\ndebug = 1')
    assert tool("check").err.count("error:") == 3


def test_file_that_is_no_text_is_refused(tool: Any, project: Path) -> None:
    (project / "plc.toml").write_bytes(b"\xff\xfe")
    done = tool("check")
    assert done.status == 2 and "not UTF-8 at byte 0" in done.err


def test_image_of_a_project_does_not_replace_a_source(tool: Any, project: Path) -> None:
    write(project, 'sources = "src"\noutput = "src/main.st"')
    done = tool("build")
    assert done.status == 2
    assert 'the name of the image ends in .cdl, not as main.st does; write output = "main.cdl"' in done.err


@pytest.mark.parametrize("link", ["/dev/ttyS0", "COM3", "192.168.1.5"])
@pytest.mark.parametrize("command", ["check", "build", "test", "status"])
def test_link_that_is_none_is_reported_with_its_line(tool: Any, project: Path, command: str, link: str) -> None:
    write(project, f'sources = ["src"]\nlink = "{link}"\n')
    done = tool(command)
    assert done.status == 2
    assert f"plc.toml:2: '{link}' is not a link; write for example serial:" in done.err


@pytest.mark.parametrize(("text", "message"), [
    ('name = "pump"', "name cannot be here: it goes into [information]"),
    ('[project]\nname = "pump"', "author, company, description and profile go into [information]"),
    ("werror = true", "werror cannot be here: it goes into [options]"),
])  # fmt: skip
def test_key_outside_its_table_is_refused_with_the_name_of_that(
    tool: Any, project: Path, text: str, message: str
) -> None:
    write(project, f"{text}\n")
    done = tool("check")
    assert done.status == 2 and message in done.err + done.out and "plc.toml:1:" in done.err + done.out


def test_command_without_a_link_names_the_project_file(tool: Any, project: Path) -> None:
    assert 'link = "serial:/dev/ttyS0" in plc.toml' in tool("status").err


def test_board_of_the_project_gives_target_and_limits(tool: Any, project: Path) -> None:
    write(project, 'sources = ["src"]\nboard = "mps2-an385/standard"')
    assert tool("build", "--json").json["target"] == "cortex-m3"
    (project / "src/main.st").write_text("PROGRAM Main VAR n : LREAL := 1.0; END_VAR n := n * 1.5; END_PROGRAM")
    assert "It needs CmpLrealCalls for LREAL" in tool("build").err
    assert tool("build", "--board", "mps2-an385/full").status == 0
    assert tool("build", "--target", "cortex-m7", "--json").json["target"] == "cortex-m7"
    assert "Main.n = 1.5" in tool("run", "--cycles", "1", "--get", "Main.n").out  # on this machine
    assert tool("check").status == 0


def test_board_that_is_not_known_is_a_mistake_with_its_line(tool: Any, project: Path) -> None:
    write(project, 'sources = ["src"]\nboard = "mps2-an385/ful"')
    done = tool("build")
    assert done.status == 2 and "plc.toml:2:9: error: " in done.err
    assert "mps2-an385/ful" in done.err and "mps2-an385/full" in done.err
    write(project, 'sources = ["src"]\nboard = "mps2-an385/full"\ntarget = "cortex-m7"')
    done = tool("build")
    assert done.status == 2 and "MPS2 AN385 (full) has a cortex-m3, not a cortex-m7" in done.err


def test_sources_of_a_project_with_a_board_make_its_image_again(tool: Any, project: Path) -> None:
    """The board is in the image of a program with inputs and outputs."""
    write(project, 'sources = ["src"]\nboard = "mps2-an385/full"')
    (project / "plc.io.toml").write_text("[gpio.in]\nDI0 = '%IX0.0'\n")
    assert tool("build").status == 0
    image = project / "app.cdl"
    archive, _ = prepared_source(settings_of_sources([project]), image_crc(image.read_bytes()), image)
    assert archive.build[archive.build.index("--board") + 1] == "mps2-an385/full"


@pytest.mark.parametrize("words", [["--board", "mps2-an385/full"], ["--target", "cortex-m7"]])
def test_source_put_takes_another_board_than_the_project_as_build_does(
    tool: Any, project: Path, words: list[str]
) -> None:
    write(project, 'sources = ["src"]\nboard = "mps2-an500/full"')
    (project / "plc.io.toml").write_text("[gpio.in]\nDI0 = '%IX0.0'\n")
    assert tool("build", *words).status == 0
    settings = settings_of(parser().parse_args(["source", "put", *words]))
    archive, _ = prepared_source(settings, image_crc((project / "app.cdl").read_bytes()))
    assert set(words) <= set(archive.build)


ARCHIVED = """\
sources = ["src"]
io = "main.io.toml"
device = "small.toml"
[options]
debug = true
werror = true
"""


@pytest.mark.parametrize(
    "words", [[], ["--io", "io/alt.io.toml"], ["--device", "large.toml"], ["--no-debug"], ["--library", "libs"]]
)
def test_sources_of_a_project_and_options_make_its_image_again(tool: Any, project: Path, words: list[str]) -> None:
    write(project, ARCHIVED)
    library(project / "libs", "Lib", {"get.st": "FUNCTION Get : INT\nGet := 7;\nEND_FUNCTION\n"})
    (project / "src/main.st").write_text(MAIN.replace("+ 1", "+ Lib.Get()") if "libs" in words else MAIN)
    (project / "io").mkdir()
    for path, address in (("main.io.toml", "%IX0.0"), ("io/alt.io.toml", "%IX9.0")):
        (project / path).write_text(f"[sim.in]\nx = '{address}'\n")
    for name in ("small", "large"):
        (project / f"{name}.toml").write_text(f'name = "{name}"\ntarget = "cortex-m3"\n')
    assert tool("build", "--no-werror", *words).status == 0
    image = project / "app.cdl"
    archive, _ = prepared_source(settings_of(parser().parse_args(["build", *words])), image_crc(image.read_bytes()))
    assert set(words) <= {word.removeprefix(f"{project.name}/") for word in archive.build}


@pytest.mark.parametrize("sources", ["src", "../src"])
def test_library_that_needs_no_files_does_not_keep_sources_from_being_stored(
    tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch, sources: str
) -> None:
    (project / "below").mkdir()
    monkeypatch.chdir(project / "below" if sources.startswith("..") else project)
    words = ["build", sources, "--library", "Util", "-o", "app.cdl"]
    assert tool(*words).status == 0
    archive, _ = prepared_source(settings_of(parser().parse_args(words)), image_crc(Path("app.cdl").read_bytes()))
    assert list(archive.files) == ["src/main.st"]


def test_device_of_the_command_line_holds_before_the_board_of_the_project(tool: Any, project: Path) -> None:
    write(project, 'sources = ["src"]\nboard = "mps2-an385/full"')
    (project / "io16.toml").write_text('name = "IO-16"\ntarget = "cortex-m7"\n')
    (project / "plc.io.toml").write_text("")
    assert tool("build", "--device", "io16.toml", "--json").json["target"] == "cortex-m7"
    assert tool("build", "--json").json["target"] == "cortex-m3"


def test_limits_of_board_and_device_both_hold(tool: Any, project: Path) -> None:
    write(project, 'sources = ["src"]\nboard = "mps2-an385/full"\ndevice = "io16.toml"')
    (project / "io16.toml").write_text('name = "IO-16"\ntarget = "cortex-m3"\n[limits]\ncode = 10\n')
    (project / "plc.io.toml").write_text("")
    assert "bytes of code, the device has 10" in tool("build").err


def test_board_and_device_of_different_processors_are_refused(tool: Any, project: Path) -> None:
    write(project, 'sources = ["src"]\nboard = "mps2-an385/full"\ndevice = "io16.toml"')
    (project / "io16.toml").write_text('name = "IO-16"\ntarget = "cortex-m4f"\n')
    (project / "plc.io.toml").write_text("")
    assert "io16.toml describes a board with a cortex-m4f, MPS2 AN385 (full) has a cortex-m3" in tool("build").err
    assert tool("run", "--cycles", "1", "--get", "Main.n").status == 0  # on this machine
    write(project, 'sources = ["src"]\nboard = "plcrt"\ndevice = "io16.toml"')
    assert tool("build").status == 0
