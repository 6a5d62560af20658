"""Functions from outside this package, and functions made from text: their source, and their float64 twins."""

from __future__ import annotations

import ast
import builtins
import functools
import hashlib
import inspect
import itertools
import linecache
import math
import textwrap
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any, cast

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.precision import SINGLE, Doubler, in_double, in_warp, typed, types_module
from otwarp.warp_internals import fault_of, name_of, returned_by, same_type, scalar_of

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


def outer_names(function: Callable[..., Any]) -> dict[str, Any]:
    """What the names stand for that a function uses and does not define: globals, and what it closes over."""
    nodes = list(ast.walk(ast.parse(source_of(function))))
    own = {n.arg for n in nodes if isinstance(n, ast.arg)}
    own |= {n.id for n in nodes if isinstance(n, ast.Name) and not isinstance(n.ctx, ast.Load)}
    used = {n.id for n in nodes if isinstance(n, ast.Name)} - own
    seen = {**function.__globals__, **inspect.getclosurevars(function).nonlocals}
    return {name: seen[name] for name in used if name in seen}


class _Outer(ast.NodeVisitor):
    """Collects what a function takes from outside, by how it writes it: `AMPLITUDE`, `np.pi`, `wp.sin`."""

    def __init__(self, known: dict[str, Any]):
        self.known = known
        self.found: dict[str, Any] = {}

    def value(self, node: ast.expr) -> Any:
        """What a name, or a chain of attributes of one, stands for; None if that is not known."""
        if isinstance(node, ast.Name):
            return self.known.get(node.id)
        return getattr(self.value(node.value), node.attr, None) if isinstance(node, ast.Attribute) else None

    def visit_Attribute(self, node: ast.Attribute) -> None:
        """A whole chain, if its first name comes from outside."""
        value = self.value(node)
        if value is None:
            self.generic_visit(node)
        else:
            self.found[ast.unparse(node)] = value

    def visit_Name(self, node: ast.Name) -> None:
        """A name from outside."""
        if node.id in self.known:
            self.found[node.id] = self.known[node.id]


