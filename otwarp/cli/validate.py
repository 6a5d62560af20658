"""`otwarp validate`: check a scene without running it."""

from __future__ import annotations

import json
from pathlib import Path

import click

from otwarp.cli.options import json_option, scene_argument


@click.command()
@scene_argument
@json_option
@click.pass_context
def validate(context: click.Context, scene: Path, as_json: bool) -> int:
    """Check SCENE against the vocabulary, USD's own validators and what a run needs. Exit code 2 if it cannot run."""
    from otwarp.scene.validate import validate as check

    report = check(scene)
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
