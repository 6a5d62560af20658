"""Everything that can be said about a stage before it runs: errors that stop it, and things worth a warning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene import vocabulary
from otwarp.scene.description import Body, Trap, Vec3
from otwarp.scene.finding import Finding
from otwarp.scene.plausibility import judge
from otwarp.scene.read.attributes import read_values
from otwarp.scene.read.diagnostics import USD_ERRORS, quiet_usd, usd_reason
from otwarp.scene.read.load import read_stage
from otwarp.scene.read.source import Source, open_stage
from otwarp.scene.scene import Scene

_LIGHTS = ("DistantLight", "DomeLight", "SphereLight", "RectLight", "DiskLight", "CylinderLight")
_BRANCH = ("threshold", "inverse_square", "offset")


@dataclass(frozen=True, kw_only=True)
class Report:
    """What `validate` found in a file.

    Attributes:
        file: The stage.
        findings: All of them, errors and warnings.
    """

    file: Path
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that stop a run."""
        return tuple(finding for finding in self.findings if finding.severity == "error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that do not stop a run."""
        return tuple(finding for finding in self.findings if finding.severity == "warning")

    @property
    def ok(self) -> bool:
        """Whether the file can be run."""
        return not self.errors


def validate(path: str | Path) -> Report:
    """Load a stage and run every USD validator on it; bad input becomes an error of the report, not an exception.

    What only a model of the scene can tell, for instance a time step that is unstable in its traps, is not looked at:
    see `otwarp.record.run.check_run`; `otwarp validate` does both.

    Args:
        path: USD file, as for `Scene.load`.

    Returns:
        The report: the loader's error if any, the errors and warnings of USD's own validators, advice, then what is
        implausible.
    """
    path = Path(path)
    try:
        stage = open_stage(path)
    except InputError as error:
        return Report(file=path, findings=(finding(path, str(error)),))
    findings: list[Finding] = []
    fields = None
    try:
        fields = read_stage(stage, file=str(path))
    except InputError as error:
        findings.append(finding(path, str(error)))
    with quiet_usd():
        findings += [found for found in _usd_findings(stage) if not _said(found, findings)]
        if fields is not None:
            findings += _advice(Source(stage, str(path)), fields["bodies"], fields["traps"])
            findings += judge(Scene(**fields))
    return Report(file=path, findings=tuple(findings))


def finding(path: Path, text: str, severity: Literal["error", "warning"] = "error") -> Finding:
    """The finding that one line `FILE: PRIM: …` about a file is; about the stage where it names no prim."""
    text = text.removeprefix(f"{path}: ")
    prim, _, rest = text.partition(": ")
    named = prim.startswith("/") and " " not in prim and bool(rest)
    return Finding(severity=severity, prim=prim if named else "/", message=rest if named else text)


def _usd_findings(stage: Usd.Stage) -> list[Finding]:
    try:
        from pxr import UsdValidation
    except ImportError:
        message = "this USD has no UsdValidation: its own validators were not run"
        return [Finding(severity="warning", prim="/", message=message)]
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    findings = []
    try:
        errors = UsdValidation.ValidationContext(validators).Validate(stage)
    except USD_ERRORS as error:
        message = f"USD's own validators stopped: {usd_reason(error)}"
        return [Finding(severity="error", prim="/", message=message)]
    for error in errors:
        serious = error.GetType() == UsdValidation.ValidationErrorType.Error
        try:
            text = " ".join(error.GetMessage().split())
        except UnicodeDecodeError as undecodable:  # it quotes the file's own bytes
            text = usd_reason(undecodable)
        message = f"{text} [{error.GetIdentifier()}]"
        findings.append(Finding(severity="error" if serious else "warning", prim=_site(error), message=message))
    return sorted(findings, key=lambda finding: (finding.severity, finding.prim, finding.message))


def _said(found: Finding, ours: Sequence[Finding]) -> bool:
    """Whether a validator of USD only says again what the reader has refused: `PRIM: NAME = …`."""
    for one in ours:
        name, separator, _ = one.message.partition(" = ")
        place = name if one.prim == "/" else f"<{one.prim}.{name}>"
        if separator and place in found.message:
            return True
    return False


def _site(error: Any) -> str:
    for site in error.GetSites():
        if site.IsPrim():
            return str(site.GetPrim().GetPath())
        if site.IsProperty():
            return str(site.GetProperty().GetPath())
    return "/"


def _advice(source: Source, bodies: Sequence[Body], traps: Sequence[Trap]) -> list[Finding]:
    prims = list(Usd.PrimRange(source.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    findings = _unused(source, prims)
    cameras = [prim for prim in prims if prim.IsA(UsdGeom.Camera)]
    if not cameras:
        findings.append(Finding(severity="warning", prim="/", message="no camera: viewers choose their own view"))
    if not any(prim.GetTypeName() in _LIGHTS for prim in prims):
        findings.append(Finding(severity="warning", prim="/", message="no light: viewers add their own or stay dark"))
    points = [body.position for body in bodies] + [tuple(trap.position.values[0]) for trap in traps]
    for prim in cameras:
        findings += _clipping(source, prim, points)
    return findings


def _unused(source: Source, prims: list[Usd.Prim]) -> list[Finding]:
    findings = []
    prefix = vocabulary.TRAP_LAW.name + ":"
    for prim in prims:
        instances = [name.removeprefix(prefix) for name in source.applied(prim) if name.startswith(prefix)]
        path = str(prim.GetPath())
        if instances and not source.has(prim, "OtTrapAPI"):
            message = f"OtTrapLawAPI:{instances[0]} is unused: the prim has no OtTrapAPI"
            findings.append(Finding(severity="warning", prim=path, message=message))
            continue
        if instances and read_values(source.file, prim, vocabulary.TRAP)["model"] == "harmonic":
            findings += _unused_branch(source, prim, instances)
    return findings


def _unused_branch(source: Source, prim: Usd.Prim, instances: list[str]) -> list[Finding]:
    defaults = {attribute.field: attribute.default for attribute in vocabulary.TRAP_LAW.attributes}
    findings = []
    for instance in instances:
        values = read_values(source.file, prim, vocabulary.TRAP_LAW, instance=instance, si=True)
        for field in _BRANCH:
            if values[field] != defaults[field]:
                message = f"{field} of the {instance} law is unused: the model is harmonic"
                findings.append(Finding(severity="warning", prim=str(prim.GetPath()), message=message))
    return findings


def _clipping(source: Source, prim: Usd.Prim, points: Sequence[Vec3]) -> list[Finding]:
    near, far = source.values.value(prim, "clippingRange")
    path = str(prim.GetPath())
    if not 0.0 < near < far:
        return [Finding(severity="warning", prim=path, message=f"clippingRange ({near:g}, {far:g}) is not usable")]
    if not points:
        return []
    position, _, _ = source.pose(prim)
    forward = -source.matrix(prim)[2, :3] / np.linalg.norm(source.matrix(prim)[2, :3])
    depth = (np.array(points) - position) @ forward / source.unit
    if np.any((depth > near) & (depth < far)):
        return []
    message = (
        f"clippingRange ({near:g}, {far:g}) shows no body or trap, which lie {depth.min():g} … {depth.max():g} away"
    )
    return [Finding(severity="warning", prim=path, message=message)]