def described(value: Any, where: str) -> str:
    """A text that is equal, in any process, for values that act alike in a kernel.

    Raises:
        InputError: There is none for a value of this kind; `where` says who uses it.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return repr(value)
    if isinstance(value, tuple | list):
        return f"({', '.join(described(item, where) for item in value)})"
    if isinstance(value, wp.Function):
        return f"warp.{value.key}" if value.is_builtin() else full_source(value.func)
    if isinstance(value, type(types_module().ModelData)):
        fields = [f"{name}: {described(var.type, where)}" for name, var in value.vars.items()]
        return f"{value.cls.__module__}.{value.cls.__qualname__}({', '.join(fields)})"
    if isinstance(value, wp.array):  # the type of a struct's field
        return f"array{value.ndim}({described(value.dtype, where)})"
    if isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        return f"{array.dtype}{array.shape}{hashlib.sha256(array.tobytes()).hexdigest()}"
    if isinstance(value, type | ModuleType):
        return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', value.__name__)}"
    if inspect.isbuiltin(value) or getattr(builtins, getattr(value, "__name__", ""), None) is value:
        return f"{value.__module__}.{value.__qualname__}"
    if inspect.isfunction(value):
        library = (value.__module__ or "").partition(".")[0] in ("warp", "numpy", "math")
        return f"{value.__module__}.{value.__qualname__}" if library else full_source(value)
    if scalar_of(type(value)) is not type(value) or isinstance(value, wp.float64 | wp.float32 | wp.int32 | wp.int64):
        return f"{type(value).__qualname__}{value}"
    raise InputError(
        f"{where}, a {type(value).__qualname__}, which cannot be told from another one; "
        "allowed: numbers, texts, tuples, arrays, functions, and types and structs of Warp"
    )


@functools.lru_cache(maxsize=256)
def full_source(function: Callable[..., Any]) -> str:
    """Source of a function, and of all that it takes from outside.

    Raises:
        InputError: It uses something of which no source can be given.
    """
    outer = _Outer(outer_names(function))
    outer.visit(ast.parse(source_of(function)))
    name = function.__name__
    more = [f"{k} = {described(v, f'function {name} uses {k}')}" for k, v in sorted(outer.found.items())]
    return "\n".join([source_of(function), *more])


def digest_of(function: Callable[..., Any], *facts: Any) -> str:
    """SHA-256 of a function's source, of all that it takes from outside, and of the `repr` of some facts about it.

    Raises:
        InputError: As `full_source`.
    """
    return hashlib.sha256(repr((*facts, full_source(function))).encode()).hexdigest()


def arguments_of(what: str, function: Callable[..., Any], first: Any) -> tuple[list[inspect.Parameter], Any]:
    """The arguments of a user's function behind its first, and the annotation of what it returns.

    Args:
        what: Kind of function, for messages: `force`, `end`.
        function: As written.
        first: How its first argument must be annotated: a struct that `otwarp` exports.

    Raises:
        InputError: Annotations that cannot be read, or another first argument.
    """
    name = f"{what} {function.__name__}"
    try:
        signature = inspect.signature(function, eval_str=True, locals=dict(inspect.getclosurevars(function).nonlocals))
    except (NameError, TypeError) as error:
        raise InputError(f"{name}: its annotations cannot be read ({error})") from error
    given, *rest = signature.parameters.values() or (None,)
    if given is None or given.annotation is not first:
        raise InputError(f"{name}: its first argument must be annotated as otwarp.{first.key}")
    return [argument for argument in rest if argument is not None], signature.return_annotation


class _FunctionDoubler(Doubler):
    """Rewrites one function from outside this package; `known` are the names that it takes from outside."""

    def __init__(self, known: dict[str, Any]):
        super().__init__(cast(ModuleType, SimpleNamespace(**known)))
        self.outer, self.on_device = _Outer(known), True
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

    def _replacement(self, node: ast.expr) -> ast.expr | None:
        """What stands for the float64 twin of a struct, a type, or a function made by `wp.func`; None for the rest."""
        value, twin = self.outer.value(node), None
        if isinstance(value, wp.Function) and not value.is_builtin():
            twin = doubled_function(value.func)
        elif isinstance(value, type(types_module().ModelData)):
            # a struct from outside has one precision, its own
            twin = typed(value, "float64") if value.cls.__module__.startswith(f"{SINGLE}.") else None
        elif isinstance(value, type) and typed(value, "float64") is not value:
            twin = typed(value, "float64")
        if twin is None:
            return None
        name = f"double_{len(self.replaced)}"
        self.replaced[name] = twin
        return ast.Name(name, ast.Load())

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Structs, types and functions first, then constants."""
        value = self.outer.value(node)
        if isinstance(value, float):
            return in_warp("float64", ast.Constant(value) if math.isfinite(value) else node)
        return self._replacement(node) or super().visit_Attribute(node)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Structs, types and functions first, then constants."""
        if self.outer.value(node) is wp:
            return ast.Name("wp", node.ctx)
        return self._replacement(node) or super().visit_Name(node)


class _WarpByItsName(ast.NodeTransformer):
    """Calls Warp `wp`, whatever a function calls it."""

    def __init__(self, known: dict[str, Any]):
        self.known = known

    def visit_Name(self, node: ast.Name) -> ast.Name:
        """The module alone."""
        return ast.Name("wp", node.ctx) if self.known.get(node.id) is wp else node


def _checked(function: wp.Function, name: str, place: str, returns: tuple[Any, ...], allowed: str) -> wp.Function:
    """A function as Warp's, if Warp can compile it and it returns one of some types.

    Raises:
        InputError: It cannot, or it returns something else.
    """
    fault = fault_of(function)
    if fault is not None:
        file, line, message = fault
        where = place if file.startswith("<otwarp") else f"{file}:{line}"
        raise InputError(f"{name} ({where}): Warp cannot compile it: {message}")
    found = returned_by(function)
    if len(found) != 1 or not any(same_type(found[0], kind) for kind in returns):
        got = ", ".join(map(name_of, found)) or "nothing"
        raise InputError(f"{name} ({place}) returns {got}; allowed: {allowed}")
    return function


@functools.lru_cache(maxsize=256)
def compiled(
    function: Callable[..., Any], precision: str, what: str, returns: tuple[Any, ...], allowed: str
) -> wp.Function:
    """A function from outside this package as Warp's, in a precision.

    Args:
        function: As written, for float32.
        precision: One of `PRECISIONS`.
        what: Kind of function, for messages: `force`, `end`.
        returns: Types of which it returns one, in float32.
        allowed: Those types in words, for messages.

    Raises:
        InputError: Warp cannot compile it, or it returns something else; with its file and line.
    """
    name = f"{what} {function.__name__}"
    place = f"{function.__code__.co_filename}:{function.__code__.co_firstlineno}"
    single = _checked(wp.func(function), name, place, returns, allowed)
    if precision == "float32":
        return single
    twins = tuple(typed(kind, precision) for kind in returns)
    return _checked(doubled_function(function), f"{name} in {precision}", place, twins, allowed)


@functools.lru_cache(maxsize=256)
def doubled_function(function: Callable[..., Any]) -> wp.Function:
    """The float64 twin of a function that was written for float32, outside this package.

    Other functions that it calls are doubled, too.
    """
    known = {**outer_names(function), "wp": wp}
    tree = _WarpByItsName(known).visit(ast.parse(source_of(function)))
    doubler = _FunctionDoubler(known)
    text = ast.unparse(ast.fix_missing_locations(doubler.visit(tree)))
    names = {**known, "in_double": in_double, **doubler.replaced}
    return wp.func(function_from_text(function.__name__, text + "\n", names))
