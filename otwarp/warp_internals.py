"""What reaches into Warp: everything that counts on more than the library promises stands here.

Seen in Warp 1.19; `tests/test_warp_internals.py` fails when what is used here is not there any more.

- *Whether Warp runs.* `wp.init` cannot be asked, and starting it writes to the terminal where no driver is.
- *Fields of a struct*, and another one of its type: an instance knows its `Struct`, which has no public name for them.
- *Numbers and shape of a vector type*, which public functions tell of arrays alone.
- *What is wrong with a function*, and what it returns: Warp tells it when a kernel that calls the function is compiled,
  in a message with a place for every function on the way.
- *Compiled headers*, which Warp makes anew in every thread that compiles for a CPU: it takes longer than most kernels.
- *Machine code of a kernel*, to be called where Warp is not imported: its file, symbol, launch bounds, and the library
  that loads it.
"""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import warp as wp
from warp._src import codegen, context, types


def is_running() -> bool:
    """Whether Warp is initialised in this process."""
    return context.runtime is not None


def share_headers() -> None:
    """Keep the compiled headers of CPU kernels in the kernel cache, one for all threads and processes.

    Warp has a folder for each thread, so that none reads what another writes; but the compiler writes to a file of its
    own and renames it, and a thread that finds none makes one.
    """
    own = context.runtime.get_clang_pch_dir
    if context.runtime.llvm is not None and not hasattr(own, "shared"):
        context.runtime.get_clang_pch_dir = _Shared(own)


class _Shared:
    """Where the compiled headers are: a folder of the cache, or a thread's own where that cannot be made."""

    shared = True

    def __init__(self, own: Callable[[], str | None]):
        self.own = own

    def __call__(self) -> str | None:
        folder = Path(wp.config.kernel_cache_dir or "") / f"headers_{_headers()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            return self.own()
        return str(folder)


@functools.cache
def _headers() -> str:
    """Digest of what the compiler takes compiled headers back for: their files, unchanged, and the processor."""
    folder = Path(wp.__file__).resolve().parent / "native"
    files = sorted((str(f), f.stat().st_size, f.stat().st_mtime_ns) for f in folder.rglob("*.h"))
    return hashlib.sha256(repr((wp.get_cpu_kernel_cache_key(), files)).encode()).hexdigest()[:16]


def is_struct(value: Any) -> bool:
    """Whether a value is an instance of a Warp struct."""
    return hasattr(value, "_cls")


def fields(struct: Any) -> dict[str, Any]:
    """Name and value of each field of an instance of a Warp struct, in order."""
    return {name: getattr(struct, name) for name in struct._cls.vars}


def alike(struct: Any, **values: Any) -> Any:
    """Another instance of the struct's type, equal but for `values`."""
    other = struct._cls()
    for name, value in (fields(struct) | values).items():
        setattr(other, name, value)
    return other


def scalar_of(dtype: Any) -> Any:
    """Type of the numbers of a vector, quaternion or matrix type; any other type itself."""
    return getattr(dtype, "_wp_scalar_type_", dtype)


def shape_of(dtype: Any) -> tuple[int, ...]:
    """Shape of a vector, quaternion or matrix type; () of any other."""
    return tuple(getattr(dtype, "_shape_", ()))


def fault_of(function: wp.Function) -> tuple[str, int, str] | None:
    """File, line and message of the first thing in a function that Warp cannot compile; None where it can."""
    try:
        with codegen._codegen_lock:
            function.build(None, function.module.options if function.module else {})
    except Exception as error:  # of half a dozen types, some of them Python's own
        text = str(error.args[0]) if error.args else str(error)
        found = list(re.finditer(r'Error while parsing function "[^"]*" at (.*):(\d+):\n.*\n', text))
        if not found:
            raise
        message = " ".join(text[found[-1].end() :].lstrip(";").split())
        return found[-1][1], int(found[-1][2]), message.removeprefix("Error, ")
    return None


def returned_by(function: wp.Function) -> list[Any]:
    """Types of what a function returns that `fault_of` has looked at, none for one that returns nothing."""
    return [value.type for value in function.adj.return_var or ()]


def same_type(a: Any, b: Any) -> bool:
    """Whether two types are one to Warp, as `float` and `wp.float32` are."""
    return types.types_equal(a, b)


def name_of(dtype: Any) -> str:
    """What Warp calls a type."""
    return str(getattr(dtype, "key", types.type_repr(dtype)))


def cpu_code(kernel: wp.Kernel) -> dict[str, Any]:
    """Where the machine code of a kernel of one thread is: `loader`, `file`, `symbol`, and its launch `bounds`.

    All its arguments are numbers. Compiles the kernel where Warp's cache has it not.

    Raises:
        RuntimeError: There is no compiler, or no room for what it makes.
    """
    device = wp.get_device("cpu")
    code = kernel.module.load(device, block_dim=1)
    launch = wp.launch(kernel, 1, [0] * len(kernel.adj.args), device=device, block_dim=1, record_cmd=True)
    if code is None or launch is None:
        raise RuntimeError(f"Warp could not compile {kernel.key}")
    return {
        "loader": str(next((Path(wp.__file__).parent / "bin").glob("*warp-clang*"))),
        "file": str(code.binary_path),
        "symbol": f"{code.get_kernel_mangled_name(kernel)}_cpu_forward",
        "bounds": bytes(launch.bounds),
    }
