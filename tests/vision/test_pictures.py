"""What is said of a picture: bodies that its edge cuts."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from otwarp.cli.main import main
from otwarp.errors import PlausibilityWarning
from otwarp.vision.moment import moments
from otwarp.vision.pictures import picture
from otwarp.vision.rendering import Rendering
from otwarp.vision.stack import load_stack, save_stack
from tests.full_disk import largest_file


@pytest.mark.quick
def test_bodies_that_the_edge_cuts_are_named() -> None:
    seen = moments("scenes/single_bead.usda")
    with pytest.warns(PlausibilityWarning, match="rings is 1, too few"):
        found = [picture(seen, size=size, rendering=Rendering(rings=1, thickness=0.5), device="cpu").cut
                 for size in ((24, 24), (48, 24), (48, 48))]  # fmt: skip
    assert found == [("/World/bead",), ("/World/bead",), ()]


@pytest.mark.quick
def test_a_body_outside_the_frame_is_refused_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = Path("scenes/single_bead.usda").read_text(encoding="utf-8")
    scene = tmp_path / "away.usda"
    scene.write_text(text.replace("xformOp:translate = (0, 0, 10)", "xformOp:translate = (30, 40, 10)", 1))
    assert main(["vision", "render", str(scene), "--device", "cpu", "-o", str(tmp_path / "away.png")]) == 2
    assert capsys.readouterr().err == (
        "otwarp: no body is in the image, /World/bead is nearest, 50 µm from its middle; allowed: a larger --size, "
        "or --center /World/bead\n"
    )
    assert not (tmp_path / "away.png").exists()


@pytest.mark.quick
def test_a_scene_has_one_world(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "bead.png"
    assert main(["vision", "render", "scenes/single_bead.usda", "--world", "3", "-o", str(out)]) == 2
    said = "otwarp: --world is 3; allowed of a scene: 0, only recorded runs have several worlds\n"
    assert capsys.readouterr().err == said and not out.exists()


@pytest.mark.quick
@pytest.mark.parametrize("time", ["1e30", "1e300"])
def test_a_time_out_of_reach_is_refused_in_a_line(
    time: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bead.png"
    words = ["vision", "render", "scenes/single_bead.usda", "--time", time, "--device", "cpu", "-o", str(out)]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"otwarp: time is {float(time):g} s at a time step of ") and said.count("\n") == 1
    assert said.endswith(" steps; allowed: up to 1e+12 steps\n") and not out.exists()


@pytest.mark.quick
def test_the_command_says_how_far_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("otwarp.cli.progress.LONG", 0.0)
    words = ["--time", "3", "--size", "32x32", "--device", "cpu"]
    assert main(["vision", "render", "scenes/single_bead.usda", *words, "-o", str(tmp_path / "bead.png")]) == 0
    assert "otwarp: step 500 of 1464\n" in (said := capsys.readouterr().err) and "otwarp: step 1464 of 1464\n" in said


@pytest.mark.quick
def test_the_way_to_a_moment_is_counted() -> None:
    told: list[tuple[int, int]] = []
    moments("scenes/single_bead.usda", time=3.0, device="cpu", progress=lambda done, count: told.append((done, count)))
    counts = {count for _, count in told}
    assert len(told) > 2 and len(counts) == 1 and told[-1][0] == told[-1][1]
    assert [done for done, _ in told] == sorted({done for done, _ in told})


@pytest.mark.quick
@pytest.mark.parametrize("bits", [1, 8, 12])
def test_panels_are_white_at_full_scale(tmp_path: Path, bits: int) -> None:
    levels = np.zeros((1, 40, 40), dtype=np.uint8 if bits <= 8 else np.uint16)
    levels[:, :, 20:] = 2**bits - 1
    save_stack(tmp_path / "s.png", levels / levels.max(), levels, np.zeros(1), 0.1, bits)
    shown = np.array(Image.open(tmp_path / "s.png").convert("L")).astype(int)
    middle = shown[len(shown) // 2]
    assert (middle < 10).sum() > 100 and (middle > 245).sum() > 100
    save_stack(tmp_path / "s.tif", levels / levels.max(), levels, np.zeros(1), 0.1, bits)
    assert np.array_equal(load_stack(tmp_path / "s.tif"), levels)


@pytest.mark.quick
@pytest.mark.skipif(sys.platform != "linux", reason="needs RLIMIT_FSIZE")
@pytest.mark.parametrize("ending", [".npy", ".tif", ".png"])
def test_a_full_disk_is_said_and_leaves_nothing(tmp_path: Path, ending: str) -> None:
    """NumPy's own writer tells how many values it wrote, and no cause."""
    levels, file = np.random.default_rng(0).integers(0, 256, (3, 60, 60), dtype=np.uint8), tmp_path / f"s{ending}"
    with largest_file(4096), pytest.raises(OSError, match="File too large") as error:
        save_stack(file, levels / 255.0, levels, np.zeros(3), 0.1)
    assert error.value.filename == str(file)
    assert list(tmp_path.iterdir()) == []
