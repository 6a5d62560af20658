"""The user study, with SIMULATED operators: deliveries with and without haptics, beside the paper's ten and ten."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from otwarp.device import pick_device
from otwarp.operators.figure import draw
from otwarp.operators.folder import run_study
from otwarp.operators.statistics import rate_as_g
from otwarp.operators.study import CHUNK_CPU, CHUNK_GPU, OperatorStudy
from otwarp.operators.summary import PAPER, summarise
from otwarp.reproduce.item import Comparison, Figure, Request, Result, Table, Value, shown
from otwarp.reproduce.measures import difference_of_shares, fisher, share
from otwarp.ros.contract import ContractConfig

FORCES = PAPER["contact"]
DISTANCES = {"with": (0.02, 0.026), "without": (0.04, 0.058)}
"""Mean and spread of the robot–trap distance of the paper's trials [scene units]."""
WORDS = {"with": "with haptics", "without": "without", "no response": "haptics, arm alone"}

DEFINITION = """Operators are SIMULATED: models of people at haptic devices (previewed path, minimum-jerk movements,
delayed visual correction, motor noise, a passive arm, a delayed response to force), drawn from distributions that
were frozen with their sources before the first trial, none of them fitted to the paper. Every operator delivers the
cell of `cell_delivery.usda` with and without haptics, with the same random numbers; haptics enter by the force on the
hand alone. A success is a delivery. The paper's groups are ten trials each; p is Fisher's exact test, two-sided, of
those; the interval of its difference is Newcombe's."""

DIFFERENCE = """Ten trials a group say little: the paper's 8 against 3 has p ≈ 0.07. Thousands of simulated trials say
exactly what a model of operators does, and only as much about people as the model is like them. What the simulated
operators show, benefit or none, is given as it came out. The probability that ten and ten of them would show at least
8 and at most 3 says whether the paper's table is what this model would expect."""

INCOMPARABLE = (
    "Who the paper's operators were, how they were trained, in which order the conditions came and whether the same "
    "person "
    "had both is not stated.",
    "Its contact force and distance are means over one trial's time; of simulated trials they are means over the "
    "trials' means.",
    "Simulated operators follow the authored path; the people of the paper found their own.",
)


def run(request: Request) -> Result:
    """Let simulated operators work, summarise, draw."""
    where = str(pick_device(request.device))
    study = OperatorStudy(
        scene=request.scene("cell_delivery"),
        operators=request.choose(96, 2000),
        seed=request.seed,
        conditions=("without", "with", "no response"),
        chunk=CHUNK_GPU if where.startswith("cuda") else min(CHUNK_CPU, 16),
    )

    def progress(done: int, chunks: int) -> None:
        request.say(f"simulated operators, part {done} of {chunks}")

    folder = run_study(study, request.work / "study", device=where, progress=progress)
    found = summarise(folder)
    draw(folder, request.folder / "user_study.png")
    return Result(
        comparisons=_comparisons(found),
        definition=DEFINITION,
        difference=DIFFERENCE,
        incomparable=INCOMPARABLE,
        computed={"scene": "cell_delivery.usda", "simulated operators": f"{found['operators']}, each under three "
                                                                        f"conditions",
                  "population": f"population.toml, SHA-256 {found['population sha256'][:12]}…",
                  "seed": str(request.seed)},
        tables=(_outcomes(found), _differences(found)),
        figures=(Figure(file="user_study.png", caption="SIMULATED operators: how trials ended, contact force, and "
                                                       "standardised "
                        "differences beside those of people in meta-analyses."),),
        numbers=found,
    )  # fmt: skip


def _comparisons(found: Mapping[str, Any]) -> tuple[Comparison, ...]:
    first, second, rows = PAPER["with"], PAPER["without"], []
    unit = ContractConfig().scene_unit
    for name in ("with", "without"):
        rate, made = found["success"][name], PAPER[name]
        rows.append(Comparison(what=f"success, {WORDS[name]}", grade="S", key=True,
                               paper=Value(number=made[0] / made[1], interval=share(*made)[1]),
                               ours=_rate(rate), remark="simulated operators"))  # fmt: skip
    ours = found["compared"]["with − without"]
    d, ends = difference_of_shares(first, second)
    rows += [
        Comparison(what="difference of success", grade="D", key=True, paper=Value(number=d, interval=ends),
                   ours=_rate(ours["risk difference"]), remark="simulated operators, pairs"),
        Comparison(what="p of no difference", grade="D", paper=Value(number=fisher(first, second)),
                   ours=Value(number=ours["p"]), remark="Fisher, 10 + 10; McNemar on simulated pairs"),
        Comparison(what="Hedges' g of success", grade="D", paper=Value(number=rate_as_g(0.8, 0.3, 10)),
                   ours=Value(number=ours["g of success"]), remark="simulated operators: ln(odds ratio)·√3/π"),
        Comparison(what="chance of at least 8 and at most 3 of 10", paper=Value(text="observed"), grade="S",
                   ours=_rate(found["small study"]["at least 8 and at most 3 of 10"]),
                   remark="that 10 + 10 simulated trials show the paper's table"),
    ]  # fmt: skip
    for name in ("with", "without"):
        force, distance = (found["numbers"][name][key] for key in ("contact_mean", "distance_mean"))
        rows += [
            Comparison(what=f"contact force, {WORDS[name]}", unit="pN", grade="S",
                       paper=Value(number=FORCES[name][0], spread=FORCES[name][1]),
                       ours=Value(number=force["mean"], spread=force["deviation"]),
                       remark="simulated: ± over operators, on the cell"),
            Comparison(what=f"robot–trap distance, {WORDS[name]}", unit="scene units", grade="S",
                       paper=Value(number=DISTANCES[name][0], spread=DISTANCES[name][1]),
                       ours=Value(number=distance["mean"] / unit, spread=distance["deviation"] / unit),
                       remark=f"simulated: {shown(distance['mean'])} µm"),
        ]  # fmt: skip
    return tuple(rows)


def _rate(said: Mapping[str, float]) -> Value:
    low, high = said.get("low"), said.get("high")
    return Value(number=said["value"], interval=None if low is None or high is None else (low, high))


def _outcomes(found: Mapping[str, Any]) -> Table:
    ends = list(next(iter(found["outcomes"].values())))
    rows = tuple((WORDS[name], *(str(said[end]) for end in ends)) for name, said in found["outcomes"].items())
    return Table(title="How trials of simulated operators ended", head=("condition", *ends), rows=rows,
                 note=f"{found['operators']} simulated operators.")  # fmt: skip


def _differences(found: Mapping[str, Any]) -> Table:
    rows = []
    for name, said in found["compared"].items():
        for measure, g in said["g"].items():
            rows.append((f"{name}: {measure.replace('_', ' ')}", f"{_rate(g).said()}"))
    for name, said in found["literature"].items():
        rows.append((f"people: {name}", _rate(said).said()))
    return Table(title="Standardised differences (Hedges' g), above 0 where haptics are better",
                 head=("condition and measure, simulated; people in meta-analyses", "g"), rows=tuple(rows))  # fmt: skip
