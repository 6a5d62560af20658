"""`otwarp vision export`: a network as a file that other programs run."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.types import FILE, OutputPath


@click.command()
@click.argument("run", type=FILE)
@click.option("--onnx", type=OutputPath(), metavar="FILE",
              help="Gets the network; ends with .onnx; default: robot.onnx in RUN.")  # fmt: skip
def export(run: Path, onnx: Path | None) -> None:
    """Write the network of the training RUN as ONNX: images of its data set in, what its heads say out."""
    from otwarp.vision.networks.onnx_file import export as exported

    file = onnx or (run.parent if run.is_file() else run) / "robot.onnx"
    names = exported(run, file)
    click.echo(f"wrote {file}: images in; {', '.join(names)} out")
