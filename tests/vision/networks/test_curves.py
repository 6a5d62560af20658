"""The picture of a training: whole epochs, labels that fit."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from otwarp.vision.networks.curves import draw_curves


@pytest.mark.quick
def test_epochs_are_whole_and_labels_are_within(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Figure] = []
    save = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda figure, *a, **k: (made.append(figure), save(figure, *a, **k)))
    rows = [{"epoch": n, "training_loss": 1 / n, "validation_loss": 2 / n, "depth_rmse_um": 1 / n} for n in (1, 2)]
    draw_curves(tmp_path / "curves.png", rows)
    for axes in made[0].axes:
        assert all(float(x).is_integer() for x in axes.get_xticks())
        box = axes.yaxis.label.get_window_extent()
        assert box.y0 >= 0.0 and box.y1 <= made[0].bbox.height
