"""A budget of trials for a whole study: spent where it is wanted, covered as said, the same bits after kills."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.studies.axes import values
from otwarp.studies.engines.local import on_this_host, tasks
from otwarp.studies.engines.run import run_study
from otwarp.studies.observables import first_passage, trapped
from otwarp.studies.stopping.contour import contour
from otwarp.studies.stopping.rules import Stop, budget, half_width
from otwarp.studies.stopping.search import largest, stop_of
from otwarp.studies.store import open_store
from otwarp.studies.study import Study
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")

BUDGET = 3_000


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def study_of(scene, stop: Stop | None = None) -> Study:
    """Twelve points from surely held to surely lost, in two blocks, some of them by the contours."""
    axes = {
        "trap_power": values([0.1, 0.16, 0.2], unit="mW"),
        "start.x:/World/bead": values([0.0, 200.0, 350.0, 399.0], unit="nm"),
    }
    rule = stop or contour(0.35, 0.5, half_width=0.005, at_least=32, at_most=2_048, budget=BUDGET)
    return Study(scene, axes=axes, observables=[trapped(until=0.01), first_passage()], stop=rule, seed=3)


@pytest.fixture(scope="module")
def whole(scene, tmp_path_factory):
    """What an undisturbed run gives."""
    store = run_study(study_of(scene), tmp_path_factory.mktemp("whole") / "out", devices=["cpu"])
    return store.read().load()


def spent(rule: Stop, chances: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Counts and trials of points with these chances, given trials until the budget is spent or all are content."""
    sums = np.cumsum(random.random((len(chances), rule.at_most), dtype=np.float32) < chances[:, None], axis=-1)
    done = np.zeros(len(chances), dtype=int)
    k = done
    while True:
        after = rule.shares(k[None], done)
        assert after.sum() <= rule.budget and np.all(after >= done)
        if np.all(after == done):
            return k, done
        done = after
        k = np.take_along_axis(sums, done[:, None] - 1, 1)[:, 0]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "rule",
    [
        budget(12_000, at_least=16, at_most=2_048),
        contour(0.5, half_width=0.02, at_least=16, at_most=2_048, budget=12_000),
        contour(0.5, half_width=0.02, at_least=16, at_most=2_048, budget=12_000, method="sequence"),
    ],
    ids=["widest", "contour", "contour by a sequence"],
)
def test_intervals_hold_what_they_say(rule):
    """40 points of five chances, 60 times: 95 % hold theirs within 5 σ of 480 of each; all of the budget is spent.

    Where points go from look to look, what is too little for another is left.
    """
    chances = np.repeat([0.02, 0.1, 0.4, 0.5, 0.9], 8)
    random = np.random.Generator(np.random.Philox(4))
    held, trials = [], []
    for _ in range(60):
        k, n = spent(rule, chances, random)
        low, high = (end[0] for end in rule.interval(k[None], n))
        held.append((low <= chances) & (chances <= high))
        trials.append(n)
        left = max(np.diff(rule.looks)) if rule.method == "looks" else 1
        assert 0 <= rule.budget - n.sum() < left
    share = np.mean(held, axis=0).reshape(5, 8).mean(axis=1)
    assert np.all(share >= 0.95 - 5.0 * np.sqrt(0.95 * 0.05 / 480)), share
    mean = np.mean(trials, axis=0).reshape(5, 8).mean(axis=1)
    if rule.method != "clopper-pearson":  # points off the contour get few
        assert mean[3] > 700 and np.all(mean[[0, 1, 4]] < 150)
    else:  # narrow ones get few
        assert mean[0] < 0.5 * mean[1] and mean[1] < 0.7 * mean[3]


@pytest.mark.thorough
def test_a_study_spends_its_budget_on_the_contour(scene, whole):
    """All but what is too little for another look; sure points stop early, and the first trials are as of any rule."""
    trials = whole["trials"].values
    assert 0 <= BUDGET - trials.sum() < np.diff(study_of(scene).stop.looks).max() and trials.min() == 32
    held = np.mean(np.where(np.isin(whole["end"], (0, 1)), whole["end"] == 0, np.nan)[..., :32], axis=-1)
    sure = (held < 0.05) | (held > 0.95)
    assert sure.any() and trials[sure].max() < 0.5 * trials.max()
    again = study_of(scene, half_width(0.4, at_least=32, at_most=2_048)).compute([0, 1], device="cpu")
    ends = np.concatenate([a["end"] for a in again])[..., :32].reshape((*whole["end"].shape[:2], 32))
    assert np.array_equal(ends, whole["end"].values[..., :32])
    assert np.all(np.isnan(whole["end_time"].values[np.arange(2_048) >= trials[..., None]]))


