"""The local model compiled: `CompiledModel`, whose sum over traps and spheres is one call of machine code.

Warp's compiler, which comes with Warp and needs none on the machine, makes the code from the simulation's own terms
(`otwarp.kernels.optics.local_force`) where Warp runs. The servo loads it by Warp's loader alone: 10 ms and 70 MB, where
`import warp` takes 0.3 s, a thread more, and 530 MB that a real-time process locks in memory. Either way a call gives
the same bits as the `LocalModel` in plain Python, which is its reference, and is used where there is no such code.

Before a hand is given to code, it is `tried` in a process of its own, against the law in Python. A loader that has
changed, memory that may not be executed, code for another processor: what would end the servo ends the trial, and the
servo then runs the Python law. So does one bit of difference.
"""

from __future__ import annotations

import functools
import os
import pickle
import random
import struct
import subprocess
import sys
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from otwarp.errors import InputError
from otwarp.haptics.core import SceneFrame, SphereFrame, TrapFrame, Vec3
from otwarp.haptics.force import LocalModel
from otwarp.haptics.force.law import IsotropicLaw, Law, SplitLaw, TableLaw
from otwarp.laws.local_rows import HAND, LAW, PULL, SPHERE

LAYERS = {1: "", 2: "_polarized", 3: "_vortex"}
_LEVEL = struct.Struct("=2i3d")
_RUNTIME = 32
"""Functions that Warp's loader asks for before it loads anything: five in 1.19, and here is room for more."""

WITHIN = 60.0
"""Seconds that a trial may take; a cold disk and a busy machine take some of the second that it needs."""
STATES, PLACES = 20, 5
"""States that are given to both models, and places of the hand in each."""

Call = Callable[[int, int], None]
"""Code of a kernel, called with the addresses of its launch bounds and of its arguments."""


def model_of(law: Law) -> str | None:
    """What the kernel calls a law, None for one that it lacks."""
    if isinstance(law, TableLaw):
        return f"table_{'bicubic' if law.cubic else 'bilinear'}{LAYERS[law.layers]}"
    return {IsotropicLaw: "isotropic", SplitLaw: "split"}.get(type(law))


def models_of(laws: Mapping[int, Sequence[Law]]) -> tuple[str, ...] | None:
    """The models of laws, sorted; None if one of them cannot be compiled."""
    found = {model_of(law) for choices in laws.values() for law in choices}
    return None if None in found else tuple(sorted(name for name in found if name))


@dataclass(frozen=True)
class CompiledLaw:
    """Where the machine code of a kernel lies; goes to another process.

    Attributes:
        models: Laws that it knows, as `model_of` calls them; a law's number is its index here.
        loader: Warp's library that loads code.
        file: Object file.
        symbol: Name of the kernel in it.
        bounds: Launch bounds of one thread, as bytes.
    """

    models: tuple[str, ...]
    loader: str
    file: str
    symbol: str
    bounds: bytes

    def model(
        self, laws: Mapping[int, Sequence[Law]], kinds: Sequence[int], *, smoothing: float, prediction: bool
    ) -> CompiledModel:
        """A local model by this code, see `CompiledModel`."""
        return CompiledModel(laws, kinds, code=self, smoothing=smoothing, prediction=prediction)

    def load(self) -> Call:
        """The code in this process; loaded once.

        Raises:
            InputError: It cannot be.
        """
        return _loaded(self)


@functools.cache
def _loaded(code: CompiledLaw) -> Call:
    import ctypes

    try:
        library = ctypes.CDLL(code.loader)
        if (warp := sys.modules.get("warp")) is not None:
            warp.init()
        else:
            # what kernels with several lanes call, in Warp's other library of 300 MB: one lane calls nothing of it
            nothing = ctypes.cast(ctypes.CFUNCTYPE(ctypes.c_int)(int), ctypes.c_void_p).value
            library.wp_llvm_set_cpu_block_runtime((ctypes.c_void_p * _RUNTIME)(*[nothing] * _RUNTIME))
        name, library.wp_lookup.restype = f"otwarp {code.symbol}".encode(), ctypes.c_uint64
        failed = library.wp_load_obj(code.file.encode(), name, False)
        address = 0 if failed else library.wp_lookup(name, code.symbol.encode())
    except (OSError, AttributeError) as error:
        raise InputError(f"compiled force law: cannot be loaded ({error})") from None
    if not address:
        raise InputError(f"compiled force law: {code.symbol} of {code.file} cannot be loaded")
    # by Python's own convention: a call that lets other threads have the interpreter waits to get it back
    return ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(address)


