"""A real viser server behind the rules, asked by real requests; and what we reach for in viser is still there."""

from __future__ import annotations

import http.client
import inspect
from collections.abc import Iterator
from importlib.metadata import version

import pytest

from otwarp.errors import InputError
from otwarp.teleop.page.access import Access, access_for, listen
from otwarp.teleop.page.viser_internals import (
    MADE_FOR,
    PORT_OVERRIDE,
    SHARING,
    guarded_server,
    refuses,
    without_override,
)

viser = pytest.importorskip("viser")
TOKEN = "abcdefghijklmnop-1234"


@pytest.fixture(scope="module")
def locked() -> Iterator[tuple[object, Access]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv(PORT_OVERRIDE, raising=False)
        listening = listen("127.0.0.1", 0)
        access = access_for(listening, TOKEN)
        server = guarded_server(listening, access, "test")
        yield server, access
        server.stop()


def ask(port: int, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60.0)
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
    monkeypatch.setattr("otwarp.teleop.page.viser_internals.ANSWER_WITHIN", 0.3)
    with listen("127.0.0.1", 0) as listening, pytest.raises(InputError, match="access cannot be guarded with viser"):
        guarded_server(listening, access_for(listening, None), "test")


def test_it_is_the_viser_that_this_was_made_for():
    """Another one: read what is new in its server, then `viser_internals.py`, then change `MADE_FOR`."""
    assert version("viser").rpartition(".")[0] == MADE_FOR


def test_viser_listens_by_the_function_that_is_replaced(monkeypatch: pytest.MonkeyPatch):
    """Called once as `serve(handler, host, port, process_request=…)`, and looked up at the call."""
    import websockets.asyncio.server as library

    monkeypatch.delenv(PORT_OVERRIDE, raising=False)
    calls, real = [], library.serve

    def noted(*args: object, **options: object) -> object:
        calls.append((args, options))
        return real(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(library, "serve", noted)
    server = viser.ViserServer(host="127.0.0.1", port=0, label="test", verbose=False)
    server.stop()
    ((args, options),) = calls
    assert args[1:] == ("127.0.0.1", 0) and callable(args[0])
    assert list(inspect.signature(options["process_request"]).parameters) == ["connection", "request"]
    assert "sock" not in options


def test_viser_has_the_handlers_that_are_taken_away():
    from viser import _messages

    server = viser.ViserServer(host="127.0.0.1", port=0, label="test", verbose=False)
    try:
        handlers = server._websock_server._incoming_handlers
        sharing = {name for name in vars(_messages) if name.startswith("Share") and name != "ShareUrlUpdated"}
        assert sharing == set(SHARING)  # updates go to the windows, the others come from them
        assert all(getattr(_messages, message) in handlers for message in SHARING)
    finally:
        server.stop()


def test_viser_asks_for_its_port_by_the_variable_that_is_removed():
    assert f'"{PORT_OVERRIDE}"' in inspect.getsource(viser.ViserServer.__init__)
    assert without_override({PORT_OVERRIDE: "1", "HOME": "/"}) == {"HOME": "/"}
