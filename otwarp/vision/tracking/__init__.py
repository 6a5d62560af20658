"""Robots followed through images: where they are in a frame, how they lie, and a filter that knows how they move.

In come frames or estimates of networks, out come poses with covariances at any time. Lengths are µm, angles rad. Open
`tracker` first; floor plan, each file importing only from those above it:

    rotations                  small turns
    shape                      what of a body can be seen: centre, long axis, turns after which it looks the same
    measurement                one look at a body, and its innovation
    commands                   what traps are told in the course of time
    pushing                    forces that the simulation does not know, followed with the pose
    motion, mobile             the exact step of linear motion; a body as the simulation moves it, expanded about a pose
    belief                     one hypothesis: led on through time, corrected
    tracker                    several of them; late, missing and wrong measurements; prediction
    consistency                whether covariances are right: NEES and NIS
    finding                    bodies in a frame, and pieces of it
    templates, matching        rendered images of a body at many poses; poses from images by least squares
    recorded, source           frames of a recorded run, tracked; what looks at them: templates or a network
    facing, looking            which way bodies in a frame point; what a network says of each
    results, figure            errors beside the truth, `track.nc`; the picture
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.vision.tracking.commands import Commands as Commands
    from otwarp.vision.tracking.finding import Found as Found
    from otwarp.vision.tracking.finding import crop as crop
    from otwarp.vision.tracking.finding import find as find
    from otwarp.vision.tracking.looking import sightings as sightings
    from otwarp.vision.tracking.matching import Matcher as Matcher
    from otwarp.vision.tracking.measurement import Measurement as Measurement
    from otwarp.vision.tracking.mobile import MobileBody as MobileBody
    from otwarp.vision.tracking.recorded import track_run as track_run
    from otwarp.vision.tracking.shape import Shape as Shape
    from otwarp.vision.tracking.templates import Templates as Templates
    from otwarp.vision.tracking.tracker import Pose as Pose
    from otwarp.vision.tracking.tracker import Tracker as Tracker

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "commands": ("Commands",),
        "finding": ("Found", "crop", "find"),
        "looking": ("sightings",),
        "matching": ("Matcher",),
        "measurement": ("Measurement",),
        "mobile": ("MobileBody",),
        "recorded": ("track_run",),
        "shape": ("Shape",),
        "templates": ("Templates",),
        "tracker": ("Pose", "Tracker"),
    },
)
