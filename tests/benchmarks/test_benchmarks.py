"""The benchmarks produce their tables: tiny sizes, real measurements, no claim about speed."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import headlines, realtime, startup, terms
from benchmarks.__main__ import BENCHMARKS, ON_GPUS
from benchmarks.report import PAGES, Section, markers, put_on_page, save_json, write_pages
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.speed.peers import numpy_bead
from otwarp.bench.terms.measure import SNAPSHOTS, TIME_STEP
from otwarp.bench.terms.scenes import COMPARISONS, SCENES, TOGETHER, Comparison
from otwarp.bench.timing import Quartiles, interleaved
from otwarp.errors import InputError
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions


def strictly(section: Section, tmp_path: Path) -> dict:
    """The section's data after a round trip through a JSON file, finite everywhere."""
    file = tmp_path / "numbers.json"
    save_json(file, [section])
    return json.loads(file.read_text())[section.name]


def cells(table: Table) -> list[list[str]]:
    """Rows of the rendered table, every one as wide as its head."""
    lines = [line for line in table.markdown().splitlines() if line.startswith("|")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert {len(row) for row in rows} == {len(table.head)}
    return rows[2:]


@pytest.fixture(scope="module")
def term_section() -> Section:
    chosen = [c for c in COMPARISONS if c.term in ("Brownian noise", "harmonic trap", "plane, touching", "plane, far")]
    # the scene of everything takes 10 s to compile and is looked at below
    sums = {label: parts for label, parts in TOGETHER.items() if "everything" not in parts[0]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("otwarp.bench.terms.measure.TOGETHER", sums)
        return terms.measure("cpu", comparisons=chosen, bodies=8, beads=400, rounds=2, seconds=1e-3)


def test_the_scene_of_everything_has_every_kind_of_term():
    options = StepOptions(time_step=TIME_STEP, allow_large_step=True)
    features = Model.build(SCENES["everything"](), device="cpu", options=options).features
    has = (
        "moving_traps",
        "speed_limits",
        "spheres",
        "rigid",
        "brownian",
        "gravity",
        "moving_obstacles",
        "pairs",
        "escapes",
    )
    assert all(getattr(features, name) for name in has) and features.flow and features.obstacles


def test_startup_splits_the_wait_into_phases(tmp_path: Path):
    section = startup.measure("cpu", scenes=["single_bead"], rounds=1)
    data = strictly(section, tmp_path)
    assert set(data["commands"]) == set(startup.COMMANDS)
    found = data["scenes"]["single_bead"]
    warm = {phase: spread["median"] for phase, spread in found["warm"].items()}
    for run in (found["cold"], warm):
        assert all(run[phase] > 0.0 for phase in startup.PHASES)
        assert math.isclose(run["total"], sum(run[phase] for phase in startup.PHASES), rel_tol=1e-9)
    for table in section.tables[1:]:
        assert [row[0] for row in cells(table)] == ["`single_bead`"]


def test_a_command_that_fails_is_named():
    with pytest.raises(InputError, match=r"benchmarks\.first_step.*absent.*exit code 1"):
        startup.first_step("absent", "cpu", Path("unused"))


def test_realtime_factor_follows_from_step_and_wall_time(tmp_path: Path):
    # the median of an odd number of samples is one of them, so it may be inverted
    section = realtime.measure("cpu", scenes=["single_bead", "cell_delivery"], worlds=2, rounds=3, seconds=1e-3)
    data = strictly(section, tmp_path)
    for found in data["scenes"].values():
        expected = 1e9 * found["time_step"] / found["wall_ns_per_step"]["median"]
        assert math.isclose(found["real_time_factor"]["median"], expected, rel_tol=1e-9)
    assert data["scenes"]["cell_delivery"]["bodies"] == 3
    assert data["threads"]["ratio"]["median"] > 0.0
    assert [len(cells(table)) for table in section.tables] == [2, 1]


def test_terms_table_tells_with_from_without(term_section: Section, tmp_path: Path):
    data = strictly(term_section, tmp_path)
    assert data["terms"]["plane, touching"]["touching"] == 1.0
    assert data["terms"]["plane, far"]["touching"] == 0.0
    assert data["terms"]["Brownian noise"]["drivers"] == ["solo", "solo"]
    assert (
        data["terms"]["Brownian noise"]["bytes_per_world"][0] == data["terms"]["Brownian noise"]["bytes_per_world"][1]
    )
    assert data["terms"]["harmonic trap"]["bytes_per_world"][0] < data["terms"]["harmonic trap"]["bytes_per_world"][1]
    assert {row[0] for row in cells(term_section.tables[0])} == set(data["terms"])
    together = data["together"]["bead: noise, harmonic trap"]
    parts = [data["terms"][term]["cost"]["median"] for term in ("Brownian noise", "harmonic trap")]
    assert math.isclose(together["sum_of_parts"], sum(parts))


def test_numpy_loop_and_otwarp_sample_the_variance_of_the_scheme(term_section: Section):
    variance = term_section.data["numpy"]["variance"]
    # 5 standard errors of a variance from independent snapshots of 400 beads × 3 components
    tolerance = 5.0 * math.sqrt(2.0 / (3 * 400 * SNAPSHOTS)) * variance["theory"]
    assert abs(variance["otwarp"] - variance["theory"]) < tolerance
    assert abs(variance["numpy"] - variance["theory"]) < tolerance


def test_numpy_loop_takes_the_step_it_documents():
    beads = numpy_bead.Peer(5, relaxation=0.25, kick=0.5, seed=3)
    beads.position += np.float32(1.0)
    start = beads.position.copy()
    noise = np.random.Generator(np.random.SFC64(3)).standard_normal((5, 3), dtype=np.float32)
    beads.step(1)
    # float32 rounding of numbers of order 1
    assert np.allclose(beads.position, start + 0.25 * (beads.centre - start) + 0.5 * noise, atol=1e-5)


FEATURE_OF = {
    "Brownian noise": "brownian",
    "… finite reach: escape detection": "escapes",
    "… moving on 256 time samples": "moving_traps",
    "… speed limit": "speed_limits",
    "gravity": "gravity",
    "uniform flow": "flow",
    "shear flow": "flow",
    "Poiseuille flow": "flow",
    "rotation: 6×6 mobility, 5 spheres": "rigid",
    "box, far": "obstacles",
    "mesh, touching": "obstacles",
    "… the touching box moves": "moving_obstacles",
    "body–body contact, touching": "pairs",
    "body–body contact in a crowd of 64": "pairs",
}


@pytest.mark.parametrize("case", COMPARISONS, ids=lambda c: c.term)
def test_a_pair_of_scenes_differs_by_its_term(case: Comparison):
    without, with_ = (
        Model.build(SCENES[name](), device="cpu", options=StepOptions(time_step=TIME_STEP, allow_large_step=True))
        for name in (case.without, case.with_)
    )
    a, b = vars(without.features), vars(with_.features)
    changed = {key for key in a if a[key] != b[key]}
    if case.term in FEATURE_OF:
        feature = FEATURE_OF[case.term]
        assert feature in changed and bool(b[feature])
        # what follows from a term: where bodies are stepped, and how
        how = {"driver", "spheres", "max_contacts", "integrator", "lanes", "soft_contacts", "body_space", "in_turn"}
        how |= {"by_world", "phased", "vectors", "cached"}
        assert changed <= how | {feature}
    else:
        assert changed


def test_every_part_of_a_sum_is_measured_alone():
    measured = {case.with_ for case in COMPARISONS}
    for scene, parts in TOGETHER.values():
        assert scene in SCENES
        assert set(parts) <= measured


def test_pairs_are_taken_in_turns():
    log: list[str] = []

    def note(name: str, value: float) -> float:
        log.append(name)
        return value

    pairs = interleaved({"x": (lambda: note("a", 1.0), lambda: note("b", 4.0))}, rounds=3)["x"]
    assert log == ["a", "b", "b", "a", "a", "b"]
    assert pairs.difference() == Quartiles(3.0, 3.0, 3.0)
    assert pairs.ratio() == Quartiles(0.25, 0.25, 0.25)


def test_tables_go_between_the_markers_of_the_page(term_section: Section):
    page = (PAGES / "terms.md").read_text()
    once = put_on_page(page, term_section)
    assert term_section.markdown() in once
    assert put_on_page(once, term_section) == once
    before, after = (text.split("<!-- begin terms cpu -->")[0] for text in (page, once))
    assert before == after
    with pytest.raises(InputError, match="begin terms cpu"):
        put_on_page("no markers here", term_section)


@pytest.mark.parametrize("name", BENCHMARKS)
def test_every_benchmark_has_its_page(name: str):
    page = (PAGES / f"{name}.md").read_text()
    for marker in markers(name, "cuda" if name in ON_GPUS else "cpu"):
        assert page.count(marker) == 1


def test_sections_are_written_to_their_pages_or_none_is(term_section: Section, tmp_path: Path):
    page = tmp_path / "terms.md"
    page.write_text("before\n{}\n{}\nafter\n".format(*markers("terms", "cpu")))
    write_pages([term_section], tmp_path)
    written = page.read_text()
    assert written.startswith("before\n") and written.endswith("\nafter\n") and term_section.markdown() in written
    page.write_text("before\n{}\n{}\nafter\n".format(*markers("terms", "cpu")))
    with pytest.raises(InputError, match=r"forces\.md cannot be read"):
        write_pages([term_section, replace(term_section, name="forces")], tmp_path)
    assert term_section.markdown() not in page.read_text()


def test_the_short_page_states_what_the_pages_under_it_hold():
    text = headlines.SUMMARY.read_text()
    assert text.split(headlines.BEGIN)[1].split(headlines.END)[0].strip() == headlines.summary().strip()
    assert len(text.splitlines()) <= 150
    assert all((f"(benchmarks/{name}.md)") in text for name in BENCHMARKS)


def test_machine_is_described_without_naming_it():
    import platform

    from otwarp.device import pick_device

    machine = Machine.look(pick_device("cpu"))
    assert machine.cores >= 1
    assert {"Python", "Warp", "USD", "NumPy"} == set(machine.versions)
    assert platform.node() not in machine.text().replace(machine.system, "").split()


def test_json_that_cannot_be_written_is_an_input_error(term_section: Section, tmp_path: Path):
    with pytest.raises(InputError, match="--out"):
        save_json(tmp_path / "absent" / "x.json", [term_section])
