"""Who may import whom, read from the source; and what is loaded when, asked of a fresh interpreter."""

from __future__ import annotations

import ast
import functools
import re
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "otwarp"

ROOT = {"cache", "errors", "files", "laws", "lazy", "processes", "shipped", "triangles", "units", "warp_internals"}
"""Files at the root of the package that everybody may import."""

ALLOWED: dict[str, set[str]] = {
    "scene": ROOT,
    "hydrodynamics": ROOT,
    "kernels": ROOT,
    "optics": ROOT | {"kernels", "device"},
    "simulation": ROOT | {"device", "kernels", "scene", "optics", "hydrodynamics"},
    "haptics": ROOT,
    "teleop": ROOT | {"kernels", "simulation", "haptics", "scene", "record", "device"},
    "view": ROOT | {"scene", "simulation", "record", "teleop", "studies"},
    "operators": ROOT | {"device", "kernels", "haptics", "scene", "simulation", "studies", "teleop"},
    "envs": ROOT | {"device", "kernels", "perception", "preview", "scene", "simulation", "studies", "teleop"},
    "ros": ROOT | {"teleop", "haptics", "scene"},
    "preview": ROOT | {"device", "scene", "record"},
    "studies": ROOT | {"device", "kernels", "scene", "simulation"},
    "analysis": ROOT | {"studies", "record"},
    "vision": ROOT | {"device", "scene", "optics", "simulation", "record"},
    "reproduce": ROOT
    | {"device", "scene", "optics", "simulation", "haptics", "record", "ros", "studies", "vision", "bench"}
    | {"operators"},
    "perception": ROOT | {"device", "scene", "simulation", "haptics", "vision", "teleop", "ros"},
    "bench": ROOT | {"device", "scene", "optics", "kernels", "simulation"},
    "record": ROOT | {"scene", "simulation", "device"},
    "cache": set(),
    "device": {"errors", "warp_internals"},
    "errors": set(),
    "files": {"errors"},
    "laws": {"errors", "units"},
    "lazy": set(),
    "processes": {"errors"},
    "shipped": {"errors"},
    "triangles": {"errors"},
    "units": set(),
    "warp_internals": set(),
}
"""Room → rooms it may import (the design's table); `cli` may import everything, inside functions."""

KERNELS = (
    "core",
    "cpu",
    "optics",
    "body_forces",
    "forces",
    "bodies",
    "hydrodynamics",
    "contact",
    "integrate",
    "drivers",
)
"""Inner rooms of `kernels`, each of which imports only those before it."""

