"""The insides of Ray that the package counts on are there, and do what they are used for."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from otwarp.studies.engines.ray_internals import silent_workers, sockets_in

PACKAGE = Path(__file__).resolve().parents[2] / "otwarp"
ADAPTER = PACKAGE / "studies" / "engines" / "ray_internals.py"

LOST = {"is_err": False, "pid": "raylet", "ip": "127.0.0.1", "lines": ["a worker was lost"]}
"""What a driver is sent to print."""


def test_what_is_said_of_lost_workers_is_kept_back(capsys):
    worker = pytest.importorskip("ray._private.worker")
    with silent_workers():
        worker.print_to_stdstream(dict(LOST, pid="silent"), False)
        worker.print_to_stdstream(dict(LOST), False)
    assert capsys.readouterr().out == ""
    worker.print_to_stdstream(dict(LOST, lines=["another one"]), False)
    assert "another one" in capsys.readouterr().out


def test_the_folder_of_sockets_is_an_argument_of_init(tmp_path):
    ray = pytest.importorskip("ray")
    # refused before anything is started, by the arguments that it does not know
    with pytest.raises(RuntimeError, match="_of_nobody") as error:
        ray.init(address="local", _of_nobody=1, **sockets_in(str(tmp_path)))
    assert "_temp_dir" not in str(error.value) and not ray.is_initialized()


def test_nobody_else_reaches_in():
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        nodes = ast.walk(ast.parse(text)) if "ray._" in text or "_temp_dir" in text else ()
        constants = [n.value for n in nodes if isinstance(n, ast.Constant)]
        inside = [t for t in constants if isinstance(t, str) and (t.startswith("ray._") or t == "_temp_dir")]
        assert path == ADAPTER or not inside, path
