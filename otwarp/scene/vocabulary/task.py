"""The microscope and the task."""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import Attribute, Schema

CAMERA = Schema(
    name="OtCameraAPI",
    applies_to="Camera",
    doc="The microscope behind a camera.",
    attributes=(
        Attribute(
            name="ot:camera:numericalAperture",
            field="numerical_aperture",
            default=1.45,
            low=0.0,
            high=3.0,
            low_open=True,
            doc="Numerical aperture of the imaging objective.",
        ),
        Attribute(
            name="ot:camera:condenserAperture",
            field="condenser_aperture",
            default=0.6,
            low=0.0,
            high=3.0,
            doc="Numerical aperture of the condenser.",
        ),
        Attribute(
            name="ot:camera:wavelength",
            field="wavelength",
            dimension="length",
            default=632.8e-9,
            low=1e-7,
            high=1e-5,
            doc="Illumination wavelength.",
        ),
        Attribute(
            name="ot:camera:pixelSize",
            field="pixel_size",
            dimension="length",
            default=65e-9,
            low=0.0,
            high=1e-4,
            low_open=True,
            doc="Pixel size in the object plane.",
        ),
        Attribute(
            name="ot:camera:focus",
            field="focus",
            dimension="length",
            default=0.0,
            low=-1e-2,
            high=1e-2,
            doc="Height of the focal plane.",
        ),
        Attribute(
            name="ot:camera:noise",
            field="noise",
            default=0.01,
            low=0.0,
            high=1.0,
            doc="Sensor noise, standard deviation relative to full scale.",
        ),
    ),
)

GOAL = Schema(
    name="OtGoalAPI",
    applies_to="Xform or Sphere at the goal",
    doc="The task: bring the cell here.",
    attributes=(
        Attribute(name="ot:goal:cell", field="cell", usd_type="rel", doc="The cell to deliver (required)."),
        Attribute(name="ot:goal:robots", field="robots", usd_type="rel", doc="The robots that carry it (required)."),
        Attribute(
            name="ot:goal:tolerance",
            field="tolerance",
            dimension="length",
            default=1e-6,
            low=0.0,
            low_open=True,
            doc="Delivered when the cell is this close.",
        ),
        Attribute(
            name="ot:goal:lostDistance",
            field="lost_distance",
            dimension="length",
            default=5e-6,
            low=0.0,
            low_open=True,
            doc="A robot is lost when one of its traps is this far from the sphere it holds.",
        ),
        Attribute(
            name="ot:goal:cellLostDistance",
            field="cell_lost_distance",
            dimension="length",
            default=5e-6,
            low=0.0,
            low_open=True,
            doc="The cell is lost when this far from the midpoint of its robots.",
        ),
        Attribute(
            name="ot:goal:distanceWarning",
            field="distance_warning",
            dimension="length",
            default=2e-6,
            low=0.0,
            low_open=True,
            doc="Warning line of the robot–trap distance.",
        ),
    ),
)
