from __future__ import annotations

import socket

import pytest

from otwarp.errors import InputError
from otwarp.teleop.page.access import Access, access_for, address, choose_token, listen

TOKEN = "abcdefghijklmnop-1234"
LOCAL = Access(loopback=True, token=None, port=8080)
LOCKED = Access(loopback=False, token=TOKEN, port=8080)


def fields(host: str = "127.0.0.1:8080", **more: str) -> list[tuple[str, str]]:
    return [("Host", host), *((name.capitalize(), value) for name, value in more.items())]


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8080", "localhost:8080", "LocalHost", "localhost.:1", "[::1]:8080", "127.8.9.1", "[::1]"]
)
def test_loopback_names_pass(host: str):
    assert LOCAL.judge("/", fields(host)).passes


@pytest.mark.parametrize(
    "host",
    ["evil.example:8080", "127.0.0.1.evil.example", "localhost.evil.example", "10.0.0.1", "", "127.0.0.1@evil.example",
     "[::1]evil.example", "localhost:80x", "[::2]:8080", "127.0.0.1:8080:1", "evil.example#localhost"],
)  # fmt: skip
def test_a_name_that_was_rebound_to_this_machine_is_refused(host: str):
    assert LOCAL.judge("/", fields(host)).status == 403


@pytest.mark.parametrize("hosts", [[], ["localhost", "localhost"], ["localhost", "evil.example"]])
def test_there_is_one_host(hosts: list[str]):
    assert LOCAL.judge("/", [("Host", host) for host in hosts]).status == 400


@pytest.mark.parametrize(
    ("origin", "passes"),
    [
        ("http://127.0.0.1:8080", True),
        ("https://127.0.0.1:8080", True),
        ("http://evil.example", False),
        ("http://127.0.0.1:9999", False),
        ("http://127.0.0.1", False),
        ("http://localhost:8080", False),
        ("null", False),
        ("", False),
        ("file://", False),
        ("http://127.0.0.1:8080.evil.example", False),
        ("http://evil.example://127.0.0.1:8080", False),
    ],
)
def test_only_the_page_itself_may_be_an_origin(origin: str, passes: bool):
    assert LOCAL.judge("/", fields(origin=origin)).passes is passes


@pytest.mark.parametrize(
    ("target", "passes"),
    [
        ("/?websocket=ws://evil.example", False),
        ("/?%77ebsocket=ws://evil.example", False),
        ("/?showStats&websocket=ws://evil.example", False),
        ("/?websocket", False),
        ("/?playbackPath=https://evil.example/x.viser", False),
        ("//x/?websocket=ws://evil.example", False),
        ("/??websocket=1", False),
        ("/?fixedDpr=0.5&showStats", True),
        ("/?initialCameraPosition=1,2,3", True),
        ("/hdri/studio.jpg", True),
        ("/?", True),
    ],
)
def test_a_link_cannot_make_the_page_obey_another_server(target: str, passes: bool):
    assert LOCAL.judge(target, fields()).passes is passes


def test_two_origins_are_none():
    both = [*fields(origin="http://127.0.0.1:8080"), ("Origin", "http://127.0.0.1:8080")]
    assert LOCAL.judge("/", both).status == 403


def test_a_tunnel_to_another_port_is_this_machine_too():
    assert LOCAL.judge("/", fields("localhost:9000", origin="http://localhost:9000")).passes


def test_the_token_opens_and_leaves_a_cookie():
    verdict = LOCKED.judge(f"/?token={TOKEN}", fields("lab.example:8080"))
    assert verdict.passes and verdict.cookie is not None
    name, _, rest = verdict.cookie.partition("=")
    assert "HttpOnly" in rest and "SameSite=Strict" in rest
    again = fields("lab.example:8080", cookie=f"other=1; {name}={rest.split(';')[0]}")
    assert LOCKED.judge("/assets/x.js", again) == LOCKED.judge("/", again)
    assert LOCKED.judge("/", again).passes and LOCKED.judge("/", again).cookie is None


@pytest.mark.parametrize(
    "target",
    ["/", "/?token=", f"/?token={TOKEN}x", f"/?token={TOKEN[:-1]}", f"/?token={TOKEN.upper()}", "/?token=%FF%FE",
     f"/?token={TOKEN}&token={TOKEN}", f"/{TOKEN}", f"/#token={TOKEN}", "/?token=é"],
)  # fmt: skip
def test_without_the_token_nothing_opens(target: str):
    assert LOCKED.judge(target, fields("lab.example:8080")).status == 403


def test_the_cookie_of_another_page_does_not_open_this_one():
    theirs = Access(loopback=False, token=TOKEN, port=8081).cookie_name
    assert not LOCKED.judge("/", fields("lab.example", cookie=f"{theirs}={TOKEN}")).passes


def test_a_right_token_from_a_foreign_page_is_refused():
    headers = fields("lab.example:8080", origin="http://evil.example", cookie=f"{LOCKED.cookie_name}={TOKEN}")
    assert LOCKED.judge(f"/?token={TOKEN}", headers).status == 403


def test_a_page_that_others_reach_has_a_token():
    made = choose_token(None, loopback=False)
    assert made is not None and len(made) >= 24 and made != choose_token(None, loopback=False)
    assert choose_token(None, loopback=True) is None
    assert choose_token(TOKEN, loopback=True) == TOKEN
    assert address("::1", 8080, made) == f"http://[::1]:8080/?token={made}"


@pytest.mark.parametrize("token", ["", "short", "a" * 15, "with a blank in the middle", "semicolon;semicolon;"])
def test_a_token_that_can_be_guessed_or_does_not_fit_is_refused(token: str):
    with pytest.raises(InputError, match="must be 16 or more") as error:
        choose_token(token, loopback=False)
    assert not token or token not in str(error.value)


def test_a_port_that_was_asked_for_is_that_port_or_an_error():
    with listen("127.0.0.1", 0) as first:
        port = first.getsockname()[1]
        with pytest.raises(InputError, match=f"port = {port}: .*must be a free one"):
            listen("127.0.0.1", port)


def test_without_a_port_the_next_free_one_serves(monkeypatch: pytest.MonkeyPatch):
    with listen("127.0.0.1", 0) as first:
        monkeypatch.setattr("otwarp.teleop.page.access.USUAL_PORT", first.getsockname()[1])
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
