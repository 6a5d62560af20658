"""A binary stage that USD dies of is refused in one line, by the process that stays alive."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import pytest
from pxr import Sdf

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.read import crate
from otwarp.scene.read.source import open_stage
from tests.scene.conftest import StageFile

ENDS = {
    "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)": r"crashes on it \(SIGSEGV\)",
    "import sys; sys.exit(3)": "needs more than 8 GiB for [0-9]+ bytes",
    "import sys; sys.exit(4)": "cannot list its prims and properties",
    "import time; time.sleep(60)": "has not read it to the end after 1 s",
    "import sys; print('failed call to posix_madvise(1, 2)', file=sys.stderr)": "reads beyond its end",
}


@pytest.fixture
def binary(stage_file: StageFile) -> Path:
    path = stage_file.folder / "scene.usdc"
    assert Sdf.Layer.FindOrOpen(str(stage_file.write())).Export(str(path))
    return path


@pytest.mark.parametrize("text", ENDS)
def test_what_becomes_of_the_reader(text: str, binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reader = binary.with_name("reader.py")
    reader.write_text(text)
    monkeypatch.setattr(crate, "READER", reader)
    monkeypatch.setattr(crate, "LEAST_TIME", 1.0 if "sleep" in text else 60.0)
    with pytest.raises(InputError, match=f"scene.usdc: contents = USD {ENDS[text]}: must be a USD file"):
        Scene.load(binary)


def test_a_whole_file_is_read_through_once(binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    run = crate.subprocess.run
    monkeypatch.setattr(crate.subprocess, "run", lambda *a, **k: calls.append(a) or run(*a, **k))
    for _ in range(2):
        assert len(Scene.load(binary).bodies) == 2
    assert len(calls) == 1
    os.utime(binary, (0, 0))
    Scene.load(binary)
    assert len(calls) == 2


@pytest.mark.parametrize("under", [False, True], ids=["itself", "as a layer"])
def test_a_table_that_asks_for_all_memory_is_refused(under: bool, binary: Path) -> None:
    """The count of tokens damaged to 2⁴⁰: whoever opened that without a limit would fill the machine."""
    data = bytearray(binary.read_bytes())
    (contents,) = struct.unpack_from("<q", data, 16)
    name, tokens, _ = struct.unpack_from("<16sqq", data, contents + 8)
    assert name.startswith(b"TOKENS")
    struct.pack_into("<Q", data, tokens, 2**40)
    binary.write_bytes(data)
    path = binary
    if under:
        path = binary.with_name("above.usda")
        path.write_text(OVER.format("subLayers = [@scene.usdc@]", ""), encoding="utf-8")
    with pytest.raises(InputError, match=r"contents = USD needs more than 8 GiB for [0-9]+ bytes"):
        Scene.load(path)


OVER = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1e-6
    upAxis = "Z"
    {0}
)
over "World" ({1})
{{
}}
"""

ARCS = {
    "sublayer": ("subLayers = [@scene.usdc@]", ""),
    "reference": ("", "references = @scene.usdc@</World>"),
    "payload": ("", "payload = @./scene.usdc@</World>"),
    "expression": ('expressionVariables = {string NAME = "scene"}', 'references = @`"${NAME}.usdc"`@'),
    "quoted": ("", "payload = @@@scene.usdc@@@</World>"),
    "clips": (
        "",
        "references = @whole.usda@</World>\n    clips = {dictionary default = {asset[] assetPaths = [@scene.usdc@]; "
        'string primPath = "/World"; double2[] active = [(0, 0)]; double2[] times = [(0, 0)]}}',
    ),
}


@pytest.mark.parametrize("arc", ARCS)
def test_a_binary_layer_of_a_text_file_is_read_through_too(
    arc: str, binary: Path, stage_file: StageFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also one layer further on; the process that reads it is as ever, and says what it had to read."""
    stage_file.write().rename(binary.with_name("whole.usda"))
    layer, top = binary.with_name("layer.usda"), binary.with_name("top.usda")
    layer.write_text(OVER.format(*ARCS[arc]), encoding="utf-8")
    top.write_text(OVER.format("subLayers = [@layer.usda@]", ""), encoding="utf-8")
    problem, layers = crate._read_through(layer)
    assert not problem
    assert {Path(name).name for name in layers} >= {"layer.usda", "scene.usdc"}
    monkeypatch.setattr(crate, "_read_through", lambda _: ("crashes on it", []))
    for path in (layer, top):
        with pytest.raises(InputError, match=f"{path.name}: contents = USD crashes on it: must be a USD file"):
            open_stage(path)


def test_text_alone_is_not_read_twice(stage_file: StageFile, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = stage_file.write()
    above = whole.with_name("above.usda")
    above.write_text(OVER.format(f"subLayers = [@{whole.name}@]", ""), encoding="utf-8")
    monkeypatch.setattr(crate, "_read_through", lambda _: pytest.fail("it is text alone"))
    assert len(Scene.load(above).bodies) == 2


def test_a_layer_that_changes_is_read_through_again(binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    above = binary.with_name("above.usda")
    above.write_text(OVER.format("subLayers = [@scene.usdc@]", ""), encoding="utf-8")
    assert len(Scene.load(above).bodies) == 2
    monkeypatch.setattr(crate, "_read_through", lambda _: ("crashes on it", []))
    assert len(Scene.load(above).bodies) == 2
    os.utime(binary, (0, 0))
    with pytest.raises(InputError, match=r"above\.usda: contents = USD crashes on it"):
        Scene.load(above)


def test_without_an_interpreter_files_are_read_as_they_are(binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crate.sys, "executable", "/no/such/python")
    assert len(Scene.load(binary).bodies) == 2
