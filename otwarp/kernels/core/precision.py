"""Two precisions from one source: float64 kernels as a second instance of the modules of this package.

Warp kernels are typed, and a literal is float32, so that float64 would need every module twice. Instead the package
`otwarp.kernels.float64` is made on import from the source of this one: `wp.vec3` becomes `wp.vec3d`, `float` and
`wp.float32` become `wp.float64`, and literals and constants inside kernels, functions and structs are cast. Its own
files are what cannot be had this way: random numbers, which stay float32 so that both precisions see the same noise,
and code that is native to one precision. Modules named in `SHARED` serve both precisions as they are.
"""

from __future__ import annotations

import ast
import functools
import importlib
import importlib.abc
import importlib.machinery
import importlib.util
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import warp as wp

from otwarp.warp_internals import scalar_of

PRECISIONS = ("float32", "float64")
"""Precisions of a model's real numbers by name, the default first."""

HERE = Path(__file__).parent.parent
"""The folder of this package's kernels."""

SINGLE = "otwarp.kernels"
DOUBLE = "otwarp.kernels.float64"

SHARED_ROOMS = ("body_forces.", "cpu.", "drivers.grid.")
"""Inner rooms that have no second instance: functions doubled one by one, code native to float32, the grid driver."""

SHARED = {
    # no real numbers in it, or in float64 as it is
    "core.exact_data",
    "core.features",
    "core.precision",
    "core.functions",
    "forces.force",
    "optics.exact",
    "optics.exact_room",
    "optics.exact_waves",
    # what float64 does without: lanes of a CPU
    "drivers.lane_groups",
    "drivers.lanes",
    "drivers.lanes_rigid",
}
"""Modules that have no second instance, by their names within the package."""

_TYPES = {
    "float32": "float64",
    **{name: f"{name}d" for name in ("vec2", "vec3", "vec4", "quat", "mat22", "mat33", "mat44")},
}
_DEVICE_CODE = {"func", "func_native", "kernel", "struct"}


def in_double(value: Any) -> Any:
    """A Python float as Warp's float64, anything else as it is: for constants that kernels read."""
    return wp.float64(value) if isinstance(value, float) else value


def is_shared(name: str) -> bool:
    """Whether a module of this package serves both precisions as it is."""
    return name in SHARED or f"{name}.".startswith(SHARED_ROOMS)


def kernel_module(name: str, precision: str) -> ModuleType:
    """The module of this package called `name` (`core.types`, `step`, …), in a precision of `PRECISIONS`."""
    double = precision == "float64" and not is_shared(name)
    return importlib.import_module(f"{DOUBLE if double else SINGLE}.{name}")


def types_module() -> ModuleType:
    """The module of the float32 structs, imported late because they import nothing of precision."""
    return importlib.import_module(f"{SINGLE}.core.types")


@functools.cache
def typed(kind: Any, precision: str) -> Any:
    """A Warp type or struct of float32 as it is in `precision`; what holds no real numbers stays as it is."""
    if precision == "float32":
        return kind
    types = types_module()
    if isinstance(kind, type(types.ModelData)):
        return getattr(kernel_module(kind.cls.__module__.removeprefix(f"{SINGLE}."), precision), kind.cls.__name__)
    for name in ("vec6", "mat66"):
        if kind is getattr(types, name):
            return getattr(kernel_module("core.types", precision), name)
    for single, double in _TYPES.items():
        if kind is getattr(wp, single):
            return getattr(wp, double)
    return kind


def precision_of(array: wp.array) -> str:
    """Precision of an array of real numbers."""
    return "float64" if scalar_of(array.dtype) is wp.float64 else "float32"


def wp_name(node: ast.expr) -> str:
    """`name` of `wp.name` or of a call of it, else nothing."""
    if isinstance(node, ast.Call):
        node = node.func
    named = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "wp"
    return node.attr if named else ""


def in_warp(name: str, *arguments: ast.expr) -> ast.expr:
    """`wp.name`, or the call of it."""
    attribute = ast.Attribute(ast.Name("wp", ast.Load()), name, ast.Load())
    return ast.Call(attribute, list(arguments), []) if arguments else attribute


