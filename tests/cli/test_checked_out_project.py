"""A project of another author reads and writes its own folder only, unless the command line names more."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from plctool import Simulator, UsageError
from plctool.files import read_regular

MAIN = "PROGRAM Main\nVAR n : INT; END_VAR\nn := n + 1;\nEND_PROGRAM\n"
LIBRARY = 'name = "Lib"\nversion = "1.0.0"\n'
GET = "FUNCTION Get : INT\nGet := 7;\nEND_FUNCTION\n"
BOARD = 'name = "IO"\ntarget = "cortex-m3"\n'


@pytest.fixture
def outside(scratch: Path) -> Path:
    """Files of the user, beside the project."""
    folder = scratch / "outside"
    (folder / "lib").mkdir(parents=True)
    for name, text in {
        "other.st": "FUNCTION Other : INT\nOther := 7;\nEND_FUNCTION\n",
        "x.io.toml": "",
        "board.toml": BOARD,
        "precious": "precious",
        "precious.cdl": "precious",
        "lib/library.toml": LIBRARY,
        "lib/get.st": GET,
    }.items():
        (folder / name).write_text(text)
    return folder


@pytest.fixture
def project(scratch: Path, outside: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The checked-out project, in which commands run; its plc.toml names `src`."""
    folder = scratch / "project"
    (folder / "src").mkdir(parents=True)
    (folder / "src/main.st").write_text(MAIN)
    write(folder, "")
    monkeypatch.chdir(folder)
    return folder


def write(folder: Path, text: str) -> None:
    sources = "" if "sources" in text else 'sources = ["src"]\n'
    (folder / "plc.toml").write_text(sources + text)


KEYS = {
    "sources": ("other.st", "'name the sources'"),
    "libraries": ("lib", "--library"),
    "io": ("x.io.toml", "--io"),
    "device": ("board.toml", "--device"),
    "output": ("precious.cdl", "-o"),
}


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("way", ["..", "absolute", "link", "linked folder"])
def test_a_path_key_does_not_leave_the_project(tool: Any, project: Path, outside: Path, key: str, way: str) -> None:
    name, option = KEYS[key]
    (project / "link").symlink_to(outside if way == "linked folder" else outside / name)
    path = {
        "..": f"../outside/{name}",
        "absolute": str(outside / name),
        "link": "link",
        "linked folder": f"link/{name}",
    }[way]
    write(project, f'{key} = "{path}"\n')
    for command in ("check", "build", "test", "run"):
        done = tool(command)
        assert done.status == 2, (command, done)
        assert f"{path} is outside the folder of plc.toml; take it out of here" in done.err, done.err
        assert option.strip("'") in done.err
    assert (outside / "precious.cdl").read_text() == "precious"
    assert not (project / "app.cdl").exists()


def test_what_the_command_line_names_may_be_elsewhere(tool: Any, project: Path, outside: Path) -> None:
    (project / "src/main.st").write_text(MAIN.replace("+ 1", "+ Lib.Get()"))
    words = ["--library", "../outside/lib", "--io", "../outside/x.io.toml", "--device", "../outside/board.toml"]
    done = tool("build", *words, "-o", "../outside/app.cdl")
    assert (done.status, done.err) == (0, "")
    assert (outside / "app.cdl").exists() and (outside / "app.sym").exists()


def test_a_link_among_the_sources_does_not_leave_the_project(tool: Any, project: Path, outside: Path) -> None:
    (project / "src/other.st").symlink_to(outside / "other.st")
    for sources in ('"src"', '"src/*.st"', '"."'):
        write(project, f"sources = {sources}")
        done = tool("check")
        assert done.status == 2 and "src/other.st" in done.err and "outside" in done.err, done
    assert "a link to" in (done := tool("check", "src")).err and done.status == 2  # also of a folder without a project
    assert tool("check", "src/main.st", "../outside/other.st").status == 0
    with pytest.raises(UsageError, match="outside"):
        Simulator.from_sources(project)


def test_a_link_within_the_project_is_read(tool: Any, project: Path) -> None:
    (project / "more.st").write_text("FUNCTION Other : INT\nOther := 7;\nEND_FUNCTION\n")
    (project / "src/other.st").symlink_to("../more.st")
    (project / "src/main.st").write_text(MAIN.replace("+ 1", "+ Other()"))
    assert tool("check").status == 0


def test_a_project_of_another_system_does_not_leave_the_folder(tool: Any, project: Path, outside: Path) -> None:
    (outside / "Other.TcPOU").write_text("<TcPlcObject/>")
    (project / "src/x.plcproj").write_text(
        '<Project><ItemGroup><Compile Include="..\\..\\outside\\Other.TcPOU"/></ItemGroup></Project>'
    )
    for words in ([], ["src"], ["src/x.plcproj"]):
        done = tool("check", *words)
        assert done.status == 2 and "Other.TcPOU is outside" in done.err, (words, done)


