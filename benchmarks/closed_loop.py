"""A twin that is fed by images: how long light takes to a state, and what late images leave of the truth and a force.

Errors and felt forces are those of a virtual clock, the same on every machine, so that a CPU's page alone has them.
Latencies are measured in real time, by the processes of a session, with images from memory at 100 a second: rendering
is the laboratory's and has its own row.
The small network needs torch; it is trained here, on the robot that it then follows.
"""

from __future__ import annotations

import importlib.util
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import Section, command
from benchmarks.teleop import FORCE_GAIN, RADIUS, RATE, SPEED, STIFFNESS, bead_in_trap, stokes_drag
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.perception.assemble import SeeingOptions, closed_loop, estimator_of, see
from otwarp.perception.camera import Region
from otwarp.perception.followed import LostRule
from otwarp.perception.latency import STAGES
from otwarp.perception.looker import DirectLooker
from otwarp.perception.photographer import Photographer
from otwarp.perception.plant import Plant, PlantOptions, plant_scene
from otwarp.perception.process import ProcessLooker
from otwarp.perception.simulated import SimulatedCamera
from otwarp.scene import Camera, Scene
from otwarp.teleop.operators import HandPlan, LocalScene, plan_hands
from otwarp.teleop.operators.servo import LinkedClock, VirtualServo
from otwarp.teleop.session import Session, SessionOptions
from otwarp.teleop.session.live import LiveLoop
from otwarp.vision.tracking.pushing import PushLaw

CAMERA = Camera(
    prim="/World/top", pixel_size=0.13, numerical_aperture=1.0, condenser_aperture=0.3, focus=5.0, frame=(40.0, 20.0)
)
"""Of the bead."""

PIECE = 32
LATE = ((0.0, 100.0), (0.01, 100.0), (0.03, 100.0), (0.1, 100.0), (0.3, 100.0), (0.03, 10.0))
"""Delay from light to measurement [s], and frames a second."""

THICKER = 10.0
"""Viscosity of the plant over the twin's, where there is a drag of which only images tell."""

BLOCK = 0.3
"""Seconds whose means count as independent."""

SETTLED, SECONDS = 0.8, 3.8
"""When what counts begins, and ends [s]."""

SCENE, ROBOT = "scenes/teleop_small.usda", "/World/Robots/left"
REAL = 10.0
"""Length of a session in real time [s]."""

SPEC = """
scene = "{scene}"
body = "{robot}"
poses = 3
seed = 5

[image]
width = 96

[tilts]
classes = {{ from = -10, to = 10, count = 11 }}

[depth]
from = -1.2
to = 1.2
count = 12
scattered = true

[render]
rings = 1
margin = 2
thickness = 0.5

[domain]
yaw = {{ from = 80, to = 100 }}
x = {{ from = -0.3, to = 0.3 }}
y = {{ from = -0.3, to = 0.3 }}

[splits]
random = [26, 5, 5]
"""


def seen_bead() -> Scene:
    """The bead of `benchmarks.teleop` under a camera."""
    return replace(bead_in_trap(brownian=True), camera=CAMERA)


def followed(delay: float, rate: float, viscosity: float, push: PushLaw | None) -> tuple[float, float, float]:
    """A hand that moves a bead's trap evenly while its twin is fed by images.

    Args:
        delay: From light to measurement [s].
        rate: Frames a second.
        viscosity: Of the plant over the twin's.
        push: As of `LostRule`.

    Returns:
        Root mean square distance of twin and plant across the motion [µm], the mean force felt and its standard error
        by the scatter of the means of `BLOCK` seconds [pN].
    """
    scene, clock = seen_bead(), LinkedClock()
    options = SeeingOptions(piece=PIECE, device="cpu")
    plant = Plant(plant_scene(scene, PlantOptions(seed=5, viscosity=viscosity)), seed=5, device="cpu")
    camera = SimulatedCamera(plant, Photographer(scene, device="cpu", seed=2), rate=rate)
    seeing = see(scene, options)
    looker = DirectLooker(camera, estimator_of(scene, seeing), delay=delay)
    rule = LostRule(after=2.0, uncertain=10.0, push=push)
    perception = closed_loop(scene, seeing.pieces, looker, rule=rule, clock=clock)
    line = f"virtual:line,from=0/0/0,to={0.01 * SPEED * 4.0}/0/0,duration=4,mass=0"
    servos: list[VirtualServo] = []

    def servo(plans: Sequence[HandPlan], local: LocalScene) -> VirtualServo:
        servos.append(VirtualServo(clock, plans, local, len(scene.traps)))
        return servos[-1]

    plans = plan_hands(scene, {"right": line}, force_gain=FORCE_GAIN)
    loop = LiveLoop(scene, plans, make_servo=servo, perception=perception, clock=clock, rate=RATE, device="cpu")
    off = []
    try:
        loop.start(arm=True)
        for n in range(1, int(SECONDS * RATE)):
            frame = loop.tick().frame
            if n > SETTLED * RATE:
                off.append(frame.position[0, 0, 1] - plant.poses()[0][0, 1])
            clock.sleep_until(n / RATE)
    finally:
        loop.close()
    felt = [-now.force[0] / FORCE_GAIN for now in servos[0].forces[0] if SETTLED < now.time < SECONDS - 0.05]
    count = round((SECONDS - SETTLED) / BLOCK)
    means = np.array([np.mean(part) for part in np.array_split(np.array(felt), count)])
    return float(np.sqrt(np.mean(np.square(off)))), float(means.mean()), float(means.std(ddof=1) / np.sqrt(count))


