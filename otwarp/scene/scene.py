"""The whole of what a stage says, and its way in from a file."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from otwarp import shipped
from otwarp.scene.check.scene import check_scene
from otwarp.scene.description import Body, Camera, Flow, Goal, Medium, Obstacle, Settings, Trap
from otwarp.scene.finding import Finding
from otwarp.scene.track import ByValue


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene(ByValue):
    """Everything a stage says about the experiment. Made by `Scene.load` or `SceneBuilder`.

    Attributes:
        root: Path of the default prim.
        medium: The liquid.
        settings: How it is to be stepped.
        traps, bodies, obstacles: Those there are.
        flow: Background flow, or None.
        camera: The microscope, or None.
        goal: Where something is to be brought, or None.
        file, remarks, judged: Where it was read from, what is odd in the file itself, and whether its oddities were
            reported already, as of a part of another scene; not part of equality.
        overrides: Attributes of the file that have other values here, by path, as `Variations.scene` takes them: for
            whoever draws it; not part of equality.
    """

    file: Path | None = field(default=None, compare=False)
    root: str = "/World"
    medium: Medium = field(default_factory=Medium)
    settings: Settings = field(default_factory=Settings)
    traps: tuple[Trap, ...] = ()
    bodies: tuple[Body, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    flow: Flow | None = None
    camera: Camera | None = None
    goal: Goal | None = None
    remarks: tuple[Finding, ...] = field(default=(), compare=False)
    judged: bool = field(default=False, compare=False)
    overrides: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @classmethod
    def load(cls, file: str | Path, *, duration: float | None = None) -> Scene:
        """Read a USD stage.

        Args:
            file: Path of a `.usda`, `.usdc` or `.usd` file, or the name of a shipped scene: `cell_delivery`.
            duration: Length of the run [s] that the time samples must cover, instead of the authored one.

        Raises:
            InputError: Anything in the file that cannot be accepted, in one line.
        """
        from otwarp.scene.read.load import read_file

        return cls(**read_file(shipped.find("scenes", file), duration=duration))

    def check(self) -> None:
        """Hold it to what files are held to; a model does so before it is built.

        Raises:
            InputError: One line that names prim, attribute, value and what is allowed.
        """
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.compare}
        check_scene(str(self.file or "Scene"), **fields)

    def with_trap_speed(self, factor: float) -> Scene:
        """The same scene with its traps played `factor` times faster (above 0), and the run shortened to match."""
        traps = tuple(
            dataclasses.replace(
                t,
                position=dataclasses.replace(t.position, times=t.position.times / factor),
                power=dataclasses.replace(t.power, times=t.power.times / factor),
            )
            for t in self.traps
        )
        settings = dataclasses.replace(self.settings, duration=self.settings.duration / factor)
        return dataclasses.replace(self, traps=traps, settings=settings)
