"""The table of parameters: what the paper and its release say, and what stands in for it here."""

from __future__ import annotations

from otwarp.haptics.chain.paper_mode import RELEASE_LAW
from otwarp.haptics.core.config import PAPER_CHAIN, RELEASE_ALPHA, RELEASE_GAIN, RELEASE_RATE
from otwarp.reproduce.item import Comparison, Request, Result, Value
from otwarp.ros.contract import ContractConfig
from otwarp.scene import Scene

DEFINITION = """Parameters of the setup. Ours are read from the shipped scenes and presets when the report is made;
all of them are attributes of a scene or options of a command."""

DIFFERENCE = """What the paper states is taken over. What it does not state has a default of its own, chosen as the
docstrings of the scenes say (`scenes/author`). Sizes are those of the only robot that is drawn to scale, a cross in a
companion paper; the µm of the paper's figures and code is a scene unit, since a trap that reaches 0.08 µm cannot hold
a sphere of 3 µm."""

INCOMPARABLE = (
    "Wavelength, power and aperture of the traps, the index of the resist, the shape of the robot in the user study "
    "and "
    "the scale of its scene are not published; whoever knows them sets them in the scene.",
)


def run(request: Request) -> Result:
    """Read our parameters and set them beside theirs."""
    robot, pair, task = (request.scene(name) for name in ("strategy_b", "strategy_a", "cell_delivery"))
    return Result(
        comparisons=(*_optics(robot, task), *_robots(robot, pair, task), *_task(task), *_haptics()),
        definition=DEFINITION,
        difference=DIFFERENCE,
        incomparable=INCOMPARABLE,
        computed={"how": "read from strategy_a, strategy_b and cell_delivery.usda and from the presets of haptics"},
    )


def _optics(robot: Scene, task: Scene) -> tuple[Comparison, ...]:
    trap, sphere, camera = task.traps[0], robot.bodies[0].spheres[0], robot.camera
    both = " and ".join(f"{one.power.values[0, 0]:g}" for one in robot.traps)
    rows = [
        _row("medium, refractive index", "water, 1.33", "S", f"{robot.medium.refractive_index:g}"),
        _row("material of the robots", "IP-L resist", "S", f"index {sphere.refractive_index:g}",
             "its index is not published"),
        _row("trap wavelength", "", "U", f"{1e3 * trap.wavelength:g}", unit="nm"),
        _row("trap aperture NA", "", "U", f"{trap.numerical_aperture:g}"),
        _row("power of a trap", "", "U", f"{trap.power.values[0, 0]:g} (delivery), {both} (strategy B)", unit="mW"),
        _row("temperature", "", "U", f"{robot.medium.temperature:g}", unit="K"),
        _row("viscosity", "", "U", f"{1e3 * robot.medium.viscosity:g}", unit="mPa·s"),
    ]  # fmt: skip
    if camera is not None:
        rows += [
            _row("imaging, NA", "1.45, oil", "S", f"{camera.numerical_aperture:g}"),
            _row("illumination", "632.8", "S", f"{1e3 * camera.wavelength:g}", unit="nm"),
            _row("pixel", "0.065", "S", f"{camera.pixel_size:g}", unit="µm"),
        ]
    return tuple(rows)


def _robots(robot: Scene, pair: Scene, task: Scene) -> tuple[Comparison, ...]:
    body = robot.bodies[0]
    elements = [s for s in body.spheres if s.trapped]
    handles = [s for s in elements if "handle" in s.prim]
    span = max(abs(a.offset[1] - b.offset[1]) for a in handles for b in handles)
    per_robot = len(task.traps) // 2
    return (
        _row("trapped elements of a robot", "5", "I", str(len(elements)), "handle – arm – hub – arm – handle"),
        _row("diameter of a handle", "3.05", "I", f"{2.0 * handles[0].radius:g}", unit="µm"),
        _row("distance of the handles", "9.4 to 9.7", "I", f"{span:g}", unit="µm"),
        _row("traps per robot, delivery", "3", "I", str(per_robot), "two handles and the hub"),
        _row("robots and traps, delivery", "2 and 6", "I", f"2 and {len(task.traps)}"),
        _row("length of the pair, strategy A", "", "U",
             f"{abs(pair.bodies[0].spheres[0].offset[0] - pair.bodies[0].spheres[1].offset[0]):g}", unit="µm"),
    )  # fmt: skip


def _task(task: Scene) -> tuple[Comparison, ...]:
    goal, unit = task.goal, ContractConfig().scene_unit
    warning = next(b.warning_force for b in task.bodies if b.warning_force)
    assert goal is not None
    return (
        _row("scene unit", "15 to 35", "D", f"{unit:g}", "what the release calls 1", unit="µm"),
        _row("warning line, contact force", "10", "S", f"{warning:g}", unit="pN"),
        _row("warning line, robot–trap distance", "0.2 scene units", "S", f"{goal.distance_warning:g} µm",
             f"{goal.distance_warning / unit:g} scene units"),
        _row("fixed obstacles", "round pillars", "S", f"{sum('pillar' in o.prim for o in task.obstacles)} pillars"),
        _row("moving obstacles", "4 cubes", "S", f"{sum('cube' in o.prim for o in task.obstacles)} cubes"),
        _row("gravity and buoyancy", "neglected", "S", "on" if task.settings.gravity else "off", "an option"),
    )  # fmt: skip


def _haptics() -> tuple[Comparison, ...]:
    motion, force = PAPER_CHAIN.motion_filter, PAPER_CHAIN.force_filter
    assert motion is not None and force is not None
    law = RELEASE_LAW
    ours = f"K {law.stiffness:g}, δ {law.threshold:g}, A {law.inverse_square:g}, C {law.offset:g}, D {law.cutoff:g}"
    return (
        _row("eq. 1, the release's constants", "12000·d; 16.18/d² − 1568 from 0.08; 0 from 0.10", "S", ours,
             "paper mode, raw units over scene units"),
        _row("low-pass of the hand's motion α_m", "0.05", "S", f"{motion.alpha:g} at {motion.rate:g} Hz",
             "paper mode; ours filters nothing"),
        _row("low-pass of the force α_f", "0.05", "S", f"{force.alpha:g} at {force.rate:g} messages/s",
             f"paper mode; α = {RELEASE_ALPHA:g} at {RELEASE_RATE:g} Hz on each of two topics"),
        _row("G_hand", "0.0022 to 0.0030", "S", f"{RELEASE_GAIN:g} in paper mode", "N per raw unit; ours is in N/pN"),
        _row("virtual damping D", "0 as shipped", "S", f"{PAPER_CHAIN.distance_damping:g} in paper mode"),
        _row("damping of the device node", "1", "S", f"{PAPER_CHAIN.damping:g} in paper mode", unit="N·s/m"),
        _row("haptic devices", "two Geomagic Touch", "S", "Touch, Haply, Force Dimension, HID",
             "bindings tested on doubles: no device was available"),
    )  # fmt: skip


def _row(what: str, paper: str, grade: str, ours: str, remark: str = "", *, unit: str = "") -> Comparison:
    theirs = Value(text=paper) if paper else Value(text="not published")
    return Comparison(what=what, unit=unit, paper=theirs, grade=grade, ours=Value(text=ours), remark=remark)
