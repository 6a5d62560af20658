"""Records one world of a run as USD: a small root layer over a trajectory and the scene.

While the run goes on, frames go into short crate files (`trajectory/frames.000000.usdc`, …) that the root layer plays
one after the other as USD value clips. The last of them is replaced as a whole whenever frames are flushed, so that
whatever happens to the program, all files are whole and the run opens up to the last flushed frame. When the run is
over, the samples move into one `trajectory.usdc` that the root layer sublayers above the scene, and the clips go; a
run whose samples would take more than `LARGEST_MERGE` in memory stays as clips.

Measured with 26 moving prims (two samples each per frame) on 2 shared cores: one growing crate file that is saved
after each frame takes 2.0 ms per frame at first and 13 ms after 1500 frames, by when it has grown to 482 MB, because
each save rewrites the tables of all samples; and a save in place overwrites the old table of contents before the
header points to the new one (seen in the trace of system calls), so that a kill in between loses everything. Clips of
32 frames, flushed after each, take 4.6 ms per frame at any length of the run (3 MB for 1500 frames, peak memory
constant), 2 ms of which is what it costs to create and rename any file on that system; clips of 128 frames 7.6 ms.

A frame is flushed at once as long as flushing takes no more than a quarter of the wall time. When frames come faster
than that (every 10 ms or so here), what is not yet flushed is never older than four flushes; cell_delivery then costs
0.9 ms per frame, 1.8 ms with arrows, and ten thousand instances 7 ms.
"""

from __future__ import annotations

import os
import re
import shutil
import time as clock
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from pxr import Gf, Sdf, Tf, Vt

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.scene.read.diagnostics import usd_reason
from otwarp.scene.read.source import Source
from otwarp.scene.read.variations import Variations
from otwarp.scene.recording.appearance import add_layer, changed_values, missing_appearance
from otwarp.scene.recording.force_arrows import ARROW_SCALE, ForceArrows
from otwarp.scene.recording.prims import BodyPoses, Instances, SampleSource, Traps, attribute
from otwarp.scene.scene import Scene

if TYPE_CHECKING:
    from otwarp.simulation.frame import Frame

CLIP_FRAMES = 32
"""Frames per clip: what is rewritten with each flush."""

FLUSH_SHARE = 0.25
"""Largest share of the wall time that flushing may take before several frames are flushed together."""

LARGEST_MERGE = 256 * 2**20
"""Memory [bytes] that merging the clips into one trajectory may take."""

_END_WIDTH = 24
_SKIPPED = {"subLayers", "subLayerOffsets", "startTimeCode", "endTimeCode", "timeCodesPerSecond", "framesPerSecond"}