class CompiledModel(LocalModel):
    """`LocalModel` with the sum of `force` compiled; states, predictions and forces are the same, bit for bit.

    Args:
        laws, kinds, smoothing, prediction: As `LocalModel`.
        code: Knows the models of all laws.

    Raises:
        InputError: As `LocalModel`, or code that cannot be loaded.
    """

    def __init__(
        self,
        laws: Mapping[int, Sequence[Law]],
        kinds: Sequence[int] = (),
        *,
        code: CompiledLaw,
        smoothing: float = 1.0,
        prediction: bool = False,
    ) -> None:
        super().__init__(laws, kinds, smoothing=smoothing, prediction=prediction)
        known = tuple(law for choices in self.laws.values() for law in choices)
        self._sum = _Sum(code.load(), code.bounds, packed_laws(code.models, known))
        row = self._sum.laws.row
        self._row = {id(law): row[law] for law in known}

    def refresh(self, scene: SceneFrame, traps: Mapping[int, Vec3]) -> bool:
        """See `ForceModel.refresh`."""
        self._fetch()
        finite = super().refresh(scene, traps)
        if finite:
            self._hand_over()
        return finite

    def state(self) -> dict[str, Any]:
        """See `ForceModel.state`."""
        self._fetch()
        return super().state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """See `ForceModel.restore`."""
        super().restore(state)
        self._hand_over()

    def force(self, x: float, y: float, z: float) -> Vec3:
        """See `ForceModel.force`."""
        return self._sum.force(x, y, z)

    def _fetch(self) -> None:
        """Take back where spheres that glide have come to."""
        if self.spheres is not self.targets:
            places = iter(self._sum.places())
            self.spheres = [[next(places) for _ in group] for group in self.spheres]

    def _hand_over(self) -> None:
        """Give the code what it sums over."""
        shares = self.shares if self.prediction and self.shares else [[0.0] * len(group) for group in self.targets]
        spheres: list[float] = []
        first = [0]
        for groups in zip(self.spheres, self.targets, shares, strict=True):
            for place, target, share in zip(*groups, strict=True):
                spheres += (*place, *target, share)
            first.append(first[-1] + len(groups[0]))
        pulls: list[float] = []
        for x, y, z, power, law, kind in self.traps:
            pulls += (x, y, z, power, self._row[id(law)], first[kind], first[kind + 1])
        self._sum.hand_over(self.carried, self.smoothing, pulls, spheres)


