"""What a trap says about its beam and its force model: every attribute, every refusal, and the way back."""

from __future__ import annotations

import dataclasses
import re

import pytest
from pxr import Usd

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.optics.beam import APODIZATIONS, JONES, Beam
from otwarp.scene import OPTICAL_MODELS, Scene, SceneBuilder, Track, Trap, vocabulary
from otwarp.scene.vocabulary.values import authored, internal
from tests.scene.conftest import STAGE, StageFile

APPLIED = '["OtTrapAPI", "OtTrapLawAPI:isotropic"]'
LAW_TEXT = STAGE[STAGE.index("        double ot:trapLaw") : STAGE.index("        double3 xformOp:translate.time")]
NO_LAW = ((LAW_TEXT, ""), (APPLIED, '["OtTrapAPI"]'))
MODEL = 'token ot:trap:model = "piecewise"'
GLASS = "double ot:trap:glassIndex = 1.518"
LAW = TrapLaw(stiffness=12.3, threshold=0.7, inverse_square=3.3, offset=-0.4, cutoff=2.5, power=17.0, radius=1.525)

OPTICAL_TRAP = Trap(
    prim="/World/Trap",
    position=Track.constant((1.0, 2.0, 3.0)),
    power=Track.constant(12.5),
    numerical_aperture=1.2,
    polarization="45",
    model="table",
    beam="aplanatic",
    filling=0.85,
    charge=-3,
    depth=7.3,
    glass_index=1.518,
    tolerance=3e-4,
    interpolation="bicubic",
)

ATTRIBUTES = {entry.name.removeprefix("ot:trap:"): entry for entry in vocabulary.TRAP.attributes}


def authoring(*lines: str, model: str = "table") -> tuple[str, str]:
    """The change that gives the trap of the stage a model and more attributes."""
    return (MODEL, "\n        ".join((MODEL.replace("piecewise", model), *lines)))


def refusal(stage_file: StageFile, *changes: tuple[str, str]) -> str:
    """The one line with which the stage is refused, after the name of the file and the prim."""
    path = stage_file.write(*changes)
    with pytest.raises(InputError) as caught:
        Scene.load(path)
    message = str(caught.value)
    assert "\n" not in message
    head = f"{path}: /World/Trap: "
    assert message.startswith(head)
    return message.removeprefix(head)


# attribute, as authored in USD → field of the trap, its value in internal units
READ = {
    'token ot:trap:model = "harmonic"': ("model", "harmonic"),
    'token ot:trap:model = "piecewise"': ("model", "piecewise"),
    'token ot:trap:model = "table"': ("model", "table"),
    'token ot:trap:model = "exact"': ("model", "exact"),
    'token ot:trap:beam = "gaussian"': ("beam", "gaussian"),
    'token ot:trap:beam = "sine"': ("beam", "sine"),
    'token ot:trap:beam = "aplanatic"': ("beam", "aplanatic"),
    "double ot:trap:filling = 0.7": ("filling", 0.7),
    "double ot:trap:filling = 100": ("filling", 100.0),
    "int ot:trap:charge = 2": ("charge", 2),
    "int ot:trap:charge = -20": ("charge", -20),
    "double ot:trap:depth = 1e-3\n        " + GLASS: ("depth", 1000.0),
    "double ot:trap:depth = 6.1e-6\n        " + GLASS: ("depth", 6.1),
    "double ot:trap:glassIndex = 1.518": ("glass_index", 1.518),
    "double ot:trap:glassIndex = 1.4": ("glass_index", 1.4),
    "double ot:trap:glassIndex = 0": ("glass_index", None),
    "double ot:trap:tolerance = 1e-5": ("tolerance", 1e-5),
    "double ot:trap:tolerance = 0.1": ("tolerance", 0.1),
    'token ot:trap:interpolation = "bilinear"': ("interpolation", "bilinear"),
    'token ot:trap:interpolation = "bicubic"': ("interpolation", "bicubic"),
}


