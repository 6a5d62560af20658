from __future__ import annotations

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.core import Device, DeviceLost
from otwarp.haptics.devices import create_device, parse_devices
from otwarp.haptics.devices.replay import ReplayDevice

coordinate = st.floats(-10.0, 10.0, allow_nan=False)
takes = st.lists(
    st.tuples(st.floats(0.0, 1e3), st.tuples(coordinate, coordinate, coordinate), st.integers(0, 2**32 - 1)),
    min_size=1,
    max_size=20,
    # times nearer than the clock's rounding cannot be told apart
    unique_by=lambda row: round(row[0], 6),
).map(sorted)


def write(file, rows):
    if file.suffix == ".csv":
        lines = ["time,x,y,z,force,buttons"] + [f"{t!r},{x!r},{y!r},{z!r},9,{b}" for t, (x, y, z), b in rows]
    else:
        lines = [json.dumps({"time": t, "position": p, "buttons": b, "more": {}}) for t, p, b in rows]
    file.write_text("\n".join(lines) + "\n")
    return file


def opened(file, option=""):
    (spec,) = parse_devices([f"replay:{file}{option}"])
    device = create_device(spec)
    assert isinstance(device, Device)
    device.open()
    return device


@given(rows=takes, ending=st.sampled_from([".csv", ".jsonl"]), start=st.floats(0.0, 1e4))
@settings(max_examples=60, deadline=None)
def test_every_sample_comes_back_bit_for_bit_at_its_time(tmp_path_factory, rows, ending, start):
    device = opened(write(tmp_path_factory.mktemp("take") / f"take{ending}", rows))
    for time, position, buttons in rows:
        sample = device.read(start + (time - rows[0][0]))
        assert (sample.position, sample.buttons, sample.fresh) == (position, buttons, True)


TAKE = [(5.0, (0.1, 0.0, 0.0), 1), (5.01, (0.2, 0.0, 0.0), 3), (5.02, (0.3, 0.0, 0.0), 1)]


@pytest.fixture
def take(tmp_path):
    return write(tmp_path / "take, two=2.csv", TAKE)


def test_samples_are_held_between_their_times_and_the_end_lets_go(take):
    device = opened(take)
    assert device.info.force == 0.0
    seen = [device.read(70.0 + t) for t in (0.0, 0.009, 0.01, 0.015, 0.02, 0.03)]
    assert [s.position[0] for s in seen] == [0.1, 0.1, 0.2, 0.2, 0.3, 0.3]
    assert [s.buttons for s in seen] == [1, 1, 3, 3, 1, 0]
    assert [s.fresh for s in seen] == [True] * 5 + [False]
    device.write((1.0, 0.0, 0.0))
    device.close()
    with pytest.raises(DeviceLost):
        device.read(71.0)
    device.open()  # from the start
    assert device.read(99.0).position[0] == 0.1


def test_a_loop_starts_again(take):
    device = opened(take, ",loop=1")
    seen = [device.read(t).position[0] for t in (0.0, 0.02, 0.021, 0.031, 0.042)]
    assert seen == [0.1, 0.3, 0.1, 0.2, 0.1]
    with pytest.raises(InputError, match="loop = 'yes' must be 0 or 1"):
        opened(take, ",loop=yes")


def test_the_same_clock_gives_the_same_samples(take):
    one, two = opened(take), opened(take)
    for k in range(40):
        assert one.read(0.001 * k) == two.read(0.001 * k)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.csv", "", "line 1: header lacks time, x, y, z"),
        ("a.csv", "time,x,y\n0,0,0\n", "header lacks z"),
        ("a.csv", "time,x,y,z\n", "holds no sample"),
        ("a.csv", "time,x,y,z\n0,0,0\n", "line 2: must hold numbers"),
        ("a.csv", "time,x,y,z\n0,0,zero,0\n", "line 2: must hold numbers"),
        ("a.csv", "time,x,y,z\n0,0,0,0\n0,0,0,0\n", "line 3: time = 0.0 must be a number above"),
        ("a.csv", "time,x,y,z\nnan,0,0,0\n", "line 2: time = nan"),
        ("a.csv", "time,x,y,z\n0,inf,0,0\n", "line 2: position"),
        ("a.csv", "time,x,y,z\n0,nan,0,0\n", "line 2: position"),
        ("a.csv", "time,x,y,z,buttons\n0,0,0,0,-1\n", "line 2: buttons = -1"),
        ("a.csv", "time,x,y,z,buttons\n0,0,0,0,1.5\n", "line 2: must hold numbers"),
        ("a.csv", 'time,x,y,z\n"0,0,0,0\n', "is not CSV"),
        ("a.jsonl", "{}\n", "line 1: must be"),
        ("a.jsonl", "[1]\n", "line 1: must be"),
        ("a.jsonl", '{"time": 0, "position": [0, 0]}\n', "line 1: position"),
        ("a.jsonl", '{"time": 0, "position": [0, 0, 1e3]}\n', r"line 1: position .* ±10 m"),
        ("a.jsonl", '{"time": 0, "position": 3}\n', "line 1: must be"),
        ("a.jsonl", '\n{"time": 0, "position": [0, 0, 0], "buttons": 1e999}\n', "line 2: must be"),
        ("a.jsonl", "\n", "holds no sample"),
        ("a.txt", "", "must be one of .mcap, .mcap.part, .bag, .db3, .csv, .jsonl"),
        ("none.csv", None, "cannot be read"),
    ],
)
def test_bad_recordings_are_one_clear_line(tmp_path, name, text, says):
    file = tmp_path / name
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=says) as error:
        ReplayDevice(file).open()
    assert "\n" not in str(error.value)
    assert name in str(error.value)


@given(data=st.binary(max_size=200), ending=st.sampled_from([".csv", ".jsonl"]), header=st.booleans())
@settings(max_examples=100, deadline=None)
def test_no_bytes_do_more_than_raise_one_line(tmp_path_factory, data, ending, header):
    file = tmp_path_factory.mktemp("junk") / f"junk{ending}"
    file.write_bytes((b"time,x,y,z,buttons\n" if header else b"") + data)
    device = ReplayDevice(file)
    try:
        device.open()
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert device.read(0.0).fresh
