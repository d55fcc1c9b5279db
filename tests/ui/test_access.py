"""Who gets the page: this user's browser, by the address that was printed."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest
from conftest import Browser, Page
from websockets.exceptions import ConnectionClosed, InvalidStatus

from plctool.testing.waiting import PATIENCE, eventually
from plctool.ui.server import STATIC


def test_the_printed_address_is_on_loopback_and_shows_the_page(page: Page) -> None:
    assert page.url.startswith("http://127.0.0.1:")
    reply = page.get(page.path)
    assert reply.status == 200
    assert b"<title>plctool</title>" in reply.read()


@pytest.mark.parametrize(
    "path", ["/", "/index.html", "/wrong/", "{token}x/", "{short}/", "{token}", "//{token}/", "/é/"]
)
def test_a_wrong_or_missing_token_gets_nothing(page: Page, path: str) -> None:
    token = page.path.strip("/")
    address = path.format(token=f"/{token}", short=f"/{token[:-1]}").replace("é", "%C3%A9")
    reply = page.get(address)
    assert reply.status == 403
    assert reply.read() == b"Open the address that 'plctool ui' printed, whole and on this machine.\n"


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "evil.example:{port}", "127.0.0.1:{port}.x"]
)
def test_another_host_name_is_refused(page: Page, host: str) -> None:
    assert page.get(page.path, Host=host.format(port=page.port)).status == 403


def test_localhost_is_a_name_of_this_machine(page: Page) -> None:
    assert page.get(page.path, Host=f"localhost:{page.port}").status == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:{port}", "http://127.0.0.1:1"])
def test_requests_of_other_pages_are_refused(page: Page, origin: str) -> None:
    other = origin.format(port=page.port)
    assert page.get(page.path, Origin=other).status == 403
    with pytest.raises(InvalidStatus) as refused:
        page.open(origin=other)
    assert refused.value.response.status_code == 403


def test_a_websocket_needs_an_origin_and_the_token(page: Page) -> None:
    for options in ({"origin": None}, {"address": f"ws://127.0.0.1:{page.port}/live"}):
        with pytest.raises(InvalidStatus) as refused:
            page.open(**options)
        assert refused.value.response.status_code == 403


def test_replies_forbid_scripts_of_others_and_their_requests(page: Page) -> None:
    for path in (page.path, f"{page.path}main.js", f"{page.path}nothing", "/"):
        headers = page.get(path).headers
        assert headers["content-security-policy"].startswith("default-src 'none'; script-src 'self'; style-src 'self'")
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert not [name for name in headers if name.lower().startswith("access-control")]


@pytest.mark.parametrize("path", ["../server.py", "..%2fserver.py", "%2e%2e/server.py", "/etc/passwd", "%00"])
def test_only_files_of_the_page_are_served(page: Page, path: str) -> None:
    assert page.get(page.path + path).status in (404, 405)


def test_the_page_needs_no_network() -> None:
    texts = [file.read_text() for file in STATIC.iterdir()]
    assert {"index.html", "style.css", "main.js"} <= {file.name for file in STATIC.iterdir()}
    assert {found for text in texts for found in re.findall(r"\w+://[^\s\"']+", text)} <= {"http://www.w3.org/2000/svg"}


def test_the_page_sets_text_and_no_markup() -> None:
    scripts = "".join(file.read_text() for file in STATIC.glob("*.js"))
    assert not re.findall(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(|new Function", scripts)
    pages = "".join(file.read_text() for file in STATIC.glob("*.html"))
    assert not re.findall(r"<script(?![^>]*src)|\son\w+=|style=", pages)


def test_one_page_too_many_is_told_so(page: Page) -> None:
    with ExitStack() as pages:
        for _ in range(16):
            pages.enter_context(page.open())
        last = pages.enter_context(page.open())
        with pytest.raises(ConnectionClosed) as closed:
            last.recv(timeout=PATIENCE)
    assert closed.value.rcvd is not None
    assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1013, "16 pages are open already; close one.")


def test_a_thousand_connections_leave_room_for_the_page(page: Page) -> None:
    held = []
    for _ in range(1000):
        held.append(socket.create_connection(("127.0.0.1", page.port), timeout=PATIENCE))
        if len(held) == 400:  # few enough for the files this process may have open
            held.pop(0).close()

    def is_served() -> bool:  # when those that say nothing have been closed
        try:
            return page.get(page.path).status == 200
        except OSError:
            return False

    eventually(is_served)
    with Browser(page).socket as again:
        assert again.recv(timeout=PATIENCE)
    for one in held:
        one.close()


def test_a_port_in_use_is_named(page: Page, folder: Path) -> None:
    command = [sys.executable, "-m", "plctool", "ui", "--sim", "app.cdl", "--port-number", str(page.port)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        f"plctool: Port {page.port} of 127.0.0.1 cannot be used: Address already in use. Leave out --port-number for a "
        "free one.\n"
    )
