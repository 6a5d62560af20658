"""Files appear whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.files import written


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