class Doubler(ast.NodeTransformer):
    """Rewrites a module of float32 kernels; `single` is that module, which knows the values of its constants."""

    def __init__(self, single: ModuleType):
        self.single = single
        self.on_device = False

    def visit_Module(self, node: ast.Module) -> ast.Module:
        """Import `in_double` behind the docstring and the imports from `__future__`."""
        self.generic_visit(node)
        first = 1
        while isinstance(node.body[first], ast.ImportFrom) and node.body[first].module == "__future__":
            first += 1
        node.body.insert(first, ast.ImportFrom(f"{SINGLE}.core.precision", [ast.alias("in_double")], 0))
        return node

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.ImportFrom:
        """From the second instance, where there is one."""
        inside = (node.module or "").startswith(f"{SINGLE}.")
        name = (node.module or "").removeprefix(f"{SINGLE}.")
        if inside and not is_shared(name):
            node.module = f"{DOUBLE}.{name}"
        return node

    def _definition(self, node: Any) -> Any:
        decorators, node.decorator_list = node.decorator_list, []
        before = self.on_device
        self.on_device = before or any(wp_name(d) in _DEVICE_CODE for d in decorators)
        self.generic_visit(node)
        self.on_device, node.decorator_list = before, decorators
        return node

    visit_FunctionDef = visit_ClassDef = _definition

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Static expressions are evaluated by Python: their value is cast, they stay as they are."""
        name = wp_name(node)
        if self.on_device and name == "static":
            node.args = [ast.Call(ast.Name("in_double", ast.Load()), node.args, [])]
            return node
        self.generic_visit(node)
        if wp_name(node.func) == "float64" and wp_name(node.args[0]) == "float64":
            return node.args[0]  # of a literal, which was cast already
        if wp_name(node.func) == "float64" and wp_name(node.args[0]) == "static":
            # a variable that starts at a constant: the cast alone would give the constant itself, for Warp to change
            return ast.BinOp(in_warp("float64", ast.Constant(1.0)), ast.Mult(), node.args[0])
        if self.on_device and name == "quat_identity":
            node.keywords = [ast.keyword("dtype", in_warp("float64"))]
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Types, and the constants `wp.inf` and `wp.nan`."""
        name = wp_name(node)
        if name in _TYPES:
            node.attr = _TYPES[name]
        elif self.on_device and name and isinstance(getattr(wp, name, None), float):
            return in_warp("float64", node)
        else:
            self.generic_visit(node)
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """`float`, and constants of the module."""
        if self.on_device and isinstance(node.ctx, ast.Load):
            if node.id == "float":
                return in_warp("float64")
            if isinstance(getattr(self.single, node.id, None), float):
                return in_warp("static", ast.Call(ast.Name("in_double", ast.Load()), [node], []))
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        """Literals."""
        return in_warp("float64", node) if self.on_device and isinstance(node.value, float) else node


@functools.cache
def double_source(name: str) -> str:
    """Source of the float64 instance of a module of this package."""
    single = importlib.import_module(f"{SINGLE}.{name}")
    assert single.__file__ is not None
    tree = ast.parse(Path(single.__file__).read_text(encoding="utf-8"))
    return ast.unparse(ast.fix_missing_locations(Doubler(single).visit(tree)))


class DoubleModules(importlib.abc.MetaPathFinder, importlib.abc.ExecutionLoader):
    """Finds and loads the modules of `otwarp.kernels.float64` that have no file of their own.

    Warp reads the source of a kernel, so the loader must give it.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Asked only for what is not found as a file."""
        name = fullname.removeprefix(f"{DOUBLE}.")
        if name == fullname or is_shared(name):
            return None
        if importlib.util.find_spec(f"{SINGLE}.{name}") is None:
            return None
        room = self.is_package(fullname)
        spec = importlib.machinery.ModuleSpec(fullname, self, origin=self.get_filename(fullname), is_package=room)
        spec.has_location = True
        return spec

    def is_package(self, fullname: str) -> bool:
        """An inner room has a namesake, which holds nothing itself."""
        return (HERE / fullname.removeprefix(f"{DOUBLE}.")).is_dir()

    def get_source(self, fullname: str) -> str:
        """As imported."""
        return "" if self.is_package(fullname) else double_source(fullname.removeprefix(f"{DOUBLE}."))

    def get_filename(self, fullname: str) -> str:
        """Where the file would be if there were one."""
        return str(HERE / "float64" / f"{fullname.removeprefix(f'{DOUBLE}.').replace('.', '/')}.py")
