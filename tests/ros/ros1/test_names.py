"""Names, master URIs, and the one address that a node listens on."""

from __future__ import annotations

import socket

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.ros.ros1.names import address, global_name, master_uri, node_name, own_host


@pytest.mark.parametrize(
    ("name", "full"), [("a", "/a"), ("/a/b_1", "/a/b_1"), ("GeomagicLeft/pose", "/GeomagicLeft/pose")]
)
def test_names(name, full):
    assert global_name("topic", name) == full


@pytest.mark.parametrize("name", ["", "/", "a//b", "a/", "1a", "~a", "a b", "a\n", "é", "a" * 300])
def test_bad_names(name):
    with pytest.raises(InputError, match=r"topic is .*; allowed: words of letters"):
        global_name("topic", name)


@given(st.text(max_size=40))
@settings(deadline=None)
def test_no_text_breaks_an_address(text):
    found = address(text)
    assert found is None or (found[0] and 0 < found[1] < 65536)


@pytest.mark.parametrize(
    "uri",
    ["", "localhost:11311", "https://a:1", "http://a", "http://a:0", "http://a:99999", "http://a:1/x", "http://:1"],
)
def test_bad_master_uris_name_the_variable(uri, monkeypatch):
    with pytest.raises(InputError, match=r"ROS_MASTER_URI is .*; allowed: http://host:port"):
        master_uri(uri)
    if uri:
        monkeypatch.setenv("ROS_MASTER_URI", uri)
        with pytest.raises(InputError, match="ROS_MASTER_URI"):
            master_uri(None)


def test_the_environment_says_where_the_master_is(monkeypatch):
    assert master_uri(None) == "http://localhost:11311/"
    monkeypatch.setenv("ROS_MASTER_URI", "http://other:1234")
    assert master_uri(None) == "http://other:1234"
    assert master_uri("http://given:1") == "http://given:1"


def test_host_follows_argument_environment_and_master(monkeypatch):
    local, far = "http://localhost:11311/", "http://192.0.2.7:11311/"
    assert own_host(None, local) == ("127.0.0.1", "127.0.0.1")
    monkeypatch.setenv("ROS_IP", "127.0.0.2")
    assert own_host(None, far) == ("127.0.0.2", "127.0.0.2")
    monkeypatch.setenv("ROS_HOSTNAME", "localhost")
    assert own_host(None, far) == ("localhost", "127.0.0.1")
    assert own_host("127.0.0.3", far) == ("127.0.0.3", "127.0.0.3")


def test_a_far_master_is_met_on_the_interface_that_leads_there(monkeypatch):
    class Probe:
        def __init__(self, *_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def connect(self, where):
            assert where == ("192.0.2.7", 11311)

        def getsockname(self):
            return ("192.0.2.5", 40000)

    monkeypatch.setattr(socket, "socket", Probe)
    assert own_host(None, "http://192.0.2.7:11311/") == ("192.0.2.5", "192.0.2.5")


def test_a_host_without_an_address(monkeypatch):
    def nowhere(*_):
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", nowhere)
    with pytest.raises(InputError, match="ROS_MASTER_URI is 'http://nowhere:1/'; allowed: a host with an IPv4"):
        own_host(None, "http://nowhere:1/")
    with pytest.raises(InputError, match="host is 'nowhere'"):
        own_host("nowhere", "http://nowhere:1/")


def test_a_relative_node_name_is_in_the_namespace_of_the_environment(monkeypatch):
    assert node_name("otwarp") == "/otwarp"
    monkeypatch.setenv("ROS_NAMESPACE", "/lab/left/")
    assert (node_name("otwarp"), node_name("/otwarp")) == ("/lab/left/otwarp", "/otwarp")
    monkeypatch.setenv("ROS_NAMESPACE", "a b")
    with pytest.raises(InputError, match="ROS_NAMESPACE is 'a b'; allowed: words"):
        node_name("otwarp")
