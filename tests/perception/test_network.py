"""A network that learnt from images closes the loop: plant, images, network, tracker, twin, force."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.perception.assemble import SeeingOptions, estimator_of, see
from otwarp.perception.estimator import Estimator
from otwarp.perception.plant import PlantOptions
from otwarp.scene import Scene
from otwarp.vision.datasets.domain import Range
from otwarp.vision.datasets.robot import Robot
from otwarp.vision.view import microscope_of, sensor_of
from tests.perception.scenes import PIECE, QUICKLY, Lab, seen_bead

BODY = "/World/bead_right"
STIFFNESS = 10.0
"""Of its trap [pN/µm]."""

THICKER = 10.0
"""Viscosity of the plant over the twin's, where there is a drag of which only images tell."""

RATE = 120.0
"""Turns of the loop per second."""


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small network, trained for seconds on 360 images of the bead about where its trap holds it."""
    pytest.importorskip("torch")
    pytest.importorskip("zarr")
    from otwarp.vision.datasets import labels_of, make_dataset
    from otwarp.vision.datasets.spec import Spec
    from otwarp.vision.networks.settings import Settings
    from otwarp.vision.networks.train import train

    scene, folder, near = seen_bead(), tmp_path_factory.mktemp("bead"), Range(-0.25, 0.25)
    spec = Spec(
        robot=Robot.of_body(scene, BODY), classes=np.zeros(1), depth=(-0.4, 0.4), count=120, poses=3, scattered=True,
        width=PIECE, height=PIECE, microscope=microscope_of(scene), sensor=sensor_of(scene), rendering=QUICKLY,
        domain={"x": near, "y": near}, splits={"random": [280, 40, 40]}, seed=4,
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)  # images are those of the plant, of as few source points
        make_dataset(labels_of(spec), folder / "images", processes=1, device="cpu")
    settings = Settings(net="small", heads="pose", epochs=12, batch=16, lr=3e-3, seed=1)
    train(folder / "images", folder / "net", settings, device="cpu")
    return folder / "net"


@pytest.fixture
def looking(network: Path) -> Estimator:
    """The network as a session has it."""
    seeing = see(seen_bead(), SeeingOptions(networks=(str(network),), rendering=QUICKLY, device="cpu"))
    assert seeing.pieces == {0: PIECE} and seeing.about == {BODY: str(network)}
    return estimator_of(seen_bead(), seeing)


def followed(lab: Lab, turns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """After each turn: (n, 3) error of the estimated place [µm], (n, 3, 3) its covariance, (n) force along x [N]."""
    error, covariance, force = [], [], []
    for _ in range(turns):
        _, truth, felt = lab.run(1)
        pose = lab.perception.bodies[0].pose
        assert pose is not None and not lab.perception.warnings
        error.append(pose.position - truth[0])
        covariance.append(pose.covariance[:3, :3])
        force.append(felt[0, 0])
    return np.array(error), np.array(covariance), np.array(force)


def test_a_network_closes_the_loop(looking: Estimator) -> None:
    """The estimate is where the plant has the bead, as nearly as its covariance says, and the twin's force is sent.

    A third of the errors count as independent: in its trap a bead forgets within 2 ms, and the error of a prediction by
    0.02 s is thermal, new in every turn; what images tell of slow pushes lasts longer.
    """
    lab = Lab(look=looking)
    try:
        lab.run(40)
        error, covariance, _ = followed(lab, 90)
    finally:
        lab.close()
    assert lab.perception.bodies[0].refused == 0 and lab.perception.bodies[0].accepted > 90
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    # of 270 normal numbers none is beyond 5 of their deviations, and their mean is 0 to its error
    assert np.abs(error / deviation).max() < 5.0
    independent = len(error) / 3.0
    assert np.abs((error / deviation).mean(axis=0)).max() < 5.0 / math.sqrt(independent)
    # χ² of 3 degrees: 3 on average, deviation √6; a covariance may be too large, by a factor, but not too small
    squares = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)
    print(
        "NEES",
        squares.mean(),
        np.abs(error / deviation).max(),
        np.abs((error / deviation).mean(axis=0)),
        deviation.max(0),
    )
    assert 0.3 < squares.mean() < 3.0 + 5.0 * math.sqrt(6.0 / independent)
    # and it is no matter of course: the bead has gone far beyond that
    assert 20.0 * deviation.max() < 2.5 * 90 / RATE


def test_a_drag_that_only_its_images_show_is_felt(looking: Estimator) -> None:
    """The plant's liquid is ten times as viscous as the twin's; the hand feels the whole drag."""
    lab = Lab(look=looking, delay=0.01, plant=PlantOptions(seed=5, viscosity=THICKER))
    try:
        lab.run(70)
        _, _, force = followed(lab, 60)
    finally:
        lab.close()
    gain = lab.stage.plans[0].config.force_gain
    drag = gain * THICKER * 6.0 * math.pi * 0.00089 * 2.5
    thermal = gain * STIFFNESS * math.sqrt(0.00411 / STIFFNESS)
    assert -force.mean() == pytest.approx(drag, abs=5.0 * thermal / math.sqrt(len(force) / 3.0))
    assert -force.mean() > 0.5 * drag


def test_it_is_refused_for_another_robot(network: Path) -> None:
    """A bead that is larger by a tenth is another robot; whoever wants it all the same says so."""
    scene = seen_bead()
    (body,) = scene.bodies
    sphere = replace(body.spheres[0], radius=1.1)
    other: Scene = replace(scene, bodies=(replace(body, spheres=(sphere,)),))
    asked = SeeingOptions(networks=(str(network),), rendering=QUICKLY, device="cpu")
    with pytest.raises(InputError, match=r"1 solids, 2\.2 µm\) is not that of the network \(.*1 solids, 2 µm\)"):
        see(other, asked)
    assert see(other, replace(asked, any_robot=True)).pieces == {0: PIECE}