INNER: dict[str, set[str]] = {
    "kernels": {f"kernels.{room}" for room in KERNELS},
    "kernels.float64": {"kernels.core"},
    **{f"kernels.{room}": {f"kernels.{above}" for above in KERNELS[:n]} for n, room in enumerate(KERNELS)},
    "simulation": {"simulation.drivers", "simulation.packing", "simulation.time_step"},
    "simulation.drivers": {"simulation", "simulation.packing"},
    "simulation.packing": set(),
    "simulation.time_step": {"simulation.packing"},
    "scene": {"scene.check", "scene.read", "scene.schema"},
    "scene.vocabulary": set(),
    "scene.schema": {"scene.vocabulary"},
    "scene.check": {"scene", "scene.vocabulary"},
    "scene.plausibility": {"scene"},
    "scene.read": {"scene", "scene.check", "scene.vocabulary", "scene.schema", "scene.plausibility"},
    "scene.appearance": {"scene", "scene.read"},
    "scene.write": {"scene", "scene.check", "scene.vocabulary", "scene.schema", "scene.read", "scene.appearance"},
    "scene.drawing": {"scene", "scene.read", "scene.appearance"},
    "scene.export": {"scene", "scene.read", "scene.write", "scene.appearance", "scene.drawing"},
    "scene.recording": {"scene", "scene.vocabulary", "scene.read", "scene.appearance", "scene.drawing"},
    "bench": set(),
    **{f"bench.{room}": {"bench"} for room in ("forces", "integrators", "me", "speed", "stability")},
    "bench.terms": {"bench", "bench.speed"},
    "cli": {"cli.options"},
    "cli.options": {"cli"},
    "cli.bench": {"cli", "cli.options"},
    "cli.envs": {"cli", "cli.options"},
    "cli.haptics": {"cli", "cli.options"},
    "cli.operators": {"cli", "cli.options"},
    "cli.scenes": {"cli", "cli.options"},
    "cli.study": {"cli", "cli.options"},
    "cli.vision": {"cli", "cli.options"},
    "reproduce": {"reproduce.items"},
    "reproduce.items": {"reproduce"},
    "preview": {"preview.kernels"},
    "preview.kernels": set(),
    "vision": {"vision.kernels"},
    "vision.kernels": set(),
    "vision.calibration": {"vision"},
    "vision.datasets": {"vision"},
    "vision.networks": {"vision", "vision.datasets", "vision.networks.modules"},
    "vision.networks.modules": {"vision.networks"},
    "vision.tracking": {"vision", "vision.datasets", "vision.networks"},
    "envs": {"envs.kernels", "envs.randomise"},
    "envs.kernels": set(),
    "envs.randomise": {"envs", "envs.kernels"},
    "envs.experts": {"envs"},
    "envs.adapters": {"envs"},
    "envs.tasks": {"envs", "envs.kernels", "envs.experts"},
    "operators": {"operators.kernels"},
    "operators.kernels": set(),
    "operators.perception": {"operators", "operators.kernels"},
    "ros": set(),
    "studies": {"studies.rare", "studies.engines", "studies.stopping"},
    "studies.stopping": {"studies"},
    "studies.rare": {"studies", "studies.engines", "studies.stopping"},
    "studies.engines": {"studies"},
    "ros.ros1": {"ros"},
    "ros.ros2": {"ros"},
    "haptics.core": set(),
    "haptics.force": {"haptics.core"},
    "haptics.chain": {"haptics.core", "haptics.force"},
    "haptics.recording": {"haptics.core"},
    "haptics.devices": {"haptics.core", "haptics.recording"},
    "haptics.servo": {"haptics.core", "haptics.chain", "haptics.devices"},
    "haptics.check": {f"haptics.{room}" for room in ("core", "force", "chain", "devices", "servo")},
    "teleop": set(),
    "teleop.operators": {"teleop"},
    "teleop.recording": {"teleop"},
    "teleop.budget": set(),
    "teleop.page": {"teleop"},
    "teleop.session": {"teleop", *(f"teleop.{room}" for room in ("operators", "recording", "budget", "page"))},
}
"""Inner room → inner rooms of the same room that it may import; a room's own name stands for the files beside them."""

HEAVY = {"warp", "pxr", "torch", "viser", "ray", "xarray", "netCDF4", "matplotlib", "scipy", "trimesh"}
HEAVY |= {"cv2", "imageio", "harvesters", "gymnasium", "pettingzoo"}
HEAVY |= {"hid", "websockets", "rosbags", "cyclonedds", "forcedimension_core", "rospy", "zarr", "onnx", "onnxruntime"}
ONLY_IN = {
    "pxr": {"scene"},
    "warp": {"device", "kernels", "simulation", "preview", "optics", "bench", "cli", "studies", "vision"}
    | {"envs", "operators", "warp_internals"},
    "rospy": set(),
}
"""Third-party packages that only some rooms may touch at all."""

LAZY = {"torch", "viser", "ray", "xarray", "netCDF4", "matplotlib", "trimesh"}
LAZY |= {"cv2", "imageio", "harvesters", "gymnasium", "pettingzoo"}
LAZY |= {"hid", "websockets", "rosbags", "cyclonedds", "forcedimension_core", "rospy", "zarr", "onnx", "onnxruntime"}
"""Packages that nobody may import at the top of a file."""

ADAPTERS = {"otwarp/ros/ros2/messages.py": "cyclonedds"}
ADAPTERS |= {
    f"otwarp/vision/networks/modules/{name}.py": "torch"
    for name in ("augment", "heads", "loss", "network", "resnet", "small", "vgg")
}
ADAPTERS |= {
    f"otwarp/envs/{name}.py": "gymnasium"
    for name in ("single", "vector", "grouped", "tasks/ot_gym_env", "adapters/sb3")
}
ADAPTERS |= {f"otwarp/envs/adapters/{name}.py": "gymnasium torch" for name in ("skrl", "rsl_rl")}
ADAPTERS |= {"otwarp/envs/pettingzoo.py": "pettingzoo"}
"""Files that are made of a package, or of some, and that others import by name when it is wanted."""


