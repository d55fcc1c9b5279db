"""Where tools and gateways meet: a folder of the user's alone, and names that depend on the real line only."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from plctool.gateway import place
from plctool.gateway.place import Holder, NoGateway, find_holder, find_place, locked, running, runtime_folder


def test_the_folder_is_for_this_user_alone(runtime: Path) -> None:
    folder = runtime_folder()
    assert folder == runtime / "plctool"
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("spoil", ["mode", "link", "file"])
def test_a_folder_that_others_could_have_made_is_not_used(
    runtime: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, spoil: str
) -> None:
    monkeypatch.setattr(place, "_bases", lambda: iter([(runtime, "plctool")]))
    folder = runtime / "plctool"
    if spoil == "mode":
        folder.mkdir()
        folder.chmod(0o770)
    elif spoil == "link":
        tmp_path.chmod(0o700)
        folder.symlink_to(tmp_path)
    else:
        folder.write_text("")
    with pytest.raises(NoGateway, match="is not a folder of this user alone"):
        runtime_folder()
    assert running() == []


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_not_used(runtime: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(place, "_bases", lambda: iter([(runtime, "plctool")]))
    (runtime / "plctool").mkdir(mode=0o700)
    os.chown(runtime / "plctool", 12345, 12345)
    with pytest.raises(NoGateway):
        runtime_folder()


def test_a_runtime_folder_whose_name_is_too_long_for_a_socket_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deep = tmp_path / ("x" * 80)
    deep.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(deep))
    assert not str(runtime_folder()).startswith(str(deep))


@pytest.mark.parametrize("line", ["/dev/ttyS0", "/dev/serial/by-id/usb-" + "long" * 40, "/dev/ünïcode \udcff"])
def test_every_line_has_a_socket_that_can_be_bound(runtime: Path, line: str) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(find_place(line).socket))


def test_a_link_leads_to_the_place_of_its_line(tmp_path: Path) -> None:
    (tmp_path / "line").touch()
    (tmp_path / "link").symlink_to("line")
    assert find_place(str(tmp_path / "link")) == find_place(str(tmp_path / "line"))
    assert find_place(str(tmp_path / "link")).socket != find_place(str(tmp_path / "other" / "line")).socket


@pytest.mark.parametrize("port", ["socket://localhost:11740", "rfc2217://localhost:1", "loop://"])
def test_urls_have_no_gateway(port: str) -> None:
    with pytest.raises(NoGateway):
        find_place(port)


def test_a_system_without_local_sockets_has_no_gateway(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(socket, "AF_UNIX")
    with pytest.raises(NoGateway):
        find_place("/dev/ttyS0")
    assert running() == []


def test_who_holds_a_lock_is_known_as_long_as_it_is_held(runtime: Path) -> None:
    lock = find_place("/dev/ttyS0").lock
    assert find_holder(lock) is None
    with locked(lock, 0) as descriptor:
        os.write(descriptor, b"4711 /dev/tty S0")
        assert find_holder(lock) == Holder(4711, "/dev/tty S0")
        assert running() == [Holder(4711, "/dev/tty S0")]
        with pytest.raises(TimeoutError), locked(lock, 0.01):
            pass
    assert find_holder(lock) is None and running() == []