class UsdRecording:
    """Writes `run.usda`, `trajectory.usdc` and, during the run, the clips in `trajectory/`.

    Time code = simulated seconds × frames per second; what the scene itself animates (obstacles) plays along.

    Args:
        scene: What is being run; it was loaded from a file. Its `overrides` go into the trajectory.
        frames_per_second: Frames per simulated second.
        time_step: Time step [s]: a frame that is off its time code by no more than half a step is put on it.
        world: Which world is written.
        held: Per trap the body and the sphere it holds, -1 for none.
        forces: Whether force arrows are written.
        arrow_scale: Length of a force arrow [µm/pN].

    Raises:
        InputError: The scene has no file, or the file no longer opens.
        OSError: From its methods: the disk is full, or the folder has gone.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        frames_per_second: float,
        held: Sequence[tuple[int, int]],
        time_step: float = 0.0,
        world: int = 0,
        forces: bool = False,
        arrow_scale: float = ARROW_SCALE,
    ):
        if scene.file is None:
            raise InputError(
                "scene.file = None: a USD recording sublayers the scene; allowed: a scene loaded from a file"
            )
        self._file, self._rate, self._world = scene.file.resolve(), frames_per_second, world
        stage = Variations(scene.file).varied(scene.overrides)
        self._source = source = Source(stage, str(scene.file))
        sources: list[SampleSource] = [BodyPoses(source, scene), Traps(source, scene), Instances(source, scene)]
        if forces:
            sources.append(ForceArrows(source, scene, held, arrow_scale))
        self._sources = sources
        self._sampled = [a for s in sources for a in s.attributes]
        self._frame_size = sum(a.size for a in self._sampled)
        self._snap = max(1e-6, 0.5001 * time_step * frames_per_second)
        self._root = stage.GetDefaultPrim().GetPath()
        self._changed = changed_values(stage)
        self._appearance, self._camera = missing_appearance(stage)
        self._offset = -source.start * frames_per_second / source.rate
        self._clips: list[float] = []
        self._clip: Sdf.Layer | None = None
        self._filled = self._frames = 0
        self._codes = (0.0, 0.0)
        self._dirty = False
        self._flushed_at, self._flush_cost = -1e9, 0.0
        self._end: tuple[int, int] | None = None

    def begin(self, folder: Path) -> None:
        """Write the layers that do not change; `folder` exists and holds no earlier run."""
        self._folder, self._clip_folder = folder, folder / "trajectory"
        self._clip_folder.mkdir()
        manifest = self._layer()
        self._declare(manifest)
        _export(manifest, self._clip_folder / "manifest.usdc")
        _export(self._still(), folder / "trajectory.usdc")

    def abandon(self) -> None:
        """Let go of the files, as they are."""
        self._clip = None
        if self._end is not None:
            os.close(self._end[0])
            self._end = None

    def write(self, frame: Frame) -> None:
        """Take one frame; frames come in order of time."""
        code = frame.time * self._rate
        code = float(round(code)) if abs(code - round(code)) <= self._snap else code
        values = (value for source in self._sources for value in source.samples(frame, self._world))
        samples = [(sampled.path, value) for sampled, value in zip(self._sampled, values, strict=True)]
        if self._clip is None or self._filled == CLIP_FRAMES:
            if self._clip is not None:
                # the first frame of the next clip ends this one: nothing is interpolated across clips
                self._put(code, samples)
                _export(self._clip, self._clip_path(len(self._clips) - 1))
            self._clip, self._filled = self._layer(), 0
            self._declare(self._clip)
            self._clips.append(code)
        self._put(code, samples)
        self._codes = (self._clips[0], code)
        self._filled, self._frames, self._dirty = self._filled + 1, self._frames + 1, True
        if self._filled == 1 or clock.perf_counter() - self._flushed_at >= self._flush_cost / FLUSH_SHARE:
            self.flush()

    def flush(self) -> None:
        """Bring every frame so far to disk."""
        if not self._dirty or self._clip is None:
            return
        began = clock.perf_counter()
        _export(self._clip, self._clip_path(len(self._clips) - 1))
        if self._filled == 1 or self._end is None:
            self._write_root(clips=True)
        else:
            os.pwrite(self._end[0], _padded(self._codes[1]), self._end[1])
        self._dirty = False
        self._flushed_at = clock.perf_counter()
        self._flush_cost = self._flushed_at - began

    def close(self) -> None:
        """Flush, and merge the clips into one trajectory unless that would take too much memory."""
        if self._clip is None:
            return
        try:
            with _on_disk(self._folder):
                self._finish()
        finally:
            self.abandon()

    def _finish(self) -> None:
        self.flush()
        if self._frames * self._frame_size <= LARGEST_MERGE:
            merged = self._still()
            self._declare(merged)
            for index in range(len(self._clips)):
                self._merge(merged, Sdf.Layer.OpenAsAnonymous(str(self._clip_path(index))))
            _export(merged, self._folder / "trajectory.usdc")
            self._write_root(clips=False)
            shutil.rmtree(self._clip_folder)

    def _merge(self, merged: Sdf.Layer, clip: Sdf.Layer) -> None:
        with Sdf.ChangeBlock():
            for sampled in self._sampled:
                for code in clip.ListTimeSamplesForPath(sampled.path):
                    merged.SetTimeSample(sampled.path, code, clip.QueryTimeSample(sampled.path, code))

    def _put(self, code: float, samples: list) -> None:
        assert self._clip is not None
        with Sdf.ChangeBlock():
            for path, value in samples:
                self._clip.SetTimeSample(path, code, value)

    def _layer(self) -> Sdf.Layer:
        layer = Sdf.Layer.CreateAnonymous(".usdc")
        layer.defaultPrim = self._root.name
        layer.timeCodesPerSecond = layer.framesPerSecond = self._rate
        for key in ("metersPerUnit", "kilogramsPerUnit", "upAxis"):
            if self._source.stage.HasAuthoredMetadata(key):
                layer.pseudoRoot.SetInfo(key, self._source.stage.GetMetadata(key))
        return layer

    def _declare(self, layer: Sdf.Layer) -> None:
        with Sdf.ChangeBlock():
            for sampled in self._sampled:
                attribute(layer, sampled.path, sampled.type)

    def _still(self) -> Sdf.Layer:
        """The trajectory without its samples."""
        layer = self._layer()
        add_layer(layer, self._changed)
        add_layer(layer, self._appearance)
        for source in self._sources:
            source.author(layer)
        self._declare(layer)
        return layer

    def _clip_path(self, index: int) -> Path:
        return self._clip_folder / f"frames.{index:06d}.usdc"

    def _write_root(self, *, clips: bool) -> None:
        layer = Sdf.Layer.CreateAnonymous(".usda")
        scene = self._source.stage.GetRootLayer()
        for key in scene.pseudoRoot.ListInfoKeys():
            if key not in _SKIPPED:
                layer.pseudoRoot.SetInfo(key, scene.pseudoRoot.GetInfo(key))
        layer.defaultPrim = self._root.name
        layer.timeCodesPerSecond = layer.framesPerSecond = self._rate
        layer.startTimeCode, layer.endTimeCode = self._codes
        # the convention of Omniverse for the camera through which a stage is first shown
        data = layer.customLayerData
        layer.customLayerData = {"cameraSettings": {"boundCamera": str(self._camera)}} | data
        layer.subLayerPaths = ["./trajectory.usdc", _asset(self._file, self._folder)]
        layer.subLayerOffsets[1] = Sdf.LayerOffset(self._offset)
        if clips:
            active = [Gf.Vec2d(code, index) for index, code in enumerate(self._clips)]
            paths = [Sdf.AssetPath(f"./trajectory/{self._clip_path(n).name}") for n in range(len(active))]
            over = Sdf.CreatePrimInLayer(layer, self._root)
            run = {"assetPaths": Sdf.AssetPathArray(paths), "active": Vt.Vec2dArray(active)}
            run |= {"manifestAssetPath": Sdf.AssetPath("./trajectory/manifest.usdc"), "primPath": str(self._root)}
            over.SetInfo("clips", {"run": run})
        self._replace_root(layer.ExportToString().encode())

    def _replace_root(self, text: bytes) -> None:
        """Write the root layer; its end time code gets a field of fixed width, to be updated in place."""
        found = re.search(rb"^    endTimeCode = (\S+)$", text, re.MULTILINE)
        assert found is not None
        text = text[: found.start(1)] + _padded(self._codes[1]) + text[found.end(1) :]
        path = self._folder / "run.usda"
        with written(path) as part:
            part.write_bytes(text)
        if self._end is not None:
            os.close(self._end[0])
        self._end = (os.open(path, os.O_WRONLY), found.start(1))


def _padded(code: float) -> bytes:
    return f"{code:.15g}".rjust(_END_WIDTH).encode()


def _asset(file: Path, folder: Path) -> str:
    """Path of the scene as the root layer names it: relative, unless the two are on different drives."""
    try:
        relative = Path(os.path.relpath(file, folder.resolve())).as_posix()
    except ValueError:
        return file.as_posix()
    return relative if relative.startswith(".") else f"./{relative}"


def _export(layer: Sdf.Layer, path: Path) -> None:
    """Write a layer beside its destination and put it there as a whole."""
    if not path.parent.is_dir():  # USD would make it again, without the rest of the run
        raise OSError(f"{path.parent}: was removed during the run")
    with _on_disk(path), written(path) as part:
        if not layer.Export(str(part)):
            raise OSError(f"{path}: could not be written")


@contextmanager
def _on_disk(path: Path) -> Iterator[None]:
    try:
        yield
    except Tf.ErrorException as error:
        raise OSError(f"{path}: could not be written ({usd_reason(error)})") from None