@pytest.mark.thorough
@pytest.mark.parametrize("after", [1, 3, 5])
def test_a_run_that_ends_in_a_round_goes_on_to_the_same_bits(scene, whole, tmp_path, after):
    """Ended between two blocks of a round, and by an error while one is written; then by two devices at once."""
    calls = 0

    def ended(done: int, of: int) -> None:
        nonlocal calls
        calls += 1
        if calls > after:
            raise KeyboardInterrupt

    study, out = study_of(scene), tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        run_study(study, out, devices=["cpu"], progress=ended)
    store = open_store(out)
    begun = int(np.maximum(store.trials(), 0).sum())
    assert store.finished() == [] and begun < BUDGET
    where = study.blocks()[0]
    end = store.block("end", where)  # as one that was killed after the first array of the next round leaves it
    wide = np.where(np.arange(end.shape[-1]) >= store.trials()[where][..., None], np.int8(1), end)
    store._put("end", where, wide)
    said: list[tuple[int, int]] = []
    store = run_study(
        study, out, engine=on_this_host(["cpu", "cpu"]), progress=lambda done, of: said.append((done, of))
    )
    found = store.read().load()
    assert np.array_equal(found["trials"], whole["trials"])
    ran = np.arange(2_048) < whole["trials"].values[..., None]
    for name in ("end", "end_time"):
        assert np.array_equal(found[name].values[ran], whole[name].values[ran])
    assert said[-1] == (int(whole["trials"].sum()),) * 2 and len(store.finished()) == len(study.blocks())


def test_tasks_of_a_round(scene):
    """Blocks with few new trials go together on a CPU, and are shared out where there are several."""
    study = study_of(scene)
    none = np.zeros(12, dtype=np.int64)
    count = len(study.blocks())
    part = study.between(none, none + 32)
    assert tasks(part, range(count), gpu=False) == [list(range(count))]
    assert len(tasks(part, range(count), gpu=False, workers=count)) == count
    assert len(tasks(study, range(count), gpu=False)) == count


@pytest.mark.thorough
def test_plan_and_files(scene, tmp_path, capsys):
    """`plan`, `run` and `status` speak of the budget; shards are refused."""
    (tmp_path / "s.toml").write_text(
        f'scene = "{scene}"\n[[axis]]\nname = "trap_power"\nvalues = [0.2, 1]\nunit = "mW"\n'
        '[[observable]]\nkind = "trapped"\nuntil = "0.01 s"\n[stop]\nbudget = 300\nat_least = 16\n'
    )
    line = [str(tmp_path / "s.toml"), "--device", "cpu"]
    out = str(tmp_path / "out")
    assert main(["study", "plan", *line]) == 0
    said = capsys.readouterr().out
    assert "trials    300, of a budget of 300 for all points" in said and "iB for 300 trials at once" in said
    assert main(["study", "run", *line, "-o", out, "--shard", "1/2"]) == 2
    assert "allowed for a study with a budget: none" in (error := capsys.readouterr().err) and error.count("\n") == 1
    assert not (tmp_path / "out").exists()
    assert main(["study", "run", *line, "-o", out]) == 0
    assert "otwarp: trial 300 of 300" in capsys.readouterr().err
    assert main(["study", "status", out]) == 0
    assert "trials    300 of a budget of 300" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda scene: study_of(scene, budget(100)), "budget is 100 trials; allowed: 768 or more, 64"),
        (lambda scene: study_of(scene, budget(-1)), "budget is -1; allowed: a whole number"),
        (lambda scene: stop_of({"largest": 0.9, "along": "x", "budget": 10}), "largest has budget"),
        (lambda scene: stop_of({"trials": 9, "budget": 10}), "trials has budget"),
        (lambda scene: stop_of({"halfwidth": 0.1, "level": 0.9}), "stop has halfwidth; did you mean half_width"),
        (lambda scene: stop_of({"half_width": 0.1, "atmost": 9}), "half_width has atmost; did you mean at_most"),
        (lambda scene: stop_of({"level": 0.9}), "stop has no rule; allowed: one of trials"),
        (
            lambda scene: Study(scene, observables=[first_passage()], horizon=0.1, stop=budget(100)),
            "budget needs a probability",
        ),
    ],
)
def test_bad_budgets(scene, make, said):
    """One line each."""
    with pytest.raises(InputError, match=said):
        make(scene)
    assert "budget" not in largest(0.9, along="x").said()
