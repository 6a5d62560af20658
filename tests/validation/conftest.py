"""What the validation tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.validation.laws import Law


@pytest.fixture
def expect_law(record_property) -> Law:
    """Compares with a law and records the figures."""
    return Law(record_property)


@pytest.fixture(scope="session")
def _tables(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("tables")


@pytest.fixture(autouse=True)
def cache(_tables, monkeypatch) -> Path:
    """Force tables of these tests are kept apart from the user's."""
    monkeypatch.setenv("OTWARP_CACHE", str(_tables))
    return _tables
