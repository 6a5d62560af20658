"""Misspelt keywords name the nearest one."""

from __future__ import annotations

import pytest

from otwarp.errors import InputError
from otwarp.scene.keywords import known_keywords


@known_keywords
def command(*, trap_position: float = 0.0) -> float:
    """What is judged."""
    return trap_position


def test_a_misspelt_keyword_names_the_nearest() -> None:
    assert command(trap_position=2.0) == 2.0
    with pytest.raises(InputError, match="trap_postion is unknown; did you mean trap_position"):
        command(trap_postion=2.0)  # type: ignore[call-arg]
