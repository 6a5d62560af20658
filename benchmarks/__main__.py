"""`python -m benchmarks [--write]`: run all benchmarks, print their tables, and put them into docs/benchmarks."""

from __future__ import annotations

from benchmarks import (
    budget,
    closed_loop,
    contact,
    contact_forms,
    crowd,
    envs,
    envs_grouped,
    envs_images,
    escape,
    forces,
    haptics,
    headlines,
    integrators,
    operators,
    precision,
    realtime,
    speed,
    stability,
    startup,
    study,
    teleop,
    terms,
    time_step,
    vision,
    vision_networks,
    vision_shifted,
    vision_tracking,
    worlds,
)
from benchmarks.report import PAGES, check_places, options, run, save_json, write_pages

BENCHMARKS = {
    "startup": startup.measure,
    "realtime": realtime.measure,
    "terms": terms.measure,
    "forces": forces.measure,
    "integrators": integrators.measure,
    "time_step": time_step.measure,
    "precision": precision.measure,
    "speed": speed.measure,
    "contact": contact.measure,
    "contact_forms": contact_forms.measure,
    "crowd": crowd.measure,
    "worlds": worlds.measure,
    "envs": envs.measure,
    "envs_grouped": envs_grouped.measure,
    "envs_images": envs_images.measure,
    "study": study.measure,
    "escape": escape.measure,
    "vision": vision.measure,
    "vision_networks": vision_networks.measure,
    "vision_shifted": vision_shifted.measure,
    "vision_tracking": vision_tracking.measure,
    "closed_loop": closed_loop.measure,
    "stability": stability.measure,
    "budget": budget.measure,
    "haptics": haptics.measure,
    "teleop": teleop.measure,
    "operators": operators.measure,
}

ON_GPUS = {"contact_forms"}
"""What a CPU has nothing to measure of: left out there, unless asked for."""


def main() -> None:
    """Command line."""
    parser = options("Run the benchmarks.", rounds=None)
    parser.add_argument("--only", choices=list(BENCHMARKS), help="run one of them")
    parser.add_argument("--write", action="store_true", help="rewrite the tables of docs/benchmarks")
    arguments = parser.parse_args()
    rounds = {} if arguments.rounds is None else {"rounds": arguments.rounds}
    every = [name for name in BENCHMARKS if arguments.device != "cpu" or name not in ON_GPUS]
    asked = [arguments.only] if arguments.only else every
    pages = [*(PAGES / f"{name}.md" for name in asked), headlines.SUMMARY]
    check_places(arguments.out, pages if arguments.write else ())
    sections = []
    for name in asked:
        section = BENCHMARKS[name](arguments.device, **rounds)
        print(section.markdown(), flush=True)
        sections.append(section)
    if arguments.out:
        save_json(arguments.out, sections)
    if arguments.write:
        # written together at the end, so that a benchmark cut off in the middle changes nothing
        write_pages(sections)
        headlines.write()


if __name__ == "__main__":
    run(main)
