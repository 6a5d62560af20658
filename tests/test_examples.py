"""Every example runs, with small sizes, and shows what its first lines say."""

from __future__ import annotations

import math
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import in_one_line
from tests.documents import ROOT, Document

EXAMPLES = ROOT / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py") if path.stem != "__init__")
LINES, TRAINING = 40, 340
"""An example fits on a screen, without the lines that run it; those that train are one file that one can read."""
RUN = '\n\nif __name__ == "__main__":\n    main()\n'

SIGMAS = 5.0


@pytest.fixture(autouse=True)
def here(monkeypatch):
    """Examples are run from the root of the repository, and draw without a display."""
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    monkeypatch.chdir(ROOT)
    yield
    plt.close("all")


@pytest.mark.quick
@pytest.mark.parametrize("name", NAMES)
def test_an_example_is_short_listed_and_tested(name):
    text = (EXAMPLES / f"{name}.py").read_text()
    trains = name.startswith("train_")
    assert trains or text.endswith(RUN)
    assert len(text.removesuffix(RUN).splitlines()) <= (TRAINING if trains else LINES)
    assert "\nYou see " in text
    assert f"{name}.py" in Document(EXAMPLES / "README.md").links()
    assert f"test_{name}" in globals()


@pytest.mark.quick
def test_first_run(tmp_path: Path):
    found, theory = import_module("examples.first_run").main(worlds=400, out=tmp_path)
    assert (tmp_path / "first_run.png").is_file()
    # of a standard deviation of 400 draws
    assert found == pytest.approx(theory, rel=SIGMAS / math.sqrt(2 * 400))


def test_escape_times(tmp_path: Path):
    trials = 400
    found, theory = import_module("examples.escape_times").main(worlds=64, trials=trials, barrier=1.5, out=tmp_path)
    # escape times are spread no wider than an exponential's; a scene's accuracy is 1 %
    assert found == pytest.approx(theory, rel=SIGMAS / math.sqrt(trials) + 0.01)
    assert (tmp_path / "escape_times.png").is_file()


def test_open_channel(tmp_path: Path):
    entries, carried = import_module("examples.open_channel").main(duration=1.0, out=tmp_path)
    # cells stand about evenly at the start, so that fewer leave by chance than independent ones would
    assert entries[-1] == pytest.approx(carried[-1], abs=SIGMAS * math.sqrt(carried[-1]))
    assert entries[-1] > 15 and np.all(np.diff(entries) >= 0)
    assert (tmp_path / "open_channel.png").is_file()


@pytest.mark.quick
def test_sweep_power(tmp_path: Path):
    worlds, samples = 64, 20
    ratio = import_module("examples.sweep_power").main(worlds, samples, tmp_path)
    assert (tmp_path / "sweep_power.png").stat().st_size > 0
    # samples are a relaxation time apart and more for most powers: half of them count as independent
    assert np.mean(ratio) == pytest.approx(1.0, abs=SIGMAS * math.sqrt(2 / (worlds * samples)))


@pytest.mark.quick
def test_user_force(tmp_path: Path):
    worlds = 400
    found, theory = import_module("examples.user_force").main(worlds, tmp_path)
    # x² is spread by half of its mean
    assert found == pytest.approx(theory, rel=SIGMAS * 0.5 / math.sqrt(worlds))


def test_author_scene(tmp_path: Path):
    worlds = 100
    lag, theory = import_module("examples.author_scene").main(worlds, 0.05, tmp_path)
    # thermal width of the bead in its trap of 10 pN/µm: 20 nm
    assert lag == pytest.approx(theory, abs=SIGMAS * 0.0203 / math.sqrt(worlds))


def test_optical_force(tmp_path: Path):
    assert import_module("examples.optical_force").main(points=100, tolerance=1e-2, out=tmp_path) < 1e-2
    assert (tmp_path / "optical_force.png").is_file()


@pytest.mark.quick
def test_robot_mobility(tmp_path: Path):
    diffusion = import_module("examples.robot_mobility").main(accuracy=0.05, out=tmp_path)
    assert (tmp_path / "robot_mobility.png").is_file()
    assert np.linalg.eigvalsh(diffusion).min() > 0.0


