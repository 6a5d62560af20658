"""What all tests share: the device they run on, and whether the long statistical ones run."""

from __future__ import annotations

import gc
import importlib.util
import itertools
import os
from collections import defaultdict
from collections.abc import Generator
from pathlib import Path

# before NumPy loads: on two shared cores the threads of its matrix products wait for each other ten times longer than
# they work
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
import warp as wp

from otwarp.device import start_warp

THOROUGH = (
    "bench/",
    "benchmarks/",
    "cli/test_bench.py",
    "cli/test_forces.py",
    "cli/test_killed.py",
    "cli/test_new.py",
    "cli/test_warnings.py",
    "docs/test_blocks.py",
    "docs/test_commands.py",
    "docs/test_site.py",
    "envs/test_adapters.py",
    "envs/test_batch.py",
    "envs/test_check.py",
    "envs/test_grouped.py",
    "envs/test_images.py",
    "envs/test_observe.py",
    "envs/test_ot_gym.py",
    "envs/test_pettingzoo.py",
    "envs/test_record_video.py",
    "envs/test_single.py",
    "envs/test_tasks.py",
    "envs/test_terms.py",
    "envs/test_window.py",
    "extending/",
    "haptics/chain/test_passivity_worst.py",
    "haptics/check/test_zwidth.py",
    "kernels/core/test_faults.py",
    "kernels/core/test_precision.py",
    "kernels/cpu/test_table_block.py",
    "kernels/drivers/grid/test_contacts.py",
    "kernels/drivers/grid/test_entry_sweeps.py",
    "kernels/drivers/grid/test_inlets.py",
    "kernels/drivers/grid/test_neighbours.py",
    "kernels/drivers/grid/test_soft.py",
    "kernels/drivers/grid/test_turns.py",
    "kernels/drivers/test_inlets.py",
    "kernels/drivers/test_lanes.py",
    "kernels/drivers/test_lanes_rigid.py",
    "kernels/drivers/test_world_moves.py",
    "kernels/drivers/test_world_phases.py",
    "kernels/test_step.py",
    "operators/perception/test_loop.py",
    "operators/perception/test_sweep.py",
    "operators/perception/test_theory.py",
    "operators/test_chain.py",
    "operators/test_delivery.py",
    "operators/test_device.py",
    "operators/test_hand.py",
    "operators/test_killed.py",
    "operators/test_study.py",
    "optics/test_table.py",
    "perception/test_closed_loop.py",
    "perception/test_network.py",
    "perception/test_process.py",
    "perception/test_recording.py",
    "preview/test_raycast.py",
    "recipes/",
    "reproduce/test_networks.py",
    "scene/write/test_edit.py",
    "scenes/test_physics.py",
    "simulation/test_body_space.py",
    "simulation/test_commands.py",
    "simulation/test_contact_chains.py",
    "simulation/test_contact_stiff.py",
    "simulation/test_contact_thermal.py",
    "simulation/test_contact_thin.py",
    "simulation/test_coupling.py",
    "simulation/test_episodes.py",
    "simulation/test_forces.py",
    "simulation/test_inlets.py",
    "simulation/test_mesh_obstacles.py",
    "simulation/test_optics.py",
    "simulation/test_periodic.py",
    "simulation/test_walls.py",
    "studies/rare/test_states.py",
    "studies/test_engines.py",
    "studies/test_rerun.py",
    "studies/test_slurm.py",
    "studies/test_token.py",
    "teleop/operators/test_local_scene.py",
    "teleop/page/test_end_to_end.py",
    "test_docstrings.py",
    "test_examples.py",
    "test_import_rules.py",
    "test_installed.py",
    "test_layout.py",
    "test_notebooks.py",
    "validation/test_rigid_equilibrium.py",
    "validation/test_scattering_model.py",
    "validation/test_strong_order.py",
    "validation/test_symmetry.py",
    "validation/test_tilted_pair.py",
    "validation/test_weak_order.py",
    "view/test_browser.py",
    "view/test_edit_page.py",
    "view/test_study_map.py",
    "vision/",
)
"""Files that compile most and run longest: CI runs them after the others, with --thorough. Their tests marked `quick`
always run, one of each thing that is promised: an installed package, a force of one's own, an example, a benchmark."""

STEPPING = (
    "cli/test_forces.py",
    "kernels/drivers/test_solo.py",
    "kernels/optics/test_force_table.py",
    "optics/",
    "ros/",
    "scenes/",
    "simulation/test_determinism.py",
    "simulation/test_statistics.py",
    "studies/",
    "teleop/",
    "validation/",
    "vision/",
)
"""Files that step for seconds, or look at what the compiler made: their kernels are optimised, as for users. Those of
the others are compiled without that by `make test`, which takes a quarter of the time: with cold caches, compiling is
most of what they do."""