def room_of(path: Path) -> str:
    first = path.relative_to(PACKAGE).parts[0]
    # `python -m otwarp` is the command line
    return "cli" if first == "__main__.py" else first.removesuffix(".py")


@functools.cache
def imports(path: Path, *, for_types: bool = False) -> list[tuple[str, bool]]:
    """(dotted name, at import time) of everything a file imports; imports for type checkers where they are asked for.

    A package says there what it offers, and loads it when it is used: that never counts.
    """
    found = []

    def visit(node: ast.AST, top: bool) -> None:
        for child in ast.iter_child_nodes(node):
            apart = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
            if apart and (not for_types or path.name == "__init__.py"):
                continue
            if isinstance(child, ast.Import):
                found.extend((a.name, top) for a in child.names)
            elif isinstance(child, ast.ImportFrom):
                assert child.level == 0, f"{path}: relative import"
                found.extend((f"{child.module}.{a.name}", top) for a in child.names)
            visit(child, top and not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda))

    visit(ast.parse(path.read_text(encoding="utf-8")), True)
    return found


FILES = sorted(p for p in PACKAGE.rglob("*.py") if p.name != "__init__.py" or p.parent != PACKAGE)


def named_modules(path: Path, *, for_types: bool = False) -> list[str]:
    """Dotted names that a file imports anywhere, with those that it gives to `import_module` in so many words."""
    text = path.read_text(encoding="utf-8")
    nodes = ast.walk(ast.parse(text)) if "import_module" in text else ()
    calls = [node for node in nodes if isinstance(node, ast.Call)]
    by_name = [c.args[0] for c in calls if c.args and ast.unparse(c.func).split(".")[-1] == "import_module"]
    return [name for name, _ in imports(path, for_types=for_types)] + [
        str(name.value) for name in by_name if isinstance(name, ast.Constant)
    ]


def test_the_package_needs_nothing_of_the_repository_around_it():
    """An installed otwarp has neither benchmarks nor tests nor scenes beside it."""
    for path in PACKAGE.rglob("*.py"):
        outside = {name.split(".")[0] for name in named_modules(path)} & {"benchmarks", "tests", "scenes"}
        assert not outside, f"{path}: {outside}"
        edits = re.search(r"sys\.path(\.\w+\(|\[|\s*\+?=[^=])", path.read_text(encoding="utf-8"))
        assert not edits, f"{path} changes where modules are looked for"


def import_graph() -> dict[Path, set[Path]]:
    """File → files of the package that it imports, lazily or for type checkers, too.

    That a module loads its packages does not count.
    """
    files = {
        ".".join(p.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): p
        for p in PACKAGE.rglob("*.py")
    }
    graph: dict[Path, set[Path]] = {}
    for path in files.values():
        graph[path] = set()
        for name in named_modules(path, for_types=True):
            # `from package import name`: a module of it, or else what its `__init__` defines
            while name and name not in files:
                name = name.rpartition(".")[0]
            if name and files[name] != path:
                graph[path].add(files[name])
    return graph


def rings(graph: dict[Path, set[Path]]) -> list[set[Path]]:
    """Largest sets of files each of which reaches all others of its set (strong components)."""
    reach: dict[Path, set[Path]] = {}
    for start in graph:
        found: set[Path] = set()
        edge = set(graph[start])
        while edge:
            found |= edge
            edge = set().union(*(graph[p] for p in edge)) - found
        reach[start] = found
    out: list[set[Path]] = []
    for path in graph:
        ring = {other for other in reach[path] if path in reach[other]}
        if ring and ring not in out:
            out.append(ring)
    return out


def test_no_file_imports_its_importers():
    """No circle of files, lazy imports and those for type checkers counted."""
    graph = import_graph()
    ties = []
    for ring in rings(graph):
        ties.append(f"a ring of {len(ring)} files:")
        for p in sorted(ring):
            used = ", ".join(q.relative_to(PACKAGE).as_posix() for q in sorted(graph[p] & ring))
            ties.append(f"  {p.relative_to(PACKAGE).as_posix()} -> {used}")
    assert not ties, "\n".join(ties)


def test_there_are_files_to_check():
    assert {"kernels", "scene", "simulation", "cli"} <= {room_of(p) for p in FILES}


