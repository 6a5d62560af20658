"""The microscope: images of transparent robots and cells, computed from waves, as a camera records them.

Lengths are µm; light travels along +z, x points right and y up in an image, whose row 0 is the lowest. In comes a
`Specimen` of spheres and capsules and a `Microscope`, out come intensities that are 1 where light is unhindered. Open
`rendering` first; floor plan, each file importing only from those above it:

    microscope, sensor         optics and light; photoelectrons and grey levels
    specimen, grid, fourier    solids; where light is computed and looked at; arrays that FFTs and kernels share
    sampling, illumination     how many points of the condenser an image needs, and how much margin; these points,
                               whose waves do not interfere
    slices, slices_together    solids cut into slices, and light led through them: one specimen, as a CPU likes it, or
                               many at once, which a GPU needs
    propagation                light through any solids, slice by slice
    harmonics, scattering      exact light of several spheres: vector spherical waves, and what passes between spheres
    pupil, exact, image        the objective; spectra of exact light; intensities in focal planes
    rendering                  all of these together: `expose` once, look in many planes; `render_many` poses at once
    frame                      which solids of a scene an image is computed of
    view, replay, moment       a scene's camera and bodies; how they move in an exposure; where they are at a time
    pictures                   what the camera records of it
    stack                      images on disk
    kernels                    what runs between Fourier transforms
    calibration                pixels, planes and depths in µm, from images of targets
    datasets                   images by the thousand, with exact labels
    networks                   what a network says of an image
    tracking                   robots followed through images by a filter that knows how they move
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.vision.microscope import Microscope as Microscope
    from otwarp.vision.moment import moments as moments
    from otwarp.vision.pictures import picture as picture
    from otwarp.vision.rendering import Rendering as Rendering
    from otwarp.vision.rendering import expose as expose
    from otwarp.vision.rendering import render as render
    from otwarp.vision.rendering import render_many as render_many
    from otwarp.vision.sensor import Sensor as Sensor
    from otwarp.vision.specimen import Specimen as Specimen

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "microscope": ("Microscope",),
        "moment": ("moments",),
        "pictures": ("picture",),
        "rendering": ("Rendering", "expose", "render", "render_many"),
        "sensor": ("Sensor",),
        "specimen": ("Specimen",),
    },
)