def errors() -> tuple[Table, dict[str, Any]]:
    """Late images, with pushes followed and without."""
    drag, rows, data = stokes_drag(seen_bead()), [], {}
    for delay, rate in LATE:
        row, found = [f"{1e3 * delay:g}", f"{rate:g}"], {}
        for name, push in (("with", PushLaw()), ("without", None)):
            off, known, error = followed(delay, rate, 1.0, push)
            _, more, other = followed(delay, rate, THICKER, push)
            whole = (THICKER - 1.0) * drag
            share, scatter = (more - known) / whole, float(np.hypot(error, other)) / whole
            row += [f"{1e3 * off:.0f}", f"{known / drag:.1f} ± {error / drag:.1f}", f"{share:.2f} ± {scatter:.2f}"]
            found[name] = {"off": off, "known": known / drag, "unknown": share}
        rows.append(tuple(row))
        data[f"{delay:g}, {rate:g}"] = found
    head = ("late by [ms]", "frames/s", "off [nm]", "known drag", "unknown drag", "off, no push [nm]",
            "known drag, no push", "unknown drag, no push")  # fmt: skip
    thermal = 1e3 * np.sqrt(4.114e-3 / STIFFNESS)
    note = (
        f"A bead of {RADIUS:g} µm that a hand moves at {SPEED:g} µm/s; in its trap it scatters by {thermal:.0f} nm. "
        "*Off*: root mean square distance of twin and plant across the motion. *Known drag*: mean force felt over the "
        f"drag {drag:.3f} pN; *unknown drag*: what is felt more, over what there is more, where the plant's liquid is "
        f"{THICKER:g} times as viscous as the twin's. Of {SECONDS - SETTLED:g} s each, ± standard errors by the "
        f"scatter of means of {BLOCK:g} s. *No push*: trackers that know of no other forces than the twin's."
    )
    title = "What late images leave of the truth, and of a force"
    return Table(title=title, head=head, rows=rows, note=note), data


