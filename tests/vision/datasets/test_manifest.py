"""Optics and sensor of a data set as its manifest keeps them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from otwarp.vision.datasets import load_spec
from otwarp.vision.datasets.labels import labels_of
from otwarp.vision.datasets.manifest import check_manifest, microscope_in, sensor_in
from otwarp.vision.datasets.store import manifest_of
from tests.vision.datasets.small import TEXT, written

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("electrons", ["inf", "5000"])
def test_optics_and_sensor_come_back(tmp_path: Path, electrons: str) -> None:
    """JSON has no infinity: as a text it was refused with a traceback where bounds were computed."""
    text = TEXT.replace("pixel = 0.13", f"pixel = 0.13\ncoma = 0.05\n\n[sensor]\nelectrons = {electrons}\nbits = 8")
    spec = load_spec(written(tmp_path, text))
    said = json.loads(json.dumps(manifest_of(labels_of(spec), {}), allow_nan=False))
    check_manifest(said, tmp_path / "manifest.json")
    assert sensor_in(said) == spec.sensor and spec.sensor.electrons == float(electrons)
    assert microscope_in(said) == spec.microscope and spec.microscope.zernike == {8: 0.05}