def test_a_library_of_the_project_needs_none_outside_it(tool: Any, project: Path, outside: Path) -> None:
    os.rename(outside / "lib", project.parent / "Lib")
    (project / "library.toml").write_text('name = "Top"\nversion = "1.0"\n[dependencies]\nLib = "*"\n')
    write(project, 'sources = ["src"]\nlibraries = ["."]\n')
    done = tool("check")
    assert done.status == 2 and "Top needs the library Lib, which is not here" in done.err
    assert tool("check", "--library", "../Lib").status == 0


def test_a_library_is_all_in_its_folder(tool: Any, project: Path, outside: Path) -> None:
    (project / "lib").mkdir()
    (project / "lib/library.toml").symlink_to(outside / "lib/library.toml")
    (project / "src/main.st").write_text(MAIN.replace("+ 1", "+ Lib.Get()"))
    write(project, 'libraries = ["lib"]')
    done = tool("check")
    assert done.status == 2 and "outside" in done.err
    (project / "lib/library.toml").unlink()
    (project / "lib/library.toml").write_text(LIBRARY)
    (project / "lib/get.st").symlink_to(outside / "lib/get.st")
    done = tool("check")
    assert done.status == 2 and "lib/get.st, a link to" in done.err and "outside" in done.err


@pytest.mark.parametrize("found", ["device", "description"])
def test_a_description_and_its_device_are_in_the_project(tool: Any, project: Path, outside: Path, found: str) -> None:
    if found == "device":
        (project / "main.io.toml").write_text('device = "../outside/board.toml"\n')
    else:
        (project / "main.io.toml").symlink_to(outside / "x.io.toml")
    done = tool("check")
    assert done.status == 2 and "outside" in (done.err + done.out)
    (project / "main.io.toml").rename(project / "src/main.io.toml")
    assert "outside" in (done := tool("check", "src/main.st")).err + done.out and done.status == 2
    if found == "device":
        assert tool("check", "src/main.st", "--device", "../outside/board.toml").status == 0


def test_a_description_of_the_project_names_a_device_elsewhere_in_it(tool: Any, project: Path) -> None:
    (project / "io").mkdir()
    (project / "board.toml").write_text(BOARD)
    (project / "io/main.io.toml").write_text('device = "../board.toml"\n')
    write(project, 'io = "io/main.io.toml"')
    assert tool("check").status == 0


def test_a_description_to_begin_with_names_no_device_elsewhere(tool: Any, project: Path, outside: Path) -> None:
    done = tool("io", "init", "src/x.io.toml", "--device", "../outside/board.toml")
    assert done.status == 2 and "x.io.toml cannot name it; copy it there first" in done.err
    (project / "board.toml").write_text(BOARD)
    assert tool("io", "init", "src/x.io.toml", "--device", "board.toml").status == 0
    assert 'device = "../board.toml"' in (project / "src/x.io.toml").read_text()


@pytest.mark.parametrize("name", ["app.cdl", "app.sym"])
@pytest.mark.parametrize("target", ["../outside/precious", "../outside/precious.cdl", ".git/config"])
def test_an_output_that_is_a_link_does_not_lead_elsewhere(
    tool: Any, project: Path, outside: Path, name: str, target: str
) -> None:
    (project / ".git").mkdir()
    (project / ".git/config").write_text("precious")
    (project / name).symlink_to(target)
    for words in (["build"], ["build", "src"]):
        done = tool(*words)
        assert done.status == 2, done
    assert (project / target).read_text() == "precious"
    assert tool("build", "-o", "new.cdl").status == 0


@pytest.mark.parametrize("name", [".git/hooks/post-commit", "Makefile", "x.cdl.sh"])
def test_an_output_of_the_project_is_an_image(tool: Any, project: Path, name: str) -> None:
    write(project, f'output = "{name}"')
    done = tool("build")
    assert done.status == 2 and "the name of the image ends in .cdl" in done.err


def test_a_default_output_is_not_written_through_a_link(tool: Any, project: Path, outside: Path) -> None:
    (project / "trace.csv").symlink_to(outside / "precious")
    done = tool("run", "--trace", "Main.n")
    assert done.status == 2 and "trace.csv is a link to" in done.err and "-o new-trace.csv" in done.err
    assert (outside / "precious").read_text() == "precious"
    (project / "cover").mkdir()
    (project / "cover/index.html").symlink_to(outside / "precious")
    done = tool("test", "--coverage", "cover")
    assert done.status == 2 and "is a link to" in done.err
    assert (outside / "precious").read_text() == "precious"


