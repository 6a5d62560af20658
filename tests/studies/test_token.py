"""Ray heads that ask for a token, as all do on a host where Ray has run before."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from otwarp.studies.store import open_store

pytest.importorskip("zarr")
pytest.importorskip("ray")

RAY = str(Path(sys.executable).parent / "ray")


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def test_the_token_that_lies_here_is_shown(folder, whole, tmp_path):
    """To a cluster given by its address, as Ray itself shows it to one that it finds; without it one line says so."""
    (tmp_path / "token").write_text("0123456789abcdef" * 4)
    bare = {name: value for name, value in os.environ.items() if not name.startswith("RAY_AUTH")}
    keyed, keyless = bare | {"RAY_AUTH_TOKEN_PATH": str(tmp_path / "token")}, bare | {"HOME": str(tmp_path)}
    port = free_port()
    line = [sys.executable, "-m", "otwarp", "study", "run", str(folder / "s.toml"), "--device", "cpu"]
    line += ["--engine", "ray", "--address", f"127.0.0.1:{port}", "-o"]
    # sockets have names of 107 characters at most
    with tempfile.TemporaryDirectory(dir="/tmp") as near, (tmp_path / "ray.log").open("w") as log:
        start = [RAY, "start", "--head", "--node-ip-address=127.0.0.1", f"--port={port}", f"--temp-dir={near}"]
        start += ["--num-cpus=2", "--include-dashboard=false", "--disable-usage-stats", "--block"]
        head = subprocess.Popen(start, env=keyed, stdout=log, stderr=log)
        try:
            while "Ray runtime started" not in (tmp_path / "ray.log").read_text():
                assert head.poll() is None, (tmp_path / "ray.log").read_text()
                time.sleep(0.2)
            refused = subprocess.run([*line, str(tmp_path / "no")], env=keyless, capture_output=True, text=True)
            assert refused.returncode == 2 and "~/.ray/auth_token" in refused.stderr.splitlines()[-1]
            assert subprocess.run([*line, str(tmp_path / "out")], env=keyed).returncode == 0
        finally:
            head.terminate()
            head.wait()
    assert open_store(tmp_path / "out").read().load().identical(whole)
