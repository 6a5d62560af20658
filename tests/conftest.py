"""What all tests share: the device they run on, and whether the long statistical ones run."""

from __future__ import annotations

import os

# before NumPy loads: on two shared cores the threads of its matrix products wait for each other ten times longer than
# they work
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest

from otwarp.device import start_warp


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--validate", action="store_true", help="also run the long statistical tests")
    parser.addoption("--device", default="cpu", help="device of the tests that step: cpu (default), cuda:0, …")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--validate"):
        return
    skip = pytest.mark.skip(reason="long statistical test: run with --validate")
    for item in items:
        if "validate" in item.keywords:
            item.add_marker(skip)


@pytest.fixture(scope="session")
def device(request: pytest.FixtureRequest) -> str:
    """Name of the device under test; Warp runs, and is quiet."""
    start_warp()
    return request.config.getoption("--device")
