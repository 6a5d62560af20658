from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import otwarp as ot
from otwarp.scene.transforms import rotate
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.protocol import Drawing
from otwarp.teleop.page.scene_view import MOST_CONTACTS, contact_arrows, instanced, trap_arrows
from tests.teleop.page.frames import page_frame
from tests.teleop.page.test_browser import SCENE

HEAD = 0.1
TURN = np.array([0.0, 0.0, np.sin(0.4), np.cos(0.4)], dtype=np.float32)


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    return compose(ot.Scene.load(SCENE))


def test_a_traps_arrow_stands_on_the_sphere_it_holds(drawing: Drawing):
    force = np.zeros((6, 3))
    force[1] = (0.0, 3.0, 4.0)
    place = np.array([[1.0, 2.0, 3.0], [0, 0, 0], [0, 0, 0]])
    frame = page_frame(np.zeros((6, 3)), 3, trap_force=force, position=place, orientation=np.tile(TURN, (3, 1)))
    (arrow,) = trap_arrows(drawing, frame, 2.0, HEAD)
    hub = drawing.traps[1]
    centre = place[0] + rotate(TURN, np.array(hub.offset))
    assert arrow[0] == pytest.approx(centre + hub.radius * np.array([0.0, 0.6, 0.8]), abs=1e-5)
    assert arrow[1] - arrow[0] == pytest.approx([0.0, 6.0, 8.0], abs=1e-5)


def test_arrows_that_cannot_be_seen_or_are_none_are_left_out(drawing: Drawing):
    force = np.array([[np.nan, 0, 0], [1e-6, 0, 0], [0.001, 0, 0], [np.inf, 0, 0], [0, 0, 0], [5.0, 0, 0]])
    frame = page_frame(np.zeros((6, 3)), 3, trap_force=force)
    assert len(trap_arrows(drawing, frame, 1.0, HEAD)) == 1
    assert len(contact_arrows(drawing, page_frame(bodies=3), 1.0, HEAD)) == 0
    assert trap_arrows(dataclasses.replace(drawing, traps=()), page_frame(), 1.0, HEAD).shape == (0, 2, 3)


def test_only_the_largest_contacts_of_a_crowd_have_arrows():
    many = 4 * MOST_CONTACTS
    force = np.zeros((many, 3))
    force[:, 0] = np.arange(1, many + 1)
    scene = compose(ot.Scene.load(SCENE))
    crowd = dataclasses.replace(scene, touching=(np.zeros((many, 3)), np.ones(many)))
    arrows = contact_arrows(crowd, page_frame(bodies=many, contact_force=force), 1.0, HEAD)
    length = np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1)
    assert len(arrows) == MOST_CONTACTS and length.min() == pytest.approx(many - MOST_CONTACTS + 1)
    assert arrows[:, 0, 0] == pytest.approx(1.0)


def test_instances_get_the_colour_that_a_mesh_gets():
    """Values of IEC 61966-2-1: half of full scale on a screen is a fifth of the light."""
    assert instanced(np.array([[0, 128, 255]])).tolist() == [[0, 55, 255]]
