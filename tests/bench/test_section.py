"""The section of docs/benchmarks/forces.md that `otwarp bench forces` fills."""

from __future__ import annotations

from benchmarks import forces
from benchmarks.__main__ import BENCHMARKS
from benchmarks.report import PAGES, put_on_page
from otwarp.bench.forces.result import ForcesBench
from otwarp.optics import Particle


def test_the_section_has_a_table_and_says_how_to_read_it(device, tmp_path, monkeypatch):
    monkeypatch.setenv("OTWARP_CACHE", str(tmp_path))
    section = forces.measure(
        device,
        models=["bilinear-1e-2"],
        sphere=Particle(radius=0.5, index=1.59),
        rounds=1,
        worlds=8,
        seconds=1e-3,
        probes=(20, 10),
    )
    text = section.markdown()
    assert forces.HOW_TO_READ in text and forces.HOW_TO_READ.count(". ") == 1
    assert "| harmonic, radial + axial |" in text and "| bilinear table 1e-2 |" in text
    assert ForcesBench.from_json(section.data["accurate"]).row("bilinear-1e-2").table_bytes > 0
    assert text in put_on_page((PAGES / "forces.md").read_text(), section)


def test_it_is_one_of_the_benchmarks():
    assert BENCHMARKS["forces"] is forces.measure
    page = (PAGES / "forces.md").read_text()
    for kind in ("cpu", "cuda"):
        assert page.count(f"<!-- begin forces {kind} -->") == page.count(f"<!-- end forces {kind} -->") == 1
