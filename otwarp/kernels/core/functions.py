"""Functions from outside this package, and functions made from text: their source, and their float64 twins."""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
import linecache
import textwrap
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any, cast

import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.precision import SINGLE, Doubler, in_double, in_warp, typed, types_module, wp_name

_counter = itertools.count()


def function_from_text(name: str, text: str, namespace: dict[str, Any]) -> Callable[..., Any]:
    """The function `name` that `text` defines, with the globals `namespace`.

    Its source stays readable for `inspect` (and so for Warp) as long as the process lives.
    """
    file = f"<otwarp {name} {next(_counter)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    namespace.setdefault("__name__", "otwarp.made")
    exec(compile(text, file, "exec"), namespace)
    return namespace[name]


class _FunctionDoubler(Doubler):
    """Rewrites one function from outside this package; `known` are the names that it sees."""

    def __init__(self, known: dict[str, Any]):
        super().__init__(cast(ModuleType, SimpleNamespace(**known)))
        self.known, self.on_device = known, True
        self.replaced: dict[str, Any] = {}

    def visit_Module(self, node: ast.Module) -> ast.Module:
        """No imports are needed: the names are given."""
        self.generic_visit(node)
        return node

    def visit_arguments(self, node: ast.arguments) -> ast.arguments:
        """Defaults are for people: the step passes every argument."""
        node.defaults = []
        self.generic_visit(node)
        return node

    def _value(self, node: ast.expr) -> Any:
        """What a name, or a chain of attributes of one, stands for; None if that is not known."""
        if isinstance(node, ast.Name):
            return self.known.get(node.id)
        return getattr(self._value(node.value), node.attr, None) if isinstance(node, ast.Attribute) else None

    def _replacement(self, node: ast.expr) -> ast.expr | None:
        """A name for the float64 twin of a struct, or of a function made by `wp.func`; None for anything else."""
        value = self._value(node)
        twin = None
        if isinstance(value, wp.Function) and not value.is_builtin():
            twin = doubled_function(value.func)
        elif isinstance(value, type(types_module().ModelData)) and value.cls.__module__.startswith(f"{SINGLE}."):
            twin = typed(value, "float64")
        if twin is None:
            return None
        name = f"double_{len(self.replaced)}"
        self.replaced[name] = twin
        return ast.Name(name, ast.Load())

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Structs and functions first, then types."""
        value = self._value(node)
        if isinstance(value, float) and wp_name(node) == "":
            return in_warp("float64", ast.Constant(value))
        return self._replacement(node) or super().visit_Attribute(node)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Structs and functions first, then constants."""
        return self._replacement(node) or super().visit_Name(node)


def seen_names(function: Callable[..., Any]) -> dict[str, Any]:
    """Globals of a Python function, and what it closes over."""
    return {**function.__globals__, **inspect.getclosurevars(function).nonlocals}


def source_of(function: Callable[..., Any]) -> str:
    """Source of a Python function, without its decorators and indentation.

    Raises:
        InputError: There is none, as of a function typed at a prompt.
    """
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError) as error:
        raise InputError(f"function {function.__name__}: its source cannot be read, which Warp compiles; "
                         "allowed: a def in a file or a notebook's cell") from error  # fmt: skip
    definition = tree.body[0]
    if not isinstance(definition, ast.FunctionDef):
        raise InputError(f"function {function.__name__} is no def; allowed: def {function.__name__}(…)")
    definition.decorator_list = []
    return ast.unparse(definition)


def names_in(function: Callable[..., Any]) -> list[tuple[str, str]]:
    """What decides a function's results besides its own source: constants by name, and the sources of functions."""
    known = seen_names(function)
    found = []
    for node in ast.walk(ast.parse(source_of(function))):
        value = _FunctionDoubler(known)._value(node) if isinstance(node, ast.Name | ast.Attribute) else None
        if isinstance(value, wp.Function) and not value.is_builtin():
            found.append((value.key, source_of(value.func) + repr(names_in(value.func))))
        elif isinstance(value, int | float) or type(value).__module__.startswith("warp"):
            found.append((ast.unparse(node), repr(value)))
    return sorted(set(found))


@functools.lru_cache(maxsize=256)
def doubled_function(function: Callable[..., Any]) -> wp.Function:
    """The float64 twin of a function that was written for float32, outside this package.

    Other functions that it calls are doubled, too.
    """
    known = seen_names(function)
    doubler = _FunctionDoubler(known)
    tree = ast.fix_missing_locations(doubler.visit(ast.parse(source_of(function))))
    names = {**known, "wp": wp, "in_double": in_double, **doubler.replaced}
    return wp.func(function_from_text(function.__name__, ast.unparse(tree) + "\n", names))
