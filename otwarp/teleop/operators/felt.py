"""Compiles what hands feel: machine code of their force laws, made by Warp in this process for that of the servo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from otwarp.device import start_warp
from otwarp.haptics.force.compiled import CompiledLaw, models_of
from otwarp.haptics.force.law import Law
from otwarp.haptics.force.trial import tried
from otwarp.kernels.optics.local_force import machine_code


def compile_laws(laws: Mapping[int, Sequence[Law]]) -> tuple[CompiledLaw | None, str]:
    """Code for the laws of traps, tried on them; None where plain Python must do. And which it is, for the user.

    The first call on a machine takes some seconds to compile, later ones 0.3 s to try what is in Warp's cache.
    """
    why = ""
    models = models_of(laws)
    if models is None:
        why = "one of the laws has no compiled form"
    elif not models:
        why = "no sphere is trapped"
    else:
        start_warp()
        try:
            code = CompiledLaw(**machine_code(models))
            why = tried(code, laws)
            if not why:
                return code, "compiled"
        except Exception as error:  # whatever a compiler or the folder of its cache says, there is the law in Python
            why = f"Warp cannot compile it ({error})"
    return None, f"in Python: {why}"