NETWORKS = ("torch", "onnx", "onnxruntime", "zarr")
"""What tests of networks skip without."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--thorough", action="store_true", help="also run the files of THOROUGH (tests/conftest.py)")
    parser.addoption("--validate", action="store_true", help="also run the long statistical tests")
    parser.addoption("--unoptimised", action="store_true", help="compile kernels without optimisation")
    parser.addoption("--costs", type=int, default=0, metavar="N", help="list the N tests that take most CPU time")
    parser.addoption("--gpu-forms", action="store_true", help="step in the forms for GPUs, whatever the device")
    parser.addoption("--device", default="cpu", help="device of the tests that step: cpu (default), cuda:0, …")


def pytest_configure(config: pytest.Config) -> None:
    """Warp's optimisation; with OTWARP_REQUIRE_TORCH=1, as in CI, no test of networks skips for want of a package."""
    absent = [name for name in NETWORKS if importlib.util.find_spec(name) is None]
    if absent and os.environ.get("OTWARP_REQUIRE_TORCH") == "1":
        raise pytest.UsageError(f"OTWARP_REQUIRE_TORCH=1, and {', '.join(absent)} are absent: install otwarp[vision]")
    if config.getoption("--unoptimised"):
        wp.config.optimization_level = 0


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out, unread, what a run of all tests has no test in: reading it takes each worker as long as testing."""
    here = Path(__file__).parent
    if not collection_path.name.startswith("test_") or {Path(name).resolve() for name in config.args} != {here}:
        return None
    file = collection_path.relative_to(here).as_posix()
    chosen = {"stepping": file.startswith(STEPPING), "not stepping": not file.startswith(STEPPING)}
    if not chosen.get(config.option.markexpr, True):
        return True
    asked = config.getoption("--thorough") or config.getoption("--validate")
    if file.startswith(THOROUGH) and not asked and "mark.quick" not in collection_path.read_text(encoding="utf-8"):
        return True
    return None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    left_out = {}
    if config.getoption("--gpu-forms"):
        left_out["cpu_forms"] = pytest.mark.skip(reason="about a form for CPUs: run without --gpu-forms")
    if not config.getoption("--validate"):
        left_out["validate"] = pytest.mark.skip(reason="long statistical test: run with --validate")
        if not config.getoption("--thorough"):
            left_out["thorough"] = pytest.mark.skip(reason="one of the longest files: run with --thorough")
    for item in items:
        file = item.path.relative_to(Path(__file__).parent).as_posix()
        if file.startswith(STEPPING):
            item.add_marker("stepping")
        # markers alone: names of folders above the tests count among the keywords
        if file.startswith(THOROUGH) and item.get_closest_marker("quick") is None:
            item.add_marker("thorough")
        for mark, skip in left_out.items():
            if item.get_closest_marker(mark) is not None:
                item.add_marker(skip)


@pytest.fixture(scope="session")
def device(request: pytest.FixtureRequest) -> str:
    """Name of the device under test; Warp runs, and is quiet."""
    start_warp()
    return request.config.getoption("--device")


@pytest.fixture(scope="session", autouse=True)
def forms(request: pytest.FixtureRequest) -> Generator[None]:
    """The forms for GPUs where --gpu-forms asks for them."""
    with pytest.MonkeyPatch.context() as patch:
        if request.config.getoption("--gpu-forms"):
            from tests.gpu_forms import take_gpu_forms

            take_gpu_forms(patch)
        yield


COSTS = pytest.StashKey[tuple[float, float]]()
"""CPU time of this process and of those that it has waited for, at the end of the last report [s]."""


def cpu_time() -> tuple[float, float]:
    """CPU time of this process, and of the processes that it has waited for [s]."""
    now = os.times()
    return now.user + now.system, now.children_user + now.children_system


def pytest_collection_finish(session: pytest.Session) -> None:
    # the collector would look at thousands of tests and all modules again and again, which took a tenth of the time
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    session.config.stash[COSTS] = cpu_time()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Write beside each phase of a test what it cost, its subprocesses and the compilation of kernels included."""
    report = yield
    last, now = item.config.stash[COSTS], cpu_time()
    report.cpu_time = now[0] - last[0], now[1] - last[1]
    item.config.stash[COSTS] = now
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """The costs of the run, and of the dearest tests: CPU time, which a busy machine does not blur as it does time."""
    costs: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
    for report in itertools.chain.from_iterable(terminalreporter.stats.values()):
        for n, seconds in enumerate(getattr(report, "cpu_time", ())):
            costs[report.nodeid][n] += seconds
    for name, (own, others) in sorted(costs.items(), key=lambda row: -sum(row[1]))[: config.getoption("--costs")]:
        terminalreporter.write_line(f"{own + others:8.1f} s  {name}")
    own, others = (sum(part) for part in zip(*costs.values(), strict=True)) if costs else (0.0, 0.0)
    terminalreporter.write_line(f"CPU time: {own:.0f} s in tests, {others:.0f} s in processes that they started")
