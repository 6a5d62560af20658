"""Speed beside other programs: the section of `otwarp bench speed`, with all peers, for docs/benchmarks/speed.md."""

from __future__ import annotations

from typing import Any

from benchmarks.peers import (
    c_crowd,
    cupy_bead,
    jax_bead,
    lammps_bead,
    lammps_crowd,
    numba_crowd,
    openmm_bead,
    openmm_crowd,
    torch_bead,
)
from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.speed import workloads
from otwarp.bench.speed.measure import bench_speed
from otwarp.bench.speed.table import table
from otwarp.bench.speed.workloads import PeerCode
from otwarp.device import pick_device

BEAD_PEERS = (
    *workloads.BEAD_PEERS,
    PeerCode(label="torch", code=torch_bead),
    PeerCode(label="jax", code=jax_bead),
    PeerCode(label="cupy", code=cupy_bead),
    PeerCode(label="lammps", code=lammps_bead),
    PeerCode(label="openmm", code=openmm_bead),
    PeerCode(label="cupy, fast intrinsics", code=cupy_bead, kinds=("cuda",), options={"fast": True}),
)
MANY_BODY_PEERS = (
    PeerCode(label="c", code=c_crowd),
    PeerCode(label="numba", code=numba_crowd),
    PeerCode(label="lammps", code=lammps_crowd),
    PeerCode(label="openmm", code=openmm_crowd),
)


def measure(device: str = "cpu", **how: Any) -> Section:
    """All cases, or the `cases` given; see `bench_speed`."""
    machine = Machine.look(pick_device(device))
    found = bench_speed(device=device, bead_peers=BEAD_PEERS, many_body_peers=MANY_BODY_PEERS, **how)
    tables = [table(found, "Speed, beside other programs")]
    return Section(name="speed", kind=found.kind, machine=machine, tables=tables, data=found.json())


if __name__ == "__main__":
    command(
        measure,
        "Speed beside other programs.",
        rounds=7,
        case={"dest": "cases", "nargs": "+", "default": (), "help": "cases to measure"},
    )