class _Sum:
    """A call of the code, with its arguments in memory.

    Args:
        call: The code.
        bounds: Its launch bounds.
        laws: Of all traps and kinds.
    """

    def __init__(self, call: Call, bounds: bytes, laws: PackedLaws) -> None:
        self.laws = laws
        self._call, self._bounds = call, array("B", bounds)
        self._hand = array("d", bytes(8 * len(HAND)))
        self._pulls = self.spheres = self._arguments = array("d")
        self._view = memoryview(self._hand).cast("B")
        self._write = struct.Struct("=3d").pack_into
        self._read = struct.Struct(f"={8 * HAND.index('force_x')}x3d").unpack_from
        self._at = 0, 0
        self.hand_over((0.0, 0.0, 0.0), 1.0, (), ())

    def force(self, x: float, y: float, z: float) -> Vec3:
        """One call, with the hand's traps carried by x, y, z [µm]; Σ F [pN]."""
        self._write(self._view, 0, x, y, z)
        self._call(*self._at)
        return self._read(self._view)  # type: ignore[return-value]

    def places(self) -> Iterator[Vec3]:
        """Where the spheres are now [µm]."""
        x, y, z = (self.spheres[n :: len(SPHERE)] for n in range(3))
        return zip(x, y, z, strict=True)

    def hand_over(self, published: Vec3, alpha: float, pulls: Sequence[float], spheres: Sequence[float]) -> None:
        """Rows of `local_rows`, one after another, and what the hand has beside its place."""
        self._hand[HAND.index("published_x") : HAND.index("force_x")] = array("d", published)
        self._hand[HAND.index("alpha")] = alpha
        self._pulls, self.spheres, laws = array("d", pulls), array("d", spheres), self.laws
        counted = (
            (self._pulls, len(PULL)),
            (self.spheres, len(SPHERE)),
            (laws.rows, len(LAW)),
            (laws.node, 4),
            (laws.level, _LEVEL.size),
        )
        numbers = [_address(self._hand)]
        for rows, width in counted:
            numbers += (_address(rows), len(rows) // width)
        self._arguments = array("Q", [*numbers, _address(laws.start)])
        self._at = _address(self._bounds), _address(self._arguments)


def _address(numbers: array[Any]) -> int:
    return numbers.buffer_info()[0]


class PackedLaws(NamedTuple):
    """Laws as the code reads them.

    Attributes:
        row: Where each is in `rows`.
        rows: `local_rows.LAW`, one after another.
        node, level, start: All tables, as `otwarp.kernels.core.table_data.ForceTableData`.
    """

    row: dict[Law, int]
    rows: array[float]
    node: array[float]
    level: array[int]
    start: array[int]


@functools.lru_cache(maxsize=8)
def packed_laws(models: tuple[str, ...], laws: tuple[Law, ...]) -> PackedLaws:
    """Laws in memory, equal ones once; a chain that is made anew finds them again.

    Raises:
        InputError: A law whose model the code lacks.
    """
    packed = PackedLaws({}, array("d"), array("d"), array("B"), array("i", [0]))
    tables = 0
    for law in dict.fromkeys(laws):
        name = model_of(law)
        if name not in models:
            raise InputError(
                f"force law is {name or type(law).__name__}; allowed: {', '.join(models)}, which are compiled"
            )
        values = {"model": models.index(name), "table": -1, **_constants(law)}
        if isinstance(law, TableLaw):
            values["table"], tables = tables, tables + 1
            _add_table(packed, law)
        packed.row[law] = len(packed.row)
        packed.rows.extend(values.get(key, 0.0) for key in LAW)
    return packed


def _constants(law: Law) -> dict[str, float]:
    """Numbers of a law by their names in `local_rows.LAW`; what is not there is 0."""
    if isinstance(law, TableLaw):
        return {"reach2": law.reach2, **_vector("axis", law.axis), **_vector("side", law.side)}
    assert isinstance(law, IsotropicLaw | SplitLaw), "others have no model"
    found = {"equilibrium": law.equilibrium, **_vector("axis", law.axis)}
    curves = {"": law.curve} if isinstance(law, IsotropicLaw) else {"": law.radial, "axial_": law.axial}
    for prefix, curve in curves.items():
        found |= {f"{prefix}{name}": getattr(curve, name) for name in ("stiffness", "inverse_square", "offset")}
        found[f"{prefix}threshold2"] = curve.threshold * curve.threshold
        found[f"{prefix}cutoff2"] = curve.cutoff * curve.cutoff
    found["reach2"] = max(found["cutoff2"], found.get("axial_cutoff2", 0.0))
    return found


def _vector(name: str, vector: Vec3) -> dict[str, float]:
    return {f"{name}_{axis}": value for axis, value in zip("xyz", vector, strict=True)}


def _add_table(packed: PackedLaws, law: TableLaw) -> None:
    """Append the levels of a table."""
    for level, grid in zip(law.levels, law.grids, strict=True):
        # a level starts at a whole node, whose index counts the layers as one
        packed.node.extend([0.0] * (-len(packed.node) % (4 * law.layers)))
        first = len(packed.node) // (4 * law.layers)
        packed.level.frombytes(_LEVEL.pack(first, level.columns, grid.end, level.per_spacing, level.middle))
        rows = array("d", bytes(len(level.node) // 3 * 4 * packed.node.itemsize))
        for i in range(3):
            rows[i::4] = level.node[i::3]
        packed.node.extend(rows)
    packed.start.append(len(packed.level) // _LEVEL.size)


def tried(code: CompiledLaw, laws: Mapping[int, Sequence[Law]]) -> str:
    """Why the code must not be used for these laws, or ""."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-c", "from otwarp.haptics.force.compiled import try_code; try_code()"]
    order = pickle.dumps((code, dict(laws)))
    try:
        done = subprocess.run(command, input=order, capture_output=True, env=environment, timeout=WITHIN, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"its trial failed ({error})"
    said = done.stdout.decode(errors="replace").strip()
    return said if done.returncode == 0 else said or f"its trial ended with {done.returncode}"


def try_code() -> None:
    """What the process of a trial does: an order from stdin, a line about what is wrong to stdout."""
    code, laws = pickle.loads(sys.stdin.buffer.read())
    try:
        print(difference(code, laws))
    except InputError as error:
        print(error)


def difference(code: CompiledLaw, laws: Mapping[int, Sequence[Law]], seed: int = 0) -> str:
    """How the compiled model differs from the Python one on random states and places, or ""."""
    rng, kinds = random.Random(seed), tuple(range(len(next(iter(laws.values()))))) * 3
    for prediction, smoothing in ((False, 1.0), (True, 0.3)):
        how = {"prediction": prediction, "smoothing": smoothing}
        plain, compiled = LocalModel(laws, kinds, **how), CompiledModel(laws, kinds, code=code, **how)
        for beat in range(STATES):
            scene = _random_scene(rng, beat, len(kinds), laws)
            hold = {trap: _random_vector(rng, 0.1) for trap in laws}
            for model in (plain, compiled):
                model.refresh(scene, hold)
            for _ in range(PLACES):
                carried = _random_vector(rng, 0.5)
                one, other = plain.force(*carried), compiled.force(*carried)
                if one != other:
                    return f"it gives {other} pN where Python gives {one}"
            if plain.state() != compiled.state():
                return "it moves spheres otherwise than Python"
    return ""


def _random_scene(rng: random.Random, beat: int, spheres: int, laws: Mapping[int, Sequence[Law]]) -> SceneFrame:
    """Traps near the origin and spheres about them, some on it and some far."""
    places = [_random_vector(rng, rng.choice((0.0, 0.3, 1.0, 3.0))) for _ in range(spheres)]
    traps = tuple(TrapFrame(trap, _random_vector(rng, 0.3), rng.uniform(1.0, 50.0)) for trap in laws)
    return SceneFrame(beat, 0.008 * beat, tuple(SphereFrame(place, n) for n, place in enumerate(places)), traps)


def _random_vector(rng: random.Random, size: float) -> Vec3:
    return rng.gauss(0.0, size), rng.gauss(0.0, size), rng.gauss(0.0, size)
