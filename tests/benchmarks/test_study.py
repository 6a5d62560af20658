"""The benchmark of studies: whether several devices store the bits of one."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import study

pytest.importorskip("zarr")


def test_two_shares_store_the_bits_of_one(monkeypatch):
    """Two threads of a CPU in place of two GPUs, and a second set that gets one bit wrong."""
    small = study.capture_map(4, 8, until=0.002).in_blocks((2, 4))
    assert len(small.blocks()) == 2
    assert study.same_bits(small, [["cpu"], ["cpu", "cpu"]]) == [True, True]
    kept, sets = study.run_study, []

    def wrong(*given, **how):
        store = kept(*given, **how)
        sets.append(how["devices"])
        if len(sets) == 2:
            where = small.blocks()[1]
            time = store.block("end_time", where)
            time[0, 0, 0] = np.nextafter(time[0, 0, 0], np.float32(0.0))
            store._put("end_time", where, time)
        return store

    monkeypatch.setattr(study, "run_study", wrong)
    assert study.same_bits(small, [["cpu"], ["cpu"]]) == [True, False]