def test_record_and_plot(tmp_path: Path):
    summary = import_module("examples.record_and_plot").main(0.1, tmp_path)
    assert summary
    assert {"run.usda", "run.nc", "summary.json", "figure.png", "path.png"} <= {p.name for p in tmp_path.iterdir()}


def test_strategy_a(tmp_path: Path):
    error = import_module("examples.strategy_a").main(8, 0.5, tmp_path)
    # thermal, near the fork; 0.004 away from it
    assert np.abs(error).max() < 0.02


def test_train_ppo(tmp_path: Path):
    """It saves what `load` makes a policy of; PPO's success is a benchmark (`benchmarks.envs_learning`)."""
    example = import_module("examples.train_ppo")
    small = ["--envs", "16", "--minutes", "0.05", "--episodes", "16", "--steps", "16", "--out", str(tmp_path)]
    result = example.main([*small, "--env", "otwarp/Navigate-v0"])
    assert result["episodes"] == 16 and 0.0 <= result["low"] <= result["success"] <= result["high"] <= 1.0
    assert {"policy.pt", "curve.png", "curve.json", "result.json"} <= {p.name for p in tmp_path.iterdir()}
    policy = example.load(tmp_path / "policy.pt")
    seen = np.zeros((3, policy.options["seen"]), dtype=np.float32)
    assert policy.best(example.torch.as_tensor(seen)).shape == (3, 2)


def test_train_ppo_by_the_recipe_of_a_task(tmp_path: Path):
    """A policy for two hands draws what they do together and, much smaller, against each other; it keeps what it has
    seen on average."""
    example = import_module("examples.train_ppo")
    torch, name = example.torch, "otwarp/CellDelivery-v0"
    asked = ["--env", name, "--envs", "4", "--rollouts", "2", "--steps", "8", "--episodes", "4", "--out", str(tmp_path)]
    args = example.parse(asked)
    assert args.envs == 4 and args.pair == example.RECIPES[name]["pair"] and example.parse([]).pair == 0.0
    example.main(asked)
    policy = example.load(tmp_path / "policy.pt")
    drawn = torch.tensor([[0.5, -0.2, 1.0, 2.0], [3.0, 0.0, 0.0, 0.0]])
    wanted = torch.tensor([[0.52, -0.16, 0.48, -0.24], [1.0, 0.0, 1.0, 0.0]])
    assert torch.allclose(policy.action(drawn), wanted)
    assert policy.normalise and policy.count == 2 * 8 * 4
    parts = torch.randn(3, 5, 2, generator=torch.Generator().manual_seed(0))
    taught = example.Policy(2, 4, normalise=True)
    for part in parts:
        taught.look(part)
    assert torch.allclose(taught.mean, parts.flatten(0, 1).mean(0), atol=1e-6)
    assert torch.allclose(taught.variance, parts.flatten(0, 1).var(0, correction=0), atol=1e-6)


@pytest.mark.parametrize(
    "asked",
    ["env otwarp/Nope-v0", "envs 0", "minutes 0", "minutes nan", "steps 0", "episodes 0", "device bogus", "seed -1",
     "scattered 3", "minibatches 4000", "out /proc/nowhere"],
)  # fmt: skip
def test_train_ppo_refuses_what_it_cannot_do_before_it_trains(asked: str, tmp_path: Path, capsys):
    example = import_module("examples.train_ppo")
    name, value = asked.split()
    with pytest.raises(SystemExit) as stopped, in_one_line("train_ppo"):
        example.main(["--out", str(tmp_path), f"--{name}", value])
    said = capsys.readouterr().err
    assert stopped.value.code == 2 and said.startswith("train_ppo: ") and said.count("\n") == 1
    assert value in said and "; allowed: " in said


@pytest.mark.thorough
@pytest.mark.parametrize("library, package", [("sb3", "stable_baselines3"), ("skrl", "skrl"), ("rsl_rl", "rsl_rl")])
def test_training_of_an_unknown_environment_is_refused_in_one_line(library: str, package: str):
    pytest.importorskip(package, reason="pip install 'otwarp[learning]'")
    file = EXAMPLES / f"train_{library}.py"
    done = subprocess.run([sys.executable, file, "otwarp/Nope-v0"], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f"train_{library}: environment 'otwarp/Nope-v0' is unknown; allowed")