# ---- devices and pipes


@pytest.mark.parametrize("where", ["command line", "project", "folder"])
@pytest.mark.parametrize("kind", ["device", "pipe"])
def test_a_source_is_a_regular_file(tool: Any, project: Path, where: str, kind: str) -> None:
    if kind == "device":
        (project / "src/x.st").symlink_to("/dev/zero")
    else:
        os.mkfifo(project / "src/x.st")
    write(project, 'sources = ["src/x.st"]' if where == "project" else "")
    done = tool("check", *(["src/x.st"] if where == "command line" else []))
    if where == "folder":
        assert done.status == 0  # is not looked at
    elif where == "project" and kind == "device":
        assert done.status == 2 and "is outside the folder" in done.err
    else:
        assert done.status == 2 and "it is a device or a pipe; give a regular file" in done.err


@pytest.mark.parametrize("name", ["plc.toml", "src/main.io.toml", "app.cdl", "app.sym", "lib/library.toml"])
def test_no_other_file_is_a_pipe(tool: Any, project: Path, name: str) -> None:
    words = ["info", "app.cdl"] if name.startswith("app") else ["check", "plc.toml", "--io", "src/main.io.toml"]
    if name == "app.sym":
        assert tool("build").status == 0
        words = ["symbols", "app.cdl"]
    write(project, 'libraries = ["lib"]' if "lib" in name else "")
    (project / name).unlink(missing_ok=True)
    (project / name).parent.mkdir(exist_ok=True)
    os.mkfifo(project / name)
    assert tool(*words).status == 2


def test_a_file_that_is_too_large_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "large"
    file.write_bytes(b"x" * ((1 << 20) + 1))
    assert len(read_regular(file, 2 << 20)) == (1 << 20) + 1
    with pytest.raises(OSError, match="it has more than 1 MiB"):
        read_regular(file, 1 << 20)


def test_a_key_of_many_dots_is_refused(tool: Any, project: Path) -> None:
    write(project, "a" + ".a" * 20_000 + " = 1\n")
    done = tool("check")
    assert done.status == 2 and "there are more than 100 dots in a key" in done.err


def test_of_many_unknown_keys_the_first_are_reported(tool: Any, project: Path) -> None:
    write(project, "".join(f"k{n} = 1\n" for n in range(5_000)))
    done = tool("check")
    assert done.status == 2 and done.err.count("there is no 'k") == 20
    assert "5000 keys of plc.toml are unknown; the first 20 are shown" in done.err


# ---- a plc.toml of another user


needs_root = pytest.mark.skipif(os.getuid() != 0, reason="only root can give files away")


@needs_root
@pytest.mark.parametrize("given", ["plc.toml", "."])
@pytest.mark.parametrize("below", [".", "src"])
def test_a_project_of_another_user_is_not_used(
    tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch, given: str, below: str
) -> None:
    write(project, 'link = "tcp:127.0.0.1:9"')
    os.chown(project / given, 65534, -1)
    monkeypatch.chdir(project / below)
    for command in ("check", "build", "test", "run", "status"):
        done = tool(command)
        assert done.status == 2 and "belongs to another user" in done.err, done
        assert "plctool build" in done.err and "PLC_LINK" in done.err
    assert tool("check", str(project)).status == 0  # named
    assert tool("status", "--tcp", "127.0.0.1:1").status == 3


@needs_root
def test_a_link_of_another_user_to_a_project_of_this_one_is_not_used(
    tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project.parent / "shared/below").mkdir(parents=True)
    link = project.parent / "shared/plc.toml"
    link.symlink_to(project / "plc.toml")
    os.lchown(link, 65534, -1)
    monkeypatch.chdir(project.parent / "shared/below")
    assert "belongs to another user" in tool("check").err


@needs_root
def test_with_sudo_the_project_of_the_user_who_called_it_is_used(
    tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.chown(project / "plc.toml", 65534, -1)
    monkeypatch.setenv("SUDO_UID", "65534")
    assert tool("check").status == 0


def test_the_search_ends_at_home(tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (project / "home/work").mkdir(parents=True)
    monkeypatch.chdir(project / "home/work")
    assert tool("check").status == 0
    monkeypatch.setenv("HOME", str(project / "home"))
    assert "There is no project here" in tool("check").err
    (project / "home/plc.toml").write_text('sources = ["work"]\n')
    (project / "home/work/main.st").write_text(MAIN)
    assert tool("check").status == 0
