"""`otwarp validate`: check a scene without running it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from otwarp.cli.options import json_option, scene_argument

if TYPE_CHECKING:
    from otwarp.scene.read.validate import Finding


SLOW = "computing force tables and mobilities of this scene, once: runs of it find them in the cache"


@click.command()
@scene_argument
@json_option
@click.option("--strict", is_flag=True, help="Let warnings count as errors.")
@click.pass_context
def validate(context: click.Context, scene: Path, strict: bool, as_json: bool) -> int:
    """Check SCENE against the vocabulary, USD's own validators, what a run needs and what is plausible.

    Exit code 2 if it cannot run, or with --strict if there is anything to warn of.
    """
    from otwarp.scene.read.validate import validate as check

    report = check(scene)
    findings = (*report.findings, *_findings_of_a_run(scene))
    if strict:
        findings = tuple(dataclasses.replace(finding, severity="error") for finding in findings)
    report = dataclasses.replace(report, findings=findings)
    if as_json:
        findings = [{"severity": f.severity, "prim": f.prim, "message": f.message} for f in report.findings]
        click.echo(json.dumps({"scene": str(scene), "valid": report.ok, "findings": findings}, indent=2))
    else:
        for finding in report.findings:
            click.echo(
                f"{finding.severity}: {scene}: {finding.prim}: {finding.message}", err=finding.severity == "error"
            )
        if report.ok:
            click.echo(f"{scene}: valid")
    return 0 if report.ok else 2


def _findings_of_a_run(scene: Path) -> list[Finding]:
    """What a run of a scene that loads would be refused for or warned of."""
    from otwarp.errors import InputError
    from otwarp.scene import Scene
    from otwarp.scene.read.validate import finding

    try:
        loaded = Scene.load(scene)
    except InputError:
        return []  # among the findings already
    from otwarp.cli.progress import said_if_long
    from otwarp.record import check_run

    try:
        with said_if_long(SLOW):
            return [finding(scene, text, "warning") for text in check_run(loaded)]
    except InputError as error:
        return [finding(scene, str(error))]
