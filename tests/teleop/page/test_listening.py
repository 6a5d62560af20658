"""A real viser server behind the rules, asked by real requests."""

from __future__ import annotations

import http.client
import socket
from collections.abc import Iterator

import pytest

from otwarp.errors import InputError
from otwarp.teleop.page.access import Access
from otwarp.teleop.page.listening import access_for, guarded_server, listen, refuses

viser = pytest.importorskip("viser")
TOKEN = "abcdefghijklmnop-1234"


@pytest.fixture(scope="module")
def locked() -> Iterator[tuple[object, Access]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("_VISER_PORT_OVERRIDE", raising=False)
        listening = listen("127.0.0.1", 0)
        access = access_for(listening, TOKEN)
        server = guarded_server(listening, access, "test")
        yield server, access
        server.stop()


def ask(port: int, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10.0)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request("GET", path, headers=named)
    response = connection.getresponse()
    response.read()
    connection.close()
    return response


def shake(port: int, **headers: str) -> int:
    """Status of a websocket handshake as viser's browser side would ask for it."""
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13"}
    key = {"Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec_WebSocket_Protocol": f"viser-v{viser.__version__}"}
    return ask(port, **upgrade, **key, **headers).status


def test_pages_and_websockets_need_the_token(locked: tuple[object, Access]):
    _, access = locked
    port = access.port
    assert access.loopback
    assert ask(port).status == 403
    assert shake(port) == 403
    opened = ask(port, f"/?token={TOKEN}")
    assert opened.status == 200
    assert opened.headers["X-Frame-Options"] == "DENY" and opened.headers["Referrer-Policy"] == "no-referrer"
    cookie = opened.headers["Set-Cookie"].split(";")[0]
    assert ask(port, Cookie=cookie).status == 200
    assert shake(port, Cookie=cookie) == 101
    assert shake(port, Cookie=cookie, Origin=f"http://127.0.0.1:{port}") == 101
    assert shake(port, Cookie=cookie, Origin="http://evil.example") == 403
    assert shake(port, Cookie=cookie, Host="evil.example") == 403
    assert ask(port, "/?websocket=ws://evil.example", Cookie=cookie).status == 403


def test_viser_can_open_no_tunnel_to_the_world(locked: tuple[object, Access]):
    server, _ = locked
    handled = {message.__name__ for message in server._websock_server._incoming_handlers}  # type: ignore[attr-defined]
    assert handled and not any("Share" in name for name in handled)


def test_the_check_finds_a_server_without_rules():
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        assert not refuses(Access(True, None, server.get_port()), ("127.0.0.1", server.get_port()))
    finally:
        server.stop()


def test_a_viser_that_starts_otherwise_serves_nobody(monkeypatch: pytest.MonkeyPatch):
    """One that takes its own port, past ours: nothing answers on our socket."""
    import websockets.asyncio.server as library

    real = library.serve

    class Other(viser.ViserServer):
        def __init__(self, **options: object):
            library.serve, ours = real, library.serve
            super().__init__(**options)  # type: ignore[arg-type]
            library.serve = ours

    monkeypatch.setattr(viser, "ViserServer", Other)
    monkeypatch.setattr("otwarp.teleop.page.listening.ANSWER_WITHIN", 0.3)
    with listen("127.0.0.1", 0) as listening, pytest.raises(InputError, match="access cannot be guarded with viser"):
        guarded_server(listening, access_for(listening, None), "test")


def test_a_port_that_was_asked_for_is_that_port_or_an_error():
    with listen("127.0.0.1", 0) as first:
        port = first.getsockname()[1]
        with pytest.raises(InputError, match=f"port = {port}: .*must be a free one"):
            listen("127.0.0.1", port)


def test_without_a_port_the_next_free_one_serves(monkeypatch: pytest.MonkeyPatch):
    with listen("127.0.0.1", 0) as first:
        monkeypatch.setattr("otwarp.teleop.page.listening.USUAL_PORT", first.getsockname()[1])
        with listen("127.0.0.1", None) as second:
            assert second.getsockname()[1] != first.getsockname()[1]


@pytest.mark.parametrize("host", ["no.such.host.invalid", "", "192.0.2.1", "a" * 300])
def test_a_host_that_is_not_here_is_one_clear_line(host: str):
    with pytest.raises(InputError, match="host = ") as error:
        listen(host, 0)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("port", [-1, 65536])
def test_a_port_out_of_range_is_refused(port: int):
    with pytest.raises(InputError, match="must be from 0 to 65535"):
        listen("127.0.0.1", port)


def test_listening_everywhere_makes_a_token():
    with listen("0.0.0.0", 0) as everywhere, socket.socket() as _:
        access = access_for(everywhere, None)
    assert not access.loopback and access.token is not None
