"""Obstacles: what they are besides things to run into."""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import Attribute, Schema

OBSTACLE = Schema(
    name="OtObstacleAPI",
    of="obstacles",
    applies_to="an obstacle (with PhysicsCollisionAPI)",
    doc="What an obstacle does besides being in the way; one without it is rigid and lets the liquid pass.",
    attributes=(
        Attribute(
            "ot:obstacle:hydrodynamic",
            False,
            doc="Whether the liquid sticks to it, so that it hinders the motion and diffusion of spheres nearby; for a"
            " Plane at rest only.",
        ),
    ),
)
