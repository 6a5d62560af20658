"""`otwarp envs play`: take an environment into your own hands, or watch a policy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from otwarp.cli.envs.options import task_options
from otwarp.cli.options.live import live_options, open_session, read_session, run_session
from otwarp.cli.output import json_text
from otwarp.cli.types import MOVIE, OutputPath
from otwarp.errors import InputError

PICTURES = 150
"""Most pictures of a movie."""
OF_EPISODES = ("name", "policy", "movie", "option", "seed", "device", "as_json")
"""Parameters that an episode of a policy has; the others are a session's."""


@click.command()
@click.argument("name")
@click.option("--policy", type=click.Choice(["random", "expert", "still"]), help="Let this policy act, without a page.")
@click.option("--movie", type=OutputPath(endings=MOVIE), metavar="FILE",
              help="With --policy: draw its first episode into a movie, .gif, .mp4 or .webm.")  # fmt: skip
@task_options
@live_options(page=True, browser=True)
def play(name: str, policy: str | None, movie: Path | None, option: tuple[str, ...], **options: Any) -> int:
    """Open the page of a live session on the scene of the environment NAME, or a scene with a goal, in your hands.

    The session steps the scene's file as it is: bodies touch, also where the task leaves that out (Navigate, Hold,
    Orient), and all starts, goals and values are the file's, not those of an episode.

    With --policy an episode of the task is run by a policy instead, with --seed, --device (default: cpu), --option and
    --json, and said what came of it; --movie draws it.
    """
    from otwarp.envs.registration import task_named
    from otwarp.envs.written_options import options_of

    task = task_named(name, **options_of(name, option))
    if policy is not None:
        _refuse_session_options()
        _watch(task, policy, movie, options)
        return 0
    if movie is not None:
        raise InputError("--movie without --policy; allowed: both")
    if option:
        raise InputError(f"--option {option[0]} without --policy, where the scene is stepped as it is; allowed: both")
    file = task.load().file
    if file is None:
        raise InputError(f"scene of {name} has no file, which a session needs; allowed: --policy")
    scene, session = read_session(file, options)
    return run_session(open_session(scene, session, options, None), options)


def _refuse_session_options() -> None:
    """Refuse what a live session has and an episode has not."""
    context = click.get_current_context()
    for parameter in context.command.params:
        given = context.get_parameter_source(str(parameter.name)) is not ParameterSource.DEFAULT
        if given and parameter.name not in OF_EPISODES:
            raise InputError(f"{parameter.opts[0]} with --policy, which runs no session; allowed: "
                             "--seed, --device, --option, --json, --movie")  # fmt: skip


def _watch(task: Any, policy: str, movie: Path | None, options: dict[str, Any]) -> None:
    """Run an episode, draw it if that is wanted, and say what came of it."""
    from otwarp.cli.progress import parts
    from otwarp.envs.picture import Picture
    from otwarp.envs.rollout import policy_of, run_policy
    from otwarp.preview.video import check_video, write_movie

    if movie is not None:
        check_video(movie)
    most = round(task.time_limit * task.rate)
    seed, device, as_json = options["seed"], options["device"] or "cpu", options["as_json"]
    every = max(1, round(task.rate / 10.0), -(-most // PICTURES))
    frames: list[Any] = []
    drawn: list[Any] = []
    acting = policy_of(task, policy, seed=seed)
    if movie is None:
        found = run_policy(task, acting, episodes=1, seed=seed, device=device)
    else:
        with parts("picture", "pictures, at most") as progress:

            def keep(batch: Any) -> None:
                """Draw every few periods."""
                if not drawn:
                    drawn.append(Picture(batch))
                if int(batch.episode.period.numpy()[0]) % every == 0:
                    frames.append(drawn[0].draw(0, annotated=True))
                    progress(len(frames), most // every + 1)

            found = run_policy(task, acting, episodes=1, seed=seed, device=device, watch=keep)
    end = int(found.outcome[0])
    told = {
        "environment": task.name,
        "policy": policy,
        "seed": seed,
        "success": bool(found.success[0]),
        "end": task.ends[end - 1].name if end > 0 else "out of time" if end == 0 else "no longer physical",
        "seconds": float(found.periods[0] / task.rate),
        "return": float(found.earned[0]),
    }
    word = "success" if told["success"] else "failure"
    click.echo(
        json_text(told)
        if as_json
        else f"{task.name}, {policy}, seed {seed}: {word} ({told['end']}) "
        f"after {told['seconds']:.2f} s, return {told['return']:.3f}"
    )
    if movie is not None:
        count = write_movie(frames, movie, task.rate / every)
        click.echo(f"wrote {movie} ({count} pictures)", err=as_json)
