"""Studies of simulated operators: the same random numbers under all conditions, whatever runs beside whatever."""

import dataclasses

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.operators.folder import create, open_folder, run_study
from otwarp.operators.summary import summarise
from otwarp.operators.task import task_of
from otwarp.scene import Scene
from tests.operators.work import PERFECT, loop_of, operators, scene, study


@pytest.fixture(scope="module")
def trials(device):
    """Three operators without haptics, with, and with the arm alone."""
    return study(conditions=("without", "with", "no response")).run_chunk(0, device=device)


def test_an_operator_without_noise_sees_no_error_but_rounding(device):
    """Foci of 60 µm in float32 at a motion gain of 952 µm/m: errors below 4 nm at the specimen."""
    loop = loop_of(operators(1, **PERFECT), device=device)
    loop.run(0.7)
    seen = loop.people.sight.error.numpy() * loop.task.motion_gain
    assert np.any(loop.people.mind.wanted.numpy() != 0.0)
    assert np.max(np.abs(seen)) < 0.004


def test_work_on_the_hands_is_what_the_servo_counts(device):
    """The chain's account E ← E − F·Δx, but for its charges for noise and the last period: within 5 %."""
    loop = study(conditions=("with",), duration=5.0).loop(np.arange(3), device)
    loop.run(0.4)
    given = -np.sum(loop.chain.energy.numpy(), axis=1)
    np.testing.assert_allclose(loop.people.accounts()["work"], given, rtol=0.05, atol=1e-6)


def test_haptics_without_force_are_no_haptics(device, trials):
    """Bit for bit: the force alone tells the conditions apart."""
    none = study(conditions=("with",), force_gain=0.0).run_chunk(0, device=device)
    for name, row in none.items():
        np.testing.assert_array_equal(row[0], trials[name][0], err_msg=name)


def test_haptics_are_felt(trials):
    assert np.all(trials["force_mean"][0] == 0.0) and np.all(trials["force_mean"][1:] > 0.0)
    assert np.all(trials["contact_mean"][0] != trials["contact_mean"][1])


def test_trials_do_not_depend_on_what_runs_beside_them(device, trials):
    """One operator at a time, and with haptics alone: bit for bit what they were together."""
    alone = study(chunk=1, conditions=("with",))
    for n in range(3):
        for name, row in alone.run_chunk(n, device=device).items():
            np.testing.assert_array_equal(row[0], trials[name][1, n : n + 1], err_msg=name)


def test_pictures_and_seeds_matter(device, trials):
    slow = study(conditions=("with",), frame_rate=60.0).run_chunk(0, device=device)
    other = study(conditions=("with",), seed=12).run_chunk(0, device=device)
    assert np.all(slow["contact_mean"][0] != trials["contact_mean"][1])
    assert np.all(other["contact_mean"][0] != trials["contact_mean"][1])


def test_a_study_that_was_stopped_goes_on_to_the_same_bits(device, tmp_path):
    """Stopped after its first chunk, with half a second one on disk that nobody has marked as whole."""
    asked = study(chunk=1, duration=0.05)

    class Stop(Exception):
        pass

    def stop(done, count):
        if done == 1:
            raise Stop

    with pytest.raises(Stop):
        run_study(asked, tmp_path / "stopped", device=device, progress=stop)
    (tmp_path / "stopped" / "chunks" / "000001.npz").write_bytes(b"half")
    begun = (tmp_path / "stopped" / "chunks" / "000000.npz").stat().st_mtime_ns
    stopped = run_study(asked, tmp_path / "stopped", device=device)
    whole = run_study(asked, tmp_path / "whole", device=device).read()
    assert (tmp_path / "stopped" / "chunks" / "000000.npz").stat().st_mtime_ns == begun
    for name, row in stopped.read().items():
        np.testing.assert_array_equal(row, whole[name], err_msg=name)
    assert open_folder(tmp_path / "stopped").asked()["population"] == asked.population.sha256
    file = tmp_path / "whole" / "chunks" / "000001.npz"
    good = file.read_bytes()
    for damaged in (good[:-30], good[:200] + bytes(80) + good[280:], b""):
        file.write_bytes(damaged)
        with pytest.raises(InputError, match=r"000001\.npz: cannot be read \(.*\); allowed: the file that was written"):
            open_folder(tmp_path / "whole").read()


def test_another_study_is_refused_in_its_folder(tmp_path):
    create(tmp_path / "out", study())
    with pytest.raises(InputError, match="holds a study with another seed: 11 there, 12 now"):
        create(tmp_path / "out", study(seed=12))
    other = dataclasses.replace(study().population, sha256="0" * 64)
    with pytest.raises(InputError, match="another population"):
        create(tmp_path / "out", study(population=other))


def test_a_summary_says_that_it_is_simulated(device, tmp_path, capsys):
    asked = study(duration=0.05, operators=4, chunk=4, conditions=("without", "with", "no response"))
    found = summarise(run_study(asked, tmp_path / "out", device=device))
    assert found["simulated"] is True and found["operators"] == 4
    assert all(sum(row.values()) == 4 for row in found["outcomes"].values())
    assert set(found["compared"]) == {"with − without", "no response − without", "with − no response"}
    assert found["paper"]["with"]["value"] == 0.8 and found["paper"]["without"]["value"] == 0.3
    assert main(["operators", "show", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "time until the end [s]" in said and "mean contact force on the cell [pN]" in said


def test_sobol_points_share_the_random_numbers_of_their_row():
    asked = study(sobol=2)
    width = len(asked.population.parameters) + 2
    assert asked.count == 2 * width
    numbers = asked.numbers(np.arange(asked.count)).reshape(2, width)
    assert np.all(numbers == [[0], [1]])
    values = asked.values(np.arange(asked.count)).reshape(2, width, width - 2)
    changed = values[:, 2:] != values[:, :1]
    np.testing.assert_array_equal(changed, np.broadcast_to(np.eye(width - 2, dtype=bool), changed.shape))


def test_pressing_brings_the_hands_closer_together_and_changes_nothing_else():
    population = study().population
    plain, pressed = task_of(scene(), population), task_of(scene(), population, press=0.5)
    shift = pressed.path - plain.path
    np.testing.assert_allclose(shift[:, 50:], np.broadcast_to([[[0.5, 0, 0]], [[-0.5, 0, 0]]], shift[:, 50:].shape))
    np.testing.assert_array_equal(shift[:, 0], 0.0)
    np.testing.assert_array_equal(task_of(scene(), population, press=0.0).path, plain.path)


def test_the_motion_gain_brings_the_path_into_the_workspace():
    task = task_of(scene(), study().population)
    on_device = task.path[0] @ np.array(task.plans[0].config.axis_map) / task.motion_gain
    share = np.ptp(on_device, axis=0) / (0.75 * np.array([0.16, 0.12, 0.07]))
    assert np.max(share) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda: study(conditions=("blind",)), "conditions"),
        (lambda: study(operators=0), "operators"),
        (lambda: study(press=float("nan")), "press"),
        (lambda: study(sobol=3), "power of 2"),
        (lambda: study(scene=Scene.load("scenes/single_bead.usda")).task, "goal"),
        (lambda: study(force_gain=-1.0).task, "force_gain"),
        (lambda: study(frame_rate=2000.0).loop(np.arange(1), "cpu"), "frame rate"),
    ],
)
def test_what_cannot_be_is_refused(wrong, said):
    with pytest.raises(InputError, match=said) as error:
        wrong()
    assert "\n" not in str(error.value)