def images(scene: Scene, folder: Path, device: str, count: int = 25) -> tuple[Path, float]:
    """Whole frames with the robot at rest in its traps, and what rendering one piece takes [s]."""
    plant, photographer = Plant(scene, seed=3, device="cpu"), Photographer(scene, device=device)
    width, height = photographer.size
    camera = scene.camera
    assert camera is not None
    x, y, _ = next(b for b in scene.bodies if b.name == ROBOT).position
    column, row = (round(v / camera.pixel_size) + n // 2 for v, n in ((x + 1.9, width), (y, height)))
    region = Region(column - 64, row - 64, 128, 128)
    frames, took = [], []
    for n in range(count):
        plant.advance(0.02 * (n + 1))
        place, turn = plant.poses()
        begun = time.perf_counter()
        (piece,) = photographer.pieces(place[None], turn[None], [region], n)
        took.append(time.perf_counter() - begun)
        frame = np.full((height, width), 89, dtype=np.uint8)
        low, left = max(region.low, 0), max(region.left, 0)
        part = piece.levels[low - region.low :, left - region.left :]
        frame[low : low + len(part), left : left + part.shape[1]] = part[: height - low, : width - left]
        frames.append(frame)
    np.save(folder / "frames.npy", np.stack(frames))
    return folder / "frames.npy", float(np.median(took))


def network(folder: Path, device: str) -> Path:
    """The small network, trained on the robot for a minute or two."""
    from otwarp.vision.datasets import labels_of, load_spec, make_dataset
    from otwarp.vision.networks.settings import Settings
    from otwarp.vision.networks.train import train

    file = folder / "robot.toml"
    file.write_text(SPEC.format(scene=Path(SCENE).resolve(), robot=ROBOT), encoding="utf-8")
    make_dataset(labels_of(load_spec(file)), folder / "images", processes=1, device=device)
    settings = Settings(net="small", heads="pose", size=96, epochs=25, batch=16, lr=3e-3, seed=1)
    train(folder / "images", folder / "net", settings, device=device)
    return folder / "net"


def session(scene: Scene, frames: Path, eyes: str, seconds: float, looks: str, twin: str) -> dict[str, Any]:
    """A session with images from memory at 100 a second; its summary.

    Args:
        scene: Of the twin.
        frames: The images.
        eyes: `templates`, or the network that looks.
        seconds: How long it takes.
        looks, twin: Devices of the eyes and of the twin.
    """
    options = SeeingOptions(networks=(eyes,), follow=(ROBOT,), device=looks)
    looker = ProcessLooker(scene, options, bodies=1, camera=f"files:{frames},rate=100,loop=1")
    looker.open()
    perception = closed_loop(scene, looker.pieces, looker, seeing=options)
    asked = SessionOptions(devices={"left": "virtual:hold,at=0/0/0"}, arm=True, duration=seconds, device=twin)
    quiet: Callable[[str], None] = lambda line: None  # noqa: E731
    report = Session(scene, asked, perception=perception, say=quiet).run()
    return report["perception"] | {"servo": report["servo"]}


def latencies(device: str, seconds: float) -> tuple[Table, dict[str, Any]]:
    """Stages from light to state, with templates and with the small network; of a GPU with the twin on either side."""
    scene, rows, data = Scene.load(SCENE), {}, {}
    on_gpu = not pick_device(device).is_cpu
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        frames, rendering = images(scene, folder, device)
        eyes = {"templates": ("templates", "cpu")}
        if importlib.util.find_spec("torch") is not None:
            net = str(network(folder, device))
            eyes["small network"] = (net, "cpu")
            if on_gpu:
                eyes["small network, twin on the GPU"] = (net, device)
        for label, (path, twin) in eyes.items():
            found = session(scene, frames, path, seconds, device, twin)
            data[label] = found
            for stage, took in found["latency"].items():
                rows.setdefault(stage, {})[label] = f"{1e3 * took['p50']:.2f} / {1e3 * took['p99']:.2f}"
    shown = [*(stage for stage in STAGES if stage in rows and stage != "rendering"), "total"]
    table_rows = [(stage, *(rows[stage].get(label, "") for label in eyes)) for stage in shown]
    rates = {k: f"{d['frames'] / seconds:.0f}" for k, d in data.items()}
    table_rows.append(("frames/s", *(rates[label] for label in eyes)))
    taken = {k: f"{b['accepted']} of {b['accepted'] + b['refused']}" for k, d in data.items() for b in d["bodies"]}
    table_rows.append(("measurements taken", *(taken[label] for label in eyes)))
    note = (
        f"p50 / p99 [ms] of {seconds:g} s, one robot of {SCENE}, pieces of 96 × 96 pixels, images from memory at "
        "100/s; *estimate* is the network or the templates. "
        f"Rendering a piece, which is the laboratory's, takes {1e3 * rendering:.0f} ms (median). The servo adds up to "
        "a cycle of 1 ms until the force is sent; a device adds its own."
    )
    if len(eyes) == 1:
        note += " The small network needs torch, which was not there."
    title = f"From light to state, {'with a GPU' if on_gpu else 'on a CPU'}"
    return Table(title=title, head=("stage", *eyes), rows=table_rows, note=note), data | {"rendering": rendering}


def measure(device: str = "cpu", *, rounds: int = 1, seconds: float = REAL) -> Section:
    """Latencies, and on a CPU errors; seeds are fixed, so that `rounds` changes nothing.

    Args:
        device: cpu or cuda:0.
        rounds: Ignored.
        seconds: Length of a session in real time.
    """
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    machine = Machine.look(place)
    late, found = latencies(device, seconds)
    tables, data = [late], {"latency": found}
    if place.is_cpu:
        wrong, data["errors"] = errors()
        tables.append(wrong)
    asked = "" if seconds == REAL else f"--seconds {seconds:g}"
    return Section(name="closed_loop", kind=kind, machine=machine, tables=tables, data=data, asked=asked)


if __name__ == "__main__":
    command(
        measure,
        "Latency of a closed loop, and what late images leave of the truth.",
        rounds=1,
        seconds={"type": float, "default": REAL, "help": f"length of a session in real time [s] (default: {REAL:g})"},
    )
