"""Taking messages and deleting entities of Cyclone DDS so that an interrupt at any moment does no harm.

The Python binding does neither. Seen in cyclonedds 11.0.1, and in its main branch of 2026:

- Its reader's `take` calls Python from C for the information on each message, and does not look whether that returned
  something (function readtake_post of clayer/pysertype.c). Python runs the handler of a signal when it enters a
  function, so Ctrl-C during a take raises inside that call, and C goes on with a null pointer: SIGSEGV.
- An entity is deleted with its last reference. A traceback may hold that, so it outlives its node's `close`, and its
  domain goes before it; one in a cycle is never deleted, since `__del__` looks it up in a registry of weak references,
  which the collector clears first.

Here C never calls Python. The functions of C are documented; that a reader of the binding takes into its class Sample
is not, and a test with real messages guards it.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

from otwarp.errors import InputError


@cache
def _taking() -> tuple[Any, Any, Any, Any]:
    """`dds_take`, `dds_free`, and what they fill: called with Python's lock held, since neither waits for long."""
    from cyclonedds.internal import DDS, dds_c_t
    from cyclonedds.topic import Sample

    loaded = DDS._dll_handle
    library = ctypes.PyDLL(loaded._name, handle=loaded._handle)
    take, free = library.dds_take, library.dds_free
    places, infos = ctypes.POINTER(ctypes.c_void_p), ctypes.POINTER(dds_c_t.sample_info)
    take.argtypes, take.restype = [dds_c_t.entity, places, infos, ctypes.c_size_t, ctypes.c_uint32], dds_c_t.returnv
    free.argtypes, free.restype = [ctypes.c_void_p], None
    return take, free, Sample, dds_c_t.sample_info


def take(reader: Any) -> bytes | None:
    """Take a reader's oldest message; never waits.

    Returns:
        The message as it came, serialized; empty where a sample has no data, as the end of a writer; None if none is
        left.

    Raises:
        InputError: Cyclone has no such reader any more, or no memory.
    """
    dds_take, dds_free, sample_type, info_type = _taking()
    sample, info = sample_type(), info_type()
    place = ctypes.c_void_p(ctypes.addressof(sample))
    taken = dds_take(reader._ref, ctypes.byref(place), ctypes.byref(info), 1, 1)
    if taken == 0:
        return None
    if taken < 0:
        from cyclonedds.core import DDSException

        raise InputError(f"Cyclone DDS cannot take a message: {DDSException(taken)}; allowed: take before close")
    try:
        return ctypes.string_at(sample.usample, sample.usample_size) if info.valid_data else b""
    finally:
        dds_free(sample.usample)


def delete(entity: Any) -> None:
    """Delete an entity now, and what is in it, whoever still refers to it; again does nothing.

    It returns when no thread of Cyclone uses the entity any more. If an interrupt cuts it short it can be called again.
    """
    # what `__del__` does by itself, but that takes the entity from the registry first: an interrupt between the two
    # would leave it for ever
    entity._delete(entity._ref)
    entity.__del__()
