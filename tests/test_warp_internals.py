"""The insides of Warp that the package counts on are there, and do what they are used for."""

from __future__ import annotations

import ast
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from warp._src import context

from otwarp.kernels.core.types import ForceInput, vec6
from otwarp.warp_internals import (
    alike,
    cpu_code,
    fault_of,
    fields,
    is_running,
    is_struct,
    name_of,
    returned_by,
    same_type,
    scalar_of,
    shape_of,
    share_headers,
)

PACKAGE = Path(__file__).resolve().parent.parent / "otwarp"
ADAPTER = PACKAGE / "warp_internals.py"
INSIDE = {"_src", "_cls", "_wp_scalar_type_", "_shape_", "_length_", "_wp_generic_type_str_"}
"""Names in Warp that begin with an underscore."""


def test_running_begins_with_init():
    code = "import warp as wp; from otwarp.warp_internals import is_running; print(is_running()); wp.init(); "
    done = subprocess.run([sys.executable, "-c", code + "print(is_running())"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.splitlines() if line in ("True", "False")] == ["False", "True"]


def folder_of_headers() -> Path:
    """Where a new thread looks for compiled headers."""
    with ThreadPoolExecutor(1) as pool:
        found = pool.submit(lambda: context.runtime.get_clang_pch_dir()).result()
    return Path(found)


def test_compiled_headers_are_kept_in_the_cache(device, tmp_path, monkeypatch):
    for cache in (tmp_path / "a", tmp_path / "b"):
        monkeypatch.setattr(wp.config, "kernel_cache_dir", str(cache))
        share_headers()
        assert folder_of_headers() == folder_of_headers()
        assert folder_of_headers().parent == cache


def test_where_the_cache_is_read_only_a_thread_has_headers_of_its_own(device, tmp_path, monkeypatch):
    (tmp_path / "cache").write_text("a file in the way")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path / "cache"))
    assert folder_of_headers().is_dir()


def test_fields_of_a_struct(device):
    assert is_running()
    body = ForceInput()
    body.radius = 0.5
    assert is_struct(body) and not is_struct(ForceInput) and not is_struct(0.5)
    assert fields(body)["radius"] == 0.5 and {"position", "rotation", "time"} <= set(fields(body))
    other = alike(body, time=2.0)
    assert other.radius == 0.5 and (other.time, body.time) == (2.0, 0.0)


@pytest.mark.parametrize(
    ("dtype", "scalar", "shape"),
    [
        (wp.vec3, wp.float32, (3,)),
        (wp.vec3d, wp.float64, (3,)),
        (wp.mat33, wp.float32, (3, 3)),
        (wp.quat, wp.float32, (4,)),
        (vec6, wp.float32, (6,)),
        (wp.int32, wp.int32, ()),
    ],
)
def test_numbers_and_shape_of_a_type(dtype, scalar, shape):
    assert scalar_of(dtype) is scalar and shape_of(dtype) == shape


@wp.func
def half(x: float):
    return 0.5 * x


@wp.func
def unfinished(x: float):
    return half(x) + nothing  # noqa: F821 # pyright: ignore[reportUndefinedVariable]


@wp.func
def silent(x: float):
    x = x + 1.0


def test_what_is_wrong_with_a_function_and_what_it_returns(device):
    assert fault_of(half) is None and fault_of(silent) is None
    assert len(returned_by(half)) == 1 and same_type(returned_by(half)[0], float) and returned_by(silent) == []
    assert not same_type(returned_by(half)[0], wp.float64) and name_of(returned_by(half)[0]) == "float32"
    assert name_of(ForceInput) == "ForceInput"
    file, line, message = fault_of(unfinished) or ("", 0, "")
    assert Path(file) == Path(__file__) and "nothing" in Path(file).read_text().splitlines()[line - 1]
    assert message == "Referencing undefined symbol: nothing"


@wp.kernel(module="unique", enable_backward=False)
def twice(address: wp.uint64):
    """Doubles the number at an address."""
    values = wp.array(ptr=address, shape=(1,), dtype=wp.float64)
    values[0] = wp.float64(2.0) * values[0]


def test_code_of_a_kernel_is_where_it_is_said(device):
    code = cpu_code(twice)
    assert Path(code["loader"]).is_file() and Path(code["file"]).is_file()
    assert code["symbol"].encode() in Path(code["file"]).read_bytes()
    assert np.frombuffer(code["bounds"], dtype=np.int32).size > 4


def test_nobody_else_reaches_in():
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if path == ADAPTER or not any(name in text for name in INSIDE):
            continue
        tree = ast.parse(text)
        found = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        found |= {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
        found |= {part for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
                  for part in (node.module or "").split(".")}  # fmt: skip
        assert not INSIDE & {name for name in found if isinstance(name, str)}, path
