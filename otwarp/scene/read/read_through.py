"""Reads all that a USD file says. An interpreter of its own runs this text (see `crate`): `-c` text, PATH, BYTES.

Exits with `NO_MEMORY` where that takes more address space than BYTES, and with `BROKEN` where not even all prims and
properties can be listed. On stdout it names the files of all layers, each ended by a zero byte. It imports nothing of
otwarp.
"""

import os
import sys
from collections.abc import Callable
from contextlib import suppress

from pxr import Sdf, Tf, Usd, UsdUtils

NO_MEMORY, BROKEN = 3, 4


def read_through(stage: Usd.Stage) -> None:
    """Ask a stage for its prims and properties, and these for what every layer says of them, at all times."""
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate):
        _ask(prim.GetAllMetadata)
        for prop in prim.GetProperties():
            _ask(prop.GetAllMetadata)
            for spec in prop.GetPropertyStack(Usd.TimeCode.Default()):
                _ask(lambda spec=spec: isinstance(spec, Sdf.AttributeSpec) and (spec.typeName.type, spec.default))
            if isinstance(prop, Usd.Relationship):
                _ask(prop.GetTargets)
                continue
            for code in (Usd.TimeCode.Default(), *prop.GetTimeSamples()):
                _ask(lambda prop=prop, code=code: prop.Get(code))


def _ask(question: Callable[[], object]) -> None:
    # what it refuses is refused again, in a line, where the value is wanted
    with suppress(Tf.ErrorException, RuntimeError, TypeError, ValueError, OverflowError):
        question()


def _out_of_memory(problem: object) -> bool:
    """Whether that is why: of the tables at the head of a crate USD says so in an error or, of a layer, a warning."""
    return isinstance(problem, MemoryError) or "bad_alloc" in str(problem)


def _limit_memory(most: int) -> None:
    try:
        import resource
    except ImportError:  # not on this system
        return
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


if __name__ == "__main__":
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    _limit_memory(int(sys.argv[2]))
    try:
        opened = Usd.Stage.Open(sys.argv[1])
    except Exception as problem:  # whoever opens it for its sake says why not, if there is the memory to find out
        sys.exit(NO_MEMORY if _out_of_memory(problem) else 0)
    try:
        read_through(opened)
    except MemoryError:
        sys.exit(NO_MEMORY)
    except Exception:
        sys.exit(BROKEN)
    if any(_out_of_memory(said.commentary) for said in delegate.TakeUncoalescedDiagnostics()):
        sys.exit(NO_MEMORY)
    for layer in opened.GetUsedLayers(includeClipLayers=True):
        sys.stdout.buffer.write(os.fsencode(layer.realPath) + b"\0")
