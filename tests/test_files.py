"""Files appear whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.files import check_place, made_apart, written, written_together


def test_a_file_takes_its_name_when_it_is_whole(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("old")
    with written(file) as part:
        part.write_text("new")
        assert part.suffix == ".csv" and file.read_text() == "old"
    assert file.read_text() == "new" and list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), ValueError("not finite"), KeyboardInterrupt()]
)
def test_a_file_that_fails_leaves_what_was_there(tmp_path: Path, error: BaseException) -> None:
    file = tmp_path / "a.csv"
    file.write_text("old")
    with pytest.raises(type(error)), written(file) as part:
        part.write_text("half")
        raise error
    assert file.read_text() == "old" and list(tmp_path.iterdir()) == [file]


def test_an_error_names_what_cannot_be_written(tmp_path: Path) -> None:
    with (
        pytest.raises(InputError, match=r"^--json cannot be written: No such file"),
        written(tmp_path / "none" / "a.json", "--json") as part,
    ):
        part.write_text("{}")


def test_a_place_for_an_output_is_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """/proc says that it can be written, also to root, and refuses."""
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    files = (tmp_path, tmp_path / "none" / "a", tmp_path / "file" / "a", tmp_path / ("x" * 300), Path("/proc/a"))
    folders = (tmp_path / "file", tmp_path / "file" / "a", tmp_path / "link", tmp_path / ("x" * 300), Path("/proc/a"))
    for bad, folder in [(p, False) for p in (*files, Path("/dev/null"))] + [(p, True) for p in folders]:
        with pytest.raises(InputError, match=r"^--out is .*, which cannot be written \(.*\); allowed: a") as error:
            check_place(bad, "--out", folder=folder)
        assert str(bad) in str(error.value) and "\n" not in str(error.value)
    (tmp_path / ".otwarp-a1b2c3d4").mkdir()  # of a process that was killed while it tried the place
    monkeypatch.chdir(tmp_path)
    for good, folder in ((Path("file"), False), (Path("new"), False), (Path("deep/new"), True), (Path(), True)):
        check_place(good, "--out", folder=folder)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "link"]
    assert (tmp_path / "file").read_text() == "in the way"


@pytest.mark.parametrize("inside", [True, False])
def test_a_full_disk_is_told_of_the_folder_or_of_what_else_was_written(tmp_path: Path, inside: bool) -> None:
    """What is written elsewhere while a folder is made keeps its name in the error."""
    other = tmp_path / "work" / "checkpoint.pt"
    with pytest.raises(OSError) as caught, made_apart(tmp_path / "item", "item.json") as apart:
        raise OSError(28, "No space left on device", str(apart / "figure.png" if inside else other))
    assert caught.value.filename == str(tmp_path / "item" if inside else other)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("there", [True, False])
def test_files_get_into_a_folder_together_or_not_at_all(tmp_path: Path, there: bool) -> None:
    folder = tmp_path / "report"
    if there:
        folder.mkdir()
        (folder / "a.png").write_text("old")
    before = {p.name: p.read_text() for p in folder.glob("*")}
    for error in (OSError(28, "No space left on device"), KeyboardInterrupt()):
        with pytest.raises(type(error)), written_together(folder) as apart:
            (apart / "a.png").write_text("new")
            raise error
        assert folder.exists() == there and {p.name: p.read_text() for p in folder.glob("*")} == before
    with pytest.raises(OSError, match="No space") as caught, written_together(folder) as apart:
        (apart / "a.png").write_text("new")
        raise OSError(28, "No space left on device", str(apart / "b.png"))
    assert caught.value.filename == str(folder / "b.png")
    with written_together(folder) as apart:
        for name in ("a.png", "b.md"):
            (apart / name).write_text("new")
    assert {p.name: p.read_text() for p in folder.iterdir()} == {"a.png": "new", "b.md": "new"}


def test_a_folder_in_the_way_of_one_of_several_files_changes_none(tmp_path: Path) -> None:
    (tmp_path / "b.md").mkdir()
    with pytest.raises(IsADirectoryError) as caught, written_together(tmp_path) as apart:
        for name in ("a.png", "b.md"):
            (apart / name).write_text("new")
    assert caught.value.filename == str(tmp_path / "b.md") and [p.name for p in tmp_path.iterdir()] == ["b.md"]
