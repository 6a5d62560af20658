"""The items of the report, in its order: one row each."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from otwarp.reproduce.item import Item, Request, Result


def run_of(name: str) -> Callable[[Request], Result]:
    """What computes an item: the function `run` of its file, which is loaded when it is called."""

    def run(request: Request) -> Result:
        """Compute it."""
        return import_module(f"otwarp.reproduce.items.{name}").run(request)

    return run


ITEMS: dict[str, Item] = {
    item.name: item
    for item in (
        Item(
            name="setup",
            title="The setup",
            about="parameters: theirs with their grades, ours",
            run=run_of("setup"),
            figures=0,
            tables=1,
            scenes=("strategy_a", "strategy_b", "cell_delivery"),
        ),
        Item(
            name="force_curves",
            title="Force curves and their fits",
            about="eq. 1 with the release's constants, beside fits of exact forces, axial and radial",
            run=run_of("force_curves"),
            figures=1,
            tables=3,
        ),
        Item(
            name="strategy_a",
            title="Motion fidelity, strategy A",
            about="tilt θ against trap spacing d*, two equal traps; RMSE 3.31°, MAE 2.71°",
            run=run_of("strategy_a"),
            figures=1,
            tables=2,
            scenes=("strategy_a",),
        ),
        Item(
            name="strategy_b",
            title="Motion fidelity, strategy B",
            about="tilt θ against trap spacing d* at power distribution m = 1.5; RMSE 1.54°, MAE 1.29°",
            run=run_of("strategy_b"),
            figures=1,
            tables=2,
            scenes=("strategy_b",),
        ),
        Item(
            name="rendering",
            title="Accuracy of the rendered force",
            about="rendered against model force, axial and radial: MSE, RMSE, R² 0.9525 and 0.9268",
            run=run_of("rendering"),
            figures=1,
            tables=3,
        ),
        Item(
            name="delivery",
            title="Cell delivery: trajectories, contact force, distance",
            about="contact force 2.57 ± 3.18 pN, distance 0.02 ± 0.026, warning lines 10 pN and 0.2",
            run=run_of("delivery"),
            figures=2,
            tables=2,
            scenes=("cell_delivery",),
        ),
        Item(
            name="user_study",
            title="The user study, with simulated operators",
            about="deliveries 8 of 10 with haptics, 3 of 10 without: simulated operators under both conditions",
            run=run_of("user_study"),
            figures=1,
            tables=3,
            scenes=("cell_delivery",),
        ),
        Item(
            name="networks",
            title="Pose and depth networks",
            about="accuracy, F1 and depth RMSE of VGG16, ResNet18 and ResNet50",
            run=run_of("networks"),
            figures=2,
            tables=3,
            scenes=("strategy_b",),
        ),
        Item(
            name="chain",
            title="The signal chain",
            about="stiffest springs 414, 10.3 and 1.4 N/m, filters, latency",
            run=run_of("chain"),
            figures=1,
            tables=2,
        ),
        Item(
            name="contract",
            title="The middleware contract",
            about="topics, types, rates and pairings of the release",
            run=run_of("contract"),
            figures=0,
            tables=2,
        ),
    )
}
"""By name."""