@pytest.mark.parametrize("text", READ)
def test_every_attribute_is_read(text: str, stage_file: StageFile) -> None:
    field, expected = READ[text]
    (trap,) = stage_file.load((MODEL, text)).traps
    found = getattr(trap, field)
    assert (found, type(found)) == (expected, type(expected))


def test_what_is_not_authored_is_the_default_of_the_dataclass(stage_file: StageFile) -> None:
    (trap,) = stage_file.load().traps
    plain = Trap(prim=trap.prim, position=trap.position, power=trap.power)
    for field in dataclasses.fields(Trap):
        if field.name not in ("prim", "position", "power", "numerical_aperture", "radial", "holds"):  # authored there
            assert getattr(trap, field.name) == getattr(plain, field.name), field.name
    for entry in vocabulary.TRAP.attributes:
        if entry.usd_type != "rel" and entry.name != "ot:trap:power":
            default = internal(entry.default, entry.dimension) if entry.usd_type == "double" else entry.default
            assert (getattr(plain, entry.field) or 0) == (default or 0), entry.name


# text that is authored → what the message must be after file and prim
REFUSED = {
    'token ot:trap:model = "tabel"': "ot:trap:model = tabel: must be one of harmonic, piecewise, table, exact",
    'token ot:trap:beam = "bessel"': "ot:trap:beam = bessel: must be one of gaussian, sine, aplanatic",
    "double ot:trap:filling = 0": "ot:trap:filling = 0.0: must be in [0.01, 100]",
    "double ot:trap:filling = 100.1": "ot:trap:filling = 100.1: must be in [0.01, 100]",
    "double ot:trap:filling = nan": "ot:trap:filling = nan: must be in [0.01, 100]",
    "int ot:trap:charge = 21": "ot:trap:charge = 21: must be a whole number in [-20, 20]",
    "int ot:trap:charge = -21": "ot:trap:charge = -21: must be a whole number in [-20, 20]",
    "double ot:trap:charge = 1": "ot:trap:charge = 1.0 (type double): must be of type int, [-20, 20]",
    "int ot:trap:charge.timeSamples = { 0: 0, 60: 1 }": "ot:trap:charge = (time samples): must be constant in time",
    "double ot:trap:depth = -1e-6": "ot:trap:depth = -1e-06: must be in [0, 0.001] m",
    "double ot:trap:depth = 1.1e-3": "ot:trap:depth = 0.0011: must be in [0, 0.001] m",
    "double ot:trap:depth = inf": "ot:trap:depth = inf: must be in [0, 0.001] m",
    "double ot:trap:depth = 5e-6": "ot:trap:depth = 5e-06: must be 0 m while ot:trap:glassIndex = 0; a depth above 0"
    " needs the index of the glass, in [1, 4]",
    "double ot:trap:glassIndex = 0.99": "ot:trap:glassIndex = 0.99: must be 0 or [1, 4]",
    "double ot:trap:glassIndex = -1": "ot:trap:glassIndex = -1.0: must be 0 or [1, 4]",
    "double ot:trap:glassIndex = 4.01": "ot:trap:glassIndex = 4.01: must be 0 or [1, 4]",
    "double ot:trap:glassIndex = nan": "ot:trap:glassIndex = nan: must be 0 or [1, 4]",
    "double ot:trap:tolerance = 9e-7": "ot:trap:tolerance = 9e-07: must be in [1e-05, 0.1]",
    "double ot:trap:tolerance = 0.11": "ot:trap:tolerance = 0.11: must be in [1e-05, 0.1]",
    "double ot:trap:tolerance = nan": "ot:trap:tolerance = nan: must be in [1e-05, 0.1]",
    'token ot:trap:interpolation = "spline"': "ot:trap:interpolation = spline: must be one of bilinear, bicubic",
}


