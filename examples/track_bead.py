"""A bead followed through noisy measurements: a Kalman filter that knows the trap, against the camera alone.

You see out/track_bead.png: truth, what the camera says, and the estimate ± 2σ, which is closer than the camera.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot
from otwarp.vision.tracking import Commands, Measurement, MobileBody, Shape, Tracker

RATE, NOISE = 200.0, 0.06  # frames/s; standard deviation of a measured coordinate [µm]


def main(frames: int = 200, out: str | Path = "out") -> tuple[float, float]:
    scene = ot.Scene.load("scenes/single_bead.usda")
    body = MobileBody(scene, "/World/bead")
    tracker = Tracker(body, Shape.of(scene, "/World/bead", body.reference), Commands.of_scene(scene))
    sim, random = ot.Simulation(scene, seed=4), np.random.default_rng(4)
    truth, seen, found, width = [], [], [], []
    for _ in range(frames):
        sim.run(1.0 / RATE)
        truth += [sim.state.position.numpy()[0, 0].copy()]
        seen += [truth[-1] + random.normal(0.0, NOISE, 3)]
        tracker.add(Measurement(time=sim.time, position=seen[-1], covariance=NOISE**2 * np.eye(3)))
        pose = tracker.predict(sim.time)  # or later, ahead of the next frame
        found, width = [*found, pose.position], [*width, 2.0 * pose.covariance[0, 0] ** 0.5]
    time, (truth, seen, found) = np.arange(1, frames + 1) / RATE, np.array([truth, seen, found])[:, :, 0]
    figure, axes = plt.subplots(figsize=(8, 3.2), layout="constrained")
    axes.plot(time, seen, ".", color="0.6", label="camera")
    axes.fill_between(time, found - width, found + width, alpha=0.3)
    axes.plot(time, found, label="estimate ± 2σ")
    axes.plot(time, truth, "k", lw=1.0, label="truth")
    axes.set(xlabel="time [s]", ylabel="x [µm]", ylim=(-0.3, 0.36))
    axes.legend(ncols=3)
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "track_bead.png", dpi=110)
    return float((found - truth).std()), float((seen - truth).std())


if __name__ == "__main__":
    main()