@pytest.mark.parametrize("room", sorted({room_of(p) for p in FILES}))
def test_a_room_imports_only_what_the_design_allows(room):
    files = [p for p in FILES if room_of(p) == room]
    assert room == "cli" or room in ALLOWED, f"room {room} is not in the table"
    for path in files:
        for name, top in imports(path):
            package = name.split(".")[0]
            if package == "otwarp" and room != "cli":
                used = [*name.split("."), ""][1]
                # `from otwarp import __version__` is the package itself
                assert used in ALLOWED[room] | {room, "", "__version__"}, f"{path}: {name}"
            if package in ONLY_IN:
                assert room in ONLY_IN[package], f"{path}: {name}"
            adapts = ADAPTERS.get(path.relative_to(PACKAGE.parent).as_posix(), "").split()
            if package in LAZY and package not in adapts:
                assert not top, f"{path}: {name} is imported at the top of the file"


def inner_room_of(name: str) -> str:
    """Key of `INNER` for a dotted name below `otwarp`, "" for a room without inner ones."""
    parts = name.split(".")
    return next((key for n in range(len(parts), 0, -1) if (key := ".".join(parts[:n])) in INNER), "")


@pytest.mark.parametrize("inner", sorted(INNER))
def test_an_inner_room_imports_only_what_the_design_allows(inner):
    room = inner.split(".")[0]
    files = {p: ".".join(p.relative_to(PACKAGE).with_suffix("").parts) for p in FILES if room_of(p) == room}
    files = {p: name for p, name in files.items() if inner_room_of(name) == inner}
    assert files, f"{inner} has no files"
    for path in files:
        for name, _ in imports(path):
            if name.startswith(f"otwarp.{room}."):
                used = inner_room_of(name.removeprefix("otwarp."))
                assert used in INNER[inner] | {inner}, f"{path}: {name}"


def test_commands_import_nothing_heavy_before_they_are_called():
    """`otwarp.cli.main` and the package's own `__init__` name other rooms in functions only."""
    for path in (PACKAGE / "cli" / "main.py", PACKAGE / "__init__.py", PACKAGE / "errors.py", PACKAGE / "units.py"):
        at_top = {name.split(".")[0] for name, top in imports(path) if top}
        assert not at_top & (HEAVY | {"numpy"}), path


def loaded_after(code: str) -> set[str]:
    """Top-level packages in `sys.modules` after running `code` in a fresh interpreter."""
    script = f"import sys\n{code}\nprint(*sorted({{m.split('.')[0] for m in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


HELP = """
from otwarp.cli.main import main
code = main(["--help"])
assert code == 0, code
"""


@pytest.mark.quick
@pytest.mark.parametrize(
    ("code", "absent", "present"),
    [
        ("import otwarp", HEAVY | {"numpy", "click", "rich"}, {"otwarp"}),
        (HELP, HEAVY | {"numpy", "rich"}, {"otwarp", "click"}),
        ("import otwarp; otwarp.InputError", HEAVY | {"numpy"}, {"otwarp"}),
        ("import otwarp; otwarp.Scene", HEAVY, {"numpy"}),
        ("import otwarp.scene", HEAVY, {"numpy"}),
        ("import otwarp.kernels.step", HEAVY - {"warp"}, {"warp"}),
        ("import otwarp; otwarp.Simulation", HEAVY - {"warp"}, {"warp"}),
        ("import otwarp.hydrodynamics, otwarp.optics, otwarp.laws", HEAVY | {"numpy"}, {"otwarp"}),
        ("import otwarp.hydrodynamics as h; h.body_mobility", HEAVY, {"numpy"}),
        ("import otwarp.teleop.page.child", HEAVY, {"numpy"}),
        ("import otwarp.haptics.servo.process", HEAVY | {"numpy"}, {"otwarp"}),
        ("import otwarp.haptics.chain.chain", HEAVY | {"numpy"}, {"otwarp"}),
        ("import otwarp.ros.ros1.node, otwarp.ros.ros2.node", HEAVY, {"otwarp"}),
    ],
    ids=lambda v: v.strip().splitlines()[0] if isinstance(v, str) else "",
)
def test_importing_loads_only(code, absent, present):
    loaded = loaded_after(code)
    assert not loaded & absent
    assert present <= loaded