@pytest.mark.parametrize("text", REFUSED)
def test_values_out_of_range_are_refused(text: str, stage_file: StageFile) -> None:
    assert refusal(stage_file, (MODEL, text)) == REFUSED[text]


@pytest.mark.parametrize("model", ["harmonic", "piecewise", "table", "exact"])
def test_an_aperture_above_the_index_names_the_immersion(model: str, stage_file: StageFile) -> None:
    message = refusal(stage_file, authoring(model=model), ("numericalAperture = 1.2", "numericalAperture = 1.4"))
    assert message == (
        "ot:trap:numericalAperture = 1.4: must be in (0, 1.33), below the refractive index of the medium"
        " (an aperture of 1.4 needs an immersion medium of index above 1.4)"
    )
    wetter = ("ot:medium:refractiveIndex = 1.33", "ot:medium:refractiveIndex = 1.41")
    scene = stage_file.load(authoring(model=model), ("numericalAperture = 1.2", "numericalAperture = 1.4"), wetter)
    assert scene.traps[0].numerical_aperture == 1.4


@pytest.mark.parametrize("model", OPTICAL_MODELS)
def test_an_optical_trap_needs_no_law(model: str, stage_file: StageFile) -> None:
    (trap,) = stage_file.load(authoring(model=model), *NO_LAW).traps
    assert (trap.radial, trap.axial, trap.optical) == (None, None, True)


@pytest.mark.parametrize("model", ["harmonic", "piecewise"])
def test_other_traps_need_a_law(model: str, stage_file: StageFile) -> None:
    assert refusal(stage_file, authoring(model=model), *NO_LAW) == (
        "OtTrapLawAPI = (none): must be isotropic alone, or radial and axial together, or none with"
        " ot:trap:model = table"
    )


@pytest.mark.parametrize("model", OPTICAL_MODELS)
def test_half_a_law_is_refused_even_where_none_is_needed(model: str, stage_file: StageFile) -> None:
    radial = (LAW_TEXT, LAW_TEXT.replace("isotropic", "radial")), (APPLIED, APPLIED.replace("isotropic", "radial"))
    message = refusal(stage_file, authoring(model=model), *radial)
    assert message == "OtTrapLawAPI = radial: must be isotropic alone, or radial and axial together, or none"


@pytest.mark.parametrize("model", OPTICAL_MODELS)
def test_switching_the_token_changes_the_model_alone(model: str, stage_file: StageFile) -> None:
    branch = ("isotropic:stiffness = 2", "isotropic:stiffness = 2\n        double ot:trapLaw:isotropic:offset = 3")
    beam = ("double ot:trap:filling = 0.9", "double ot:trap:equilibrium = 4e-7")
    (cheap,) = stage_file.load(branch, authoring(*beam, model="piecewise")).traps
    (dear,) = stage_file.load(branch, authoring(*beam, model=model)).traps
    assert cheap.radial is not None
    assert (cheap.radial.stiffness, cheap.radial.offset, cheap.equilibrium) == (2.0, 3.0, 0.4)
    assert (cheap.optical, dear.optical) == (False, True)
    assert dear == dataclasses.replace(cheap, model=model)


@pytest.mark.parametrize("laws", ["none", "isotropic", "split"])
@pytest.mark.parametrize("model", OPTICAL_MODELS)
@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_an_optical_trap_comes_back_equal(model: str, laws: str, suffix: str, tmp_path) -> None:
    radial = None if laws == "none" else LAW
    axial = dataclasses.replace(LAW, stiffness=4.4) if laws == "split" else None
    trap = dataclasses.replace(OPTICAL_TRAP, model=model, radial=radial, axial=axial)
    builder = SceneBuilder()
    prim = builder.add(trap)
    assert Scene.load(builder.save(tmp_path / f"trap{suffix}")).traps == (trap,)
    applied = [name for name in prim.GetAppliedSchemas() if name.startswith("OtTrapLawAPI")]
    expected = {"none": [], "isotropic": ["isotropic"], "split": ["axial", "radial"]}[laws]
    assert sorted(applied) == [f"OtTrapLawAPI:{name}" for name in expected]


