"""What a GPU repeats at every step of a lone bead, read in the PTX: no memory, no float64, nothing slow.

PTX is generated without a GPU. The compiler may not move a load out of a loop that need not run, so what does not
change over a launch must be read before it: one read that slips back costs some per cent of the speed.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.step import make_step

ONE_TRAP = {"driver": "solo", "bodies": 1, "traps": 1}

SLOW = {
    "read of global memory": r"ld\.global",
    "write to global memory": r"st\.global",
    "float64": r"\.f64",
    "64-bit multiplication": r"mul\.lo\.[su]64",
    "correctly rounded root": r"sqrt\.rn",
    "correctly rounded division": r"div\.rn|rcp\.rn",
}


def step_loop(features: Features, folder: Path) -> list[str]:
    """PTX instructions of the loop over steps: the shortest that makes the noise of a step."""
    kernel = make_step(features).fused
    assert kernel is not None
    wp.compile_aot_module(kernel.module, device=None, arch=90, module_dir=folder, use_ptx=True)
    (file,) = folder.glob("*.ptx")
    text = file.read_text()
    lines = [line.strip() for line in text[text.index(".entry") :].splitlines()]
    labels = {line[:-1]: n for n, line in enumerate(lines) if re.fullmatch(r"\$L\w+:", line)}
    jumps = [(labels[m[1]], n) for n, line in enumerate(lines) if (m := re.search(r"\bbra(?:\.uni)?\s+(\$L\w+)", line))]
    loops = [[x for x in lines[first:last] if re.match(r"@|[a-z]", x)] for first, last in jumps if first < last]
    # ten rounds of two products each, of which the compiler may take those that never change out of the loop;
    # the branch that looks for crossings makes as many more
    return min((loop for loop in loops if sum("mul.wide.u32" in x for x in loop) >= 18), key=len)


@pytest.fixture(autouse=True)
def compiler(device, monkeypatch):
    """A compiler for GPUs that optimises, also where `--unoptimised` spares the tests that step the time for it."""
    if not wp.is_cuda_available() and not wp._src.context.runtime.is_cuda_enabled:
        pytest.skip("this Warp was built without CUDA")
    monkeypatch.setattr(wp.config, "optimization_level", None)


@pytest.mark.parametrize(("escapes", "fast"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize(
    "model",
    [
        "harmonic_isotropic",
        pytest.param("harmonic_split", marks=pytest.mark.thorough),
        pytest.param("piecewise_isotropic", marks=pytest.mark.thorough),
        pytest.param("piecewise_split", marks=pytest.mark.thorough),
    ],
)
def test_loop_of_an_authored_law(model, escapes, fast, tmp_path):
    loop = step_loop(Features(**ONE_TRAP, trap_models=(model,), escapes=escapes, fast_math=fast), tmp_path)
    assert [name for name, pattern in SLOW.items() if any(re.search(pattern, line) for line in loop)] == []


@pytest.mark.parametrize("model", ["table_bilinear_upright", "table_bicubic_upright"])
def test_loop_of_a_table_reads_nodes(model, tmp_path):
    """Nodes are read, and beyond the inner part of the finest level what the other levels say of themselves."""
    loop = step_loop(Features(**ONE_TRAP, trap_models=(model,)), tmp_path)
    for name in ("write to global memory", "float64", "correctly rounded root"):
        assert not any(re.search(SLOW[name], line) for line in loop), name
