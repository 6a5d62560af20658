"""The benchmark of both forms in which a GPU steps worlds of some hundred bodies."""

from __future__ import annotations

import dataclasses

import pytest
import warp as wp

from benchmarks import contact_forms
from otwarp.errors import InputError
from tests.gpu_forms import take_gpu_forms


def test_both_forms_are_timed_and_go_the_same_way(monkeypatch: pytest.MonkeyPatch):
    take_gpu_forms(monkeypatch)
    case = dataclasses.replace(contact_forms.CASES["packed"], met=2)
    one, parts = (
        contact_forms.timed(case, 2, form, wp.get_device("cpu"), steps=2, rounds=2) for form in contact_forms.FORMS
    )
    assert one["phased"] is False and parts["phased"] is True
    assert one["touching"] == parts["touching"] > 0.5
    assert one["sweeps"] == parts["sweeps"] > 1.0 and parts["worst"] >= parts["sweeps"]


def test_a_cpu_has_one_form_alone():
    with pytest.raises(InputError, match="--device is cpu; allowed: a GPU"):
        contact_forms.measure("cpu")
