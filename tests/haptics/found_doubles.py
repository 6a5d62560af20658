"""Kinds of devices for the tests of `find_all_devices`; `home` names a module of each, as in the real table."""

from __future__ import annotations

import sys
from types import ModuleType

from otwarp.errors import InputError
from otwarp.haptics.devices import Kind


def _kind(name: str, find) -> Kind:
    module = ModuleType(f"otwarp_test_{name}")
    if find is not None:
        module.find_devices = find
    sys.modules[module.__name__] = module
    return Kind(f"{module.__name__}:create", "none", "", False)


def _absent() -> tuple[str, ...]:
    raise InputError("inverse3: needs the package websockets, pip install 'otwarp[haply]'")


def _broken() -> tuple[str, ...]:
    raise OSError("libHD.so: wrong ELF class")


DOUBLES = {
    "software": _kind("software", None),
    "there": _kind("there", lambda: ("there:0001 first", "there:0002 second")),
    "nothing": _kind("nothing", lambda: ()),
    "absent": _kind("absent", _absent),
    "broken": _kind("broken", _broken),
    "gone": Kind("otwarp_test_no_such_module:create", "none", "", False),
}
