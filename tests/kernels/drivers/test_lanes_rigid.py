"""Rigid bodies in the CPU's form of the `solo` driver, alone and beside lone spheres: as in `test_lanes`."""

from __future__ import annotations

import pytest
import warp as wp

from tests.kernels.drivers import test_lanes as lanes


@pytest.fixture(autouse=True)
def cpu(device):
    if not wp.get_device(device).is_cpu:
        pytest.skip("the form for CPUs")


@pytest.mark.parametrize("name", ["rigid", "mixed"])
def test_bits_are_those_of_a_thread_of_its_own(name, device):
    lanes.test_bits_are_those_of_a_thread_of_its_own(name, device)


def test_escapes_are_those_of_a_thread_of_its_own(device):
    lanes.test_escapes_are_those_of_a_thread_of_its_own("mixed", device)


def test_noise_is_looked_at_across_the_end_of_a_block(device):
    lanes.test_every_integrator("rigid", "leimkuhlerMatthews", device)


def test_noise_is_that_of_the_scene(device):
    lanes.test_every_noise("rigid", "uniform", device)


def test_calls_and_threads_leave_no_trace(device):
    lanes.test_calls_and_threads_leave_no_trace("mixed", device)


def test_a_body_with_a_fault_stops_alone(device):
    lanes.test_a_body_with_a_fault_stops_alone("rigid", device)
