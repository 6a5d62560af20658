"""The `otwarp` command: finds the subcommand, and turns errors into one line and an exit code."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click

from otwarp.cli import stop
from otwarp.cli.lazy import LazyGroup
from otwarp.cli.stop import EXIT_INTERRUPTED, Terminated, terminable
from otwarp.errors import InputError, SimulationError, is_full_memory

COMMANDS = {
    "run": "Simulate a scene and record it.",
    "info": "Say what a scene holds, how it will be stepped, and why.",
    "scenes": "What comes with otwarp: scenes, studies and data sets, by name.",
    "new": "Write a scene or study to begin with.",
    "import": "Make a mesh of a file an obstacle of a scene.",
    "validate": "Check a scene without running it.",
    "preview": "Draw a scene or a recorded run.",
    "view": "Play recorded runs back in the browser.",
    "edit": "Draw a scene in the browser: traps, cells, obstacles, goals, paths.",
    "export": "Write a scene or a recorded run for other programs: USD in metres or meshes, glTF.",
    "analyse": "Calibrate traps, and more, from a recorded run or a study.",
    "study": "Batched studies: trials of a scene at many points.",
    "vision": "What the microscope of a scene sees.",
    "envs": "Environments of Gymnasium: tasks in scenes, thousands at once.",
    "teleop": "Run a scene live: traps by mouse or by hand, felt and seen.",
    "ros1": "Run a scene live with the paper's ROS 1 topics.",
    "ros2": "Run a scene live with ROS 2 topics.",
    "operators": "Simulated operators at a scene's task, with and without haptics.",
    "haptics": "Hands: find their devices, measure their servo, replay their recordings.",
    "forces": "Evaluate the optical force on a sphere exactly.",
    "mobility": "Say how the bodies of a scene diffuse, and how well that is known.",
    "decompose": "Turn a closed mesh into spheres.",
    "reproduce": "Regenerate every table and figure of the paper, beside the published ones.",
    "bench": "Measure what accuracy costs on this machine.",
}
"""Subcommands and their one-line help; each lives in the module of its name and is imported when called."""

EXIT_SYSTEM = 1
EXIT_BAD_INPUT = 2
EXIT_STOPPED = 3
EXIT_TERMINATED = 143


class Stopped(Exception):
    """An interrupt on its way through click, which would print an empty line at a KeyboardInterrupt."""


class Otwarp(LazyGroup):
    """The whole command line."""

    def invoke(self, ctx: click.Context) -> Any:
        """Call the subcommand."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            raise Stopped(error) from error


@click.group(
    cls=Otwarp,
    package="otwarp.cli",
    rows=COMMANDS,
    invoke_without_command=True,
    epilog="""Completion of commands and options: eval "$(_OTWARP_COMPLETE=bash_source otwarp)" in ~/.bashrc; zsh_source
    in ~/.zshrc; for fish, _OTWARP_COMPLETE=fish_source otwarp > ~/.config/fish/completions/otwarp.fish""",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(package_name="otwarp", prog_name="otwarp")
@click.pass_context
def cli(context: click.Context) -> None:
    """Digital twin of an optical-tweezers microrobotics lab.

    Scenes are USD stages; lengths in their files are micrometres. Exit codes: 0 done, 1 the system would not (disk
    full, folder gone), 2 bad input, 3 the simulation stopped because its state was no longer physical, 130
    interrupted, 143 terminated.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit code; every error is one line on standard error."""
    try:
        with terminable(), plain_warnings():
            result = cli.main(args=arguments, prog_name="otwarp", standalone_mode=False)
        return result if isinstance(result, int) else 0
    except click.ClickException as error:
        return _fail(error.format_message(), EXIT_BAD_INPUT)
    except InputError as error:
        return _fail(str(error), EXIT_BAD_INPUT)
    except SimulationError as error:
        return _fail(str(error), EXIT_STOPPED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _fail(f"{where}{error.strerror or error}", EXIT_SYSTEM)
    except MemoryError as error:
        return _fail(f"the memory of this machine does not suffice: {error or 'an allocation failed'}", EXIT_SYSTEM)
    except RuntimeError as error:
        if not is_full_memory(error):
            raise
        words = " ".join(str(error).split())[:100]
        return _fail(f"the memory of the device does not suffice: {words}", EXIT_SYSTEM)
    except Stopped as error:
        stop.answered = True
        terminated = isinstance(error.__cause__, Terminated)
        return _fail(*(("terminated", EXIT_TERMINATED) if terminated else ("interrupted", EXIT_INTERRUPTED)))
    except (KeyboardInterrupt, click.Abort):
        stop.answered = True
        return _fail("interrupted", EXIT_INTERRUPTED)


@contextmanager
def plain_warnings() -> Iterator[None]:
    """Say every warning once, in one line, without the place in otwarp's source that it comes from."""
    kept, said = warnings.formatwarning, set()

    def line(message: Warning | str, *where: object) -> str:
        """The warning, once."""
        text = " ".join(str(message).split())
        if text in said:  # Python forgets what it has said whenever its filters change
            return ""
        said.add(text)
        return f"otwarp: warning: {text}\n"

    warnings.formatwarning = line
    try:
        yield
    finally:
        warnings.formatwarning = kept


def _fail(message: str, code: int) -> int:
    print("otwarp: " + " ".join(message.split()), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