@pytest.mark.thorough
@pytest.mark.parametrize("library, package, steps", [("skrl", "skrl", "2"), ("rsl_rl", "rsl_rl", "1")])
def test_training_says_how_many_succeeded(library: str, package: str, steps: str):
    pytest.importorskip(package, reason="pip install 'otwarp[learning]'")
    file = EXAMPLES / f"train_{library}.py"
    done = subprocess.run([sys.executable, file, "otwarp/Navigate-v0", steps], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "the last episode succeeded in 0 of 64 environments" in done.stdout.splitlines()[-1]


def test_train_sb3():
    pytest.importorskip("stable_baselines3", reason="pip install 'otwarp[learning]'")
    model = import_module("examples.train_sb3").train("otwarp/Navigate-v0", 512, envs=16, rollout=16)
    assert model.num_timesteps == 512


def test_train_skrl(monkeypatch, tmp_path: Path):
    pytest.importorskip("skrl", reason="pip install 'otwarp[learning]'")
    agent, env = import_module("examples.train_skrl").train("otwarp/Navigate-v0", 32, envs=16, rollout=16)
    assert agent.memory.filled and env.succeeded.shape == (16,)


def test_train_rsl_rl():
    pytest.importorskip("rsl_rl", reason="pip install 'otwarp[learning]'")
    runner = import_module("examples.train_rsl_rl").train("otwarp/Navigate-v0", 2, envs=16, steps=16)
    assert runner.current_learning_iteration == 1


def test_capture_study(tmp_path: Path):
    caught = import_module("examples.capture_study").main(points=2, trials=50, out=tmp_path)
    # 1.4 µm beside the trap nearly all are caught, 3 µm beside it few: far beyond the error of 50 trials, 0.07
    assert caught[0] > 0.8 and caught[-1] < 0.4
    assert (tmp_path / "capture_study.png").is_file()


def test_calibrate_trap(tmp_path: Path):
    tracks = 10
    low, high = import_module("examples.calibrate_trap").main(tracks, 2048, tmp_path)
    # intervals of 95 %: of ten, six or more miss with a probability of 10⁻⁶, beyond 4.8 σ
    assert np.sum((low > 1.0) | (high < 1.0)) < 6
    assert np.all(low < high)


def test_escape_force(tmp_path: Path):
    escape = import_module("examples.escape_force").main(3, tmp_path)
    assert np.all(escape > 0.0) and escape[1] > escape[0]


def test_microscope_image(tmp_path: Path):
    stack = import_module("examples.microscope_image").main(128, tmp_path)
    assert stack.shape == (4, 128, 128) and stack[3].max() > 1.2 > stack[1].mean()


def test_rare_escape(tmp_path: Path):
    time = import_module("examples.rare_escape").main(points=2, branches=100, out=tmp_path)
    # means of four other seeds; standard errors of 4 runs of 100 paths: 4 %, and 30 % at three days
    assert time[0] == pytest.approx(7.4, rel=SIGMAS * 0.04)
    assert abs(math.log(time[1] / 3e5)) < SIGMAS * 0.3
    assert (tmp_path / "rare_escape.png").is_file()


def test_decompose_mesh(tmp_path: Path):
    pytest.importorskip("trimesh", reason="pip install 'otwarp[mesh]'")
    errors = import_module("examples.decompose_mesh").main(counts=(6, 16), out=tmp_path)
    assert errors[1] < 0.5 * errors[0]
    assert (tmp_path / "decompose_mesh.png").is_file()


def test_track_bead(tmp_path: Path):
    found, seen = import_module("examples.track_bead").main(out=tmp_path)
    noise = import_module("examples.track_bead").NOISE
    # the deviation of 200 draws; the estimate's is 0.62 of it, correlated over some frames
    assert seen == pytest.approx(noise, rel=SIGMAS / math.sqrt(2 * 200))
    assert found < 0.8 * seen
    assert (tmp_path / "track_bead.png").is_file()