@pytest.mark.parametrize("field", ["beam", "filling", "charge", "depth", "glass_index", "tolerance", "interpolation"])
def test_each_field_comes_back(field: str) -> None:
    """Against the plain trap, so that no field rides on another one."""
    plain = Trap(prim="/World/Trap", position=OPTICAL_TRAP.position, power=OPTICAL_TRAP.power, model="exact")
    assert getattr(plain, field) != getattr(OPTICAL_TRAP, field)
    glass = {"glass_index": 1.6} if field == "depth" else {}
    trap = dataclasses.replace(plain, **{field: getattr(OPTICAL_TRAP, field)}, **glass)
    builder = SceneBuilder()
    builder.add(trap)
    assert builder.scene().traps == (trap,)
    assert trap != plain


def test_every_value_is_written_out(tmp_path) -> None:
    builder = SceneBuilder()
    builder.add(OPTICAL_TRAP)
    stage = Usd.Stage.Open(str(builder.save(tmp_path / "trap.usda")))
    prim = stage.GetPrimAtPath("/World/Trap")
    for entry in vocabulary.TRAP.attributes:
        if entry.usd_type == "rel":
            continue
        attribute = prim.GetAttribute(entry.name)
        assert attribute.HasAuthoredValue(), entry.name
        assert attribute.GetTypeName() == entry.usd_type
        if entry.field != "power":
            value = getattr(OPTICAL_TRAP, entry.field)
            assert attribute.Get() == (authored(value, entry.dimension) if entry.usd_type == "double" else value)


# a value that cannot be, and how the message goes on after the prim
UNWRITABLE = [
    ({"charge": 1.5}, "ot:trap:charge = 1.5 (a float): must be a whole number in [-20, 20]"),
    ({"charge": 2**40}, f"ot:trap:charge = {2**40}: must be a whole number in [-20, 20]"),
    ({"charge": float("nan")}, "ot:trap:charge = nan (a float): must be a whole number in [-20, 20]"),
    ({"axial": LAW}, "radial = None: must be a TrapLaw beside an axial one"),
    ({"glass_index": 0.5}, "ot:trap:glassIndex = 0.5: must be 0 or [1, 4]"),
    ({"glass_index": None}, "ot:trap:depth = 7.3e-06: must be 0 m while ot:trap:glassIndex = 0;"),
    ({"depth": -1.0}, "ot:trap:depth = -1e-06: must be in [0, 0.001] m"),
    ({"tolerance": 0.0}, "ot:trap:tolerance = 0.0: must be in [1e-05, 0.1]"),
    ({"model": "piecewise"}, "radial = None: must be a TrapLaw with ot:trap:model = piecewise"),
]


@pytest.mark.parametrize(("change", "expected"), UNWRITABLE)
def test_a_trap_that_cannot_be_is_not_saved(change: dict, expected: str, tmp_path) -> None:
    builder = SceneBuilder()
    with pytest.raises(InputError, match=re.escape(f"SceneBuilder: /World/Trap: {expected}")) as caught:
        builder.add(dataclasses.replace(OPTICAL_TRAP, **change))
        builder.save(tmp_path / "trap.usda")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_the_vocabulary_knows_the_beams_of_the_optics() -> None:
    assert ATTRIBUTES["beam"].allowed == tuple(APODIZATIONS)
    assert ATTRIBUTES["polarization"].allowed == tuple(JONES)
    assert set(ATTRIBUTES["model"].allowed) > set(OPTICAL_MODELS)
    trap = OPTICAL_TRAP
    same = ("numerical_aperture", "wavelength", "polarization", "filling", "charge", "depth", "glass_index")
    beam = Beam(kind=trap.beam, medium_index=1.33, **{name: getattr(trap, name) for name in same})
    assert all(getattr(beam, name) == getattr(trap, name) for name in same)
