"""Renders a moment of a run in ParaView, from the glTF file of `otwarp export`.

otwarp export out/cell_delivery -o run.glb
pvpython docs/recipes/in_paraview.py run.glb 3.9 still.png
"""

from __future__ import annotations

import sys

from paraview.simple import (  # type: ignore[import-not-found]
    ColorBy,
    GetActiveViewOrCreate,
    OpenDataFile,
    Render,
    SaveScreenshot,
    Show,
    UpdatePipeline,
)

FRAMES_PER_SECOND = 30


def main() -> None:
    """What the command line says."""
    file, time, picture = sys.argv[1], float(sys.argv[2]), sys.argv[3]
    run = OpenDataFile(file)
    # without a rate and an animation that is switched on ParaView shows the start alone
    run.Framerate = FRAMES_PER_SECOND
    run.UpdatePipelineInformation()
    names = run.GetProperty("AnimationInfo")
    run.AnimationStatus = [item for name in names[::2] for item in (name, "1")]
    run.UpdatePipelineInformation()
    UpdatePipeline(time=time, proxy=run)
    view = GetActiveViewOrCreate("RenderView")
    view.ViewTime, view.ViewSize = time, [960, 540]
    shown = Show(run, view)
    # each part keeps its colour and opacity as one value; ParaView must not look it up in a colour map
    ColorBy(shown, ("FIELD", "BaseColorMultiplier"))
    shown.MapScalars = 0
    Render(view)  # which moves a camera that nobody has placed
    low, high = run.GetDataInformation().GetBounds()[::2], run.GetDataInformation().GetBounds()[1::2]
    middle = [0.5 * (a + b) for a, b in zip(low, high, strict=True)]
    far = max(b - a for a, b in zip(low, high, strict=True))
    view.CameraViewUp, view.CameraFocalPoint = [0.0, 1.0, 0.0], middle
    view.CameraPosition = [middle[0] - 0.1 * far, middle[1] + 0.65 * far, middle[2] + 0.75 * far]
    SaveScreenshot(picture, view)


if __name__ == "__main__":
    main()
