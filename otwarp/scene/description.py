"""What a scene says, as plain frozen dataclasses in internal units (µm, s, pN, mW, K).

Quaternions are (x, y, z, w). Positions of bodies, traps and obstacles are in world coordinates (µm); offsets of
spheres are in the frame of the body's prim. Nothing here knows USD or Warp.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from otwarp.laws import TrapLaw
from otwarp.laws.table import Interpolation
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.keywords import KnownFields
from otwarp.scene.track import ByValue, Track

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
IDENTITY: Quat = (0.0, 0.0, 0.0, 1.0)

OPTICAL_MODELS = ("table", "exact")
"""Force models of a trap that need no force curve."""


@dataclass(frozen=True, kw_only=True)
class Medium(KnownFields):
    """The liquid.

    Attributes:
        refractive_index: At the wavelength of the traps.
        viscosity: Dynamic [Pa·s = pN·s/µm²].
        temperature: [K].
        density: [pN·s²/µm⁴].
    """

    refractive_index: float = 1.33
    viscosity: float = 0.00089
    temperature: float = 298.15
    density: float = 997e-12


@dataclass(frozen=True, kw_only=True)
class Settings(KnownFields):
    """How the scene is to be stepped.

    Attributes:
        accuracy: Wanted relative error of variances, correlations and escape times; the time step follows from it.
        time_step: Explicit time step [s], or None to let otwarp choose.
        integrator: Name of the time integrator.
        noise: Distribution of the thermal displacement of a step.
        brownian: Whether thermal noise acts.
        gravity: Whether weight minus buoyancy acts (along −Z).
        coupling: Whether bodies carry each other along through the liquid.
        period: Lengths after which space repeats along x, y and z [µm]; 0 along an open axis.
        period_center: Middle of the cell that repeats [µm].
        domain_low, domain_high: Corners of the domain that cells live in [µm]; equal along an axis without end.
        inlet_low, inlet_high: Corners of the box in which those come in again that have left it [µm].
        duration: Length of the authored run [s].
        frames_per_second: Rate at which frames are recorded [1/s].
    """

    accuracy: float = 0.01
    time_step: float | None = None
    integrator: str = "heun"
    noise: str = "gaussian"
    brownian: bool = True
    gravity: bool = False
    coupling: bool = False
    period: Vec3 = (0.0, 0.0, 0.0)
    period_center: Vec3 = (0.0, 0.0, 0.0)
    domain_low: Vec3 = (0.0, 0.0, 0.0)
    domain_high: Vec3 = (0.0, 0.0, 0.0)
    inlet_low: Vec3 = (0.0, 0.0, 0.0)
    inlet_high: Vec3 = (0.0, 0.0, 0.0)
    duration: float = 1.0
    frames_per_second: float = 60.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Trap(ByValue):
    """An optical trap.

    Attributes:
        prim: Path of its prim.
        position: Track of the focus, (n, 3) µm.
        power: Track of the power, (n, 1) mW.
        orientation: Rotation of the trap's frame; the beam travels along its +Z.
        wavelength: Vacuum wavelength [µm].
        numerical_aperture: NA of the objective.
        polarization: One of the tokens of the vocabulary.
        model: Force model: `harmonic` and `piecewise` follow the force curves; `table` and `exact` compute the force
            from the beam and each sphere.
        beam: Angular spectrum of the beam, `gaussian`, `sine` or `aplanatic`.
        filling: Radius where the intensity in the pupil falls to 1/e², over the radius of the aperture [1].
        charge: Azimuthal charge ℓ of a vortex beam.
        depth: Nominal depth of the focus below the cover glass [µm]; with `glass_index`, the spherical aberration of
            the interface between glass and medium.
        glass_index: Refractive index of the cover glass and immersion oil [1], or None for no interface.
        tolerance: Largest error of the force table, relative to the peak force [1].
        interpolation: Interpolation in the force table, `bilinear` or `bicubic`.
        reach: Distance from the focus up to which an optical force is computed at least [µm], inf for as far as the
            tolerance asks; the far field falls slowly, and a robot of many spheres pays for all of it.
        radial, axial: Force curves across and along the beam; `axial` is None when one isotropic curve serves, and
            both are None when none is authored, as only an optical trap may.
        equilibrium: Where the force curves vanish, µm from the focus along the beam; d is measured from there. An
            optical trap computes its own equilibrium and ignores this one.
        hand: Which of the operator's hands moves it.
        speed_limit: Fastest the focus may move [µm/s], inf for none.
        holds: Prim path of the sphere this trap is meant to hold, or None: the nearest trapped sphere at the start.
    """

    prim: str
    position: Track
    power: Track
    orientation: Quat = IDENTITY
    wavelength: float = 1.064
    numerical_aperture: float = 1.25
    polarization: str = "circular"
    model: str = "piecewise"
    beam: str = "gaussian"
    filling: float = 1.0
    charge: int = 0
    depth: float = 0.0
    glass_index: float | None = None
    tolerance: float = 1e-3
    interpolation: Interpolation = "bilinear"
    reach: float = math.inf
    radial: TrapLaw | None = None
    axial: TrapLaw | None = None
    equilibrium: float = 0.0
    hand: Literal["none", "left", "right"] = "none"
    speed_limit: float = float("inf")
    holds: str | None = None

    @property
    def optical(self) -> bool:
        """Whether its force is computed from the beam and each sphere (model `table` or `exact`)."""
        return self.model in OPTICAL_MODELS


@dataclass(frozen=True, kw_only=True)
class Material(KnownFields):
    """Elastic and adhesive surface.

    Attributes:
        youngs_modulus: [pN/µm² = Pa].
        poisson_ratio: Pure number.
        adhesion: Energy per area [pN/µm].
        adhesion_range: [µm].
    """

    youngs_modulus: float = 1e6
    poisson_ratio: float = 0.4
    adhesion: float = 0.0
    adhesion_range: float = 0.01


@dataclass(frozen=True, kw_only=True)
class Sphere(KnownFields):
    """One sphere of a body, and what acts on it.

    Attributes:
        prim: Path of its prim.
        offset: Its centre in the body's frame [µm].
        radius: [µm].
        refractive_index: At the wavelength of the traps.
        trapped, collides, drag: Whether traps, contact and the liquid act on it.
    """

    prim: str
    offset: Vec3 = (0.0, 0.0, 0.0)
    radius: float
    refractive_index: float = 1.52
    trapped: bool = True
    collides: bool = True
    drag: bool = True


@dataclass(frozen=True, kw_only=True)
class Rod(KnownFields):
    """A rod of a body, which no trap acts on.

    Attributes:
        prim: Path of its prim.
        start, end: Centres of its rounded ends in the body's frame [µm].
        radius: [µm].
        refractive_index: In images alone; None for that of the body's first sphere.
        collides, drag: Whether contact and the liquid act on it.
    """

    prim: str
    start: Vec3
    end: Vec3
    radius: float
    refractive_index: float | None = None
    collides: bool = True
    drag: bool = True


@dataclass(frozen=True, kw_only=True)
class Body(KnownFields):
    """A rigid body made of spheres and rods: a microrobot, a bead, or a cell (one sphere).

    Attributes:
        prim: Path of its prim; for an instance, the path of its PointInstancer.
        instance: Index within a PointInstancer, or None.
        kind: `robot` (OtBodyAPI) or `cell` (OtCellAPI).
        position, orientation: Pose of the prim at the start.
        spheres: Its spheres, at least one.
        rods: Its rods.
        density: pN·s²/µm⁴.
        material: Contact surface.
        mobility: Override of the computed geometric mobility, 36 numbers row by row about the prim's origin in the
            prim's frame at unit viscosity [1/µm, 1/µm², 1/µm³], or None.
        mobility_accuracy: Wanted relative error of the computed mobility; 0 for the RPY tensors of its spheres alone.
        warning_force: Contact force above which the user is warned [pN], inf for none.
        forces: What else acts on it: parameter of a force → number or vector in internal units, as its row in
            `otwarp.scene.vocabulary.forces` says; only those that are authored.
    """

    prim: str
    instance: int | None = None
    kind: Literal["robot", "cell"] = "robot"
    position: Vec3 = (0.0, 0.0, 0.0)
    orientation: Quat = IDENTITY
    spheres: tuple[Sphere, ...]
    rods: tuple[Rod, ...] = ()
    density: float = 1190e-12
    material: Material = field(default_factory=Material)
    mobility: tuple[float, ...] | None = None
    mobility_accuracy: float = 0.01
    warning_force: float = float("inf")
    forces: Mapping[str, float | Vec3] = field(default_factory=dict, hash=False)

    @property
    def name(self) -> str:
        """Readable unique name: the prim path, with the index of an instance."""
        return self.prim if self.instance is None else f"{self.prim}[{self.instance}]"

    @property
    def colliding(self) -> tuple[Sphere | Rod, ...]:
        """What of it touches other things: spheres, then rods."""
        return tuple(element for element in (*self.spheres, *self.rods) if element.collides)


@dataclass(frozen=True, eq=False, kw_only=True)
class Obstacle(ByValue):
    """A rigid obstacle or wall, at rest or moving along time samples.

    Attributes:
        prim: Path of its prim.
        shape: plane, box, sphere, cylinder, capsule or mesh: a row of `obstacle_shapes.SHAPES`.
        position: Track of its origin, (n, 3) µm.
        orientation: Track of its rotation, (n, 4) quaternions, same times as `position`. The local +Z axis is the
            normal of a plane and the axis of a cylinder or capsule (other USD axes are folded into the rotation).
        size: box: half extents (x, y, z); sphere: (radius, 0, 0); cylinder and capsule: (radius, half height of
            the straight part, 0); plane and mesh: zeros [µm].
        vertices: (n, 3) µm, mesh only, scale applied.
        triangles: (m, 3) vertex indices, mesh only.
        double_sided: Whether a mesh that is not closed is meant to be a sheet; says nothing of other shapes.
        hydrodynamic: Whether the liquid sticks to it and hinders what moves nearby; a plane at rest only.
    """

    prim: str
    shape: str
    position: Track
    orientation: Track
    size: Vec3 = (0.0, 0.0, 0.0)
    vertices: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    triangles: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int32))
    double_sided: bool = False
    hydrodynamic: bool = False


@dataclass(frozen=True, kw_only=True)
class Flow(KnownFields):
    """Background flow along the local +X of its prim, varying along the local +Z (and +Y).

    Attributes:
        prim: Path of its prim.
        kind: A row of `flow_profile.PROFILES`: `uniform`, u = speed; `shear`, u = shear_rate·z; `poiseuille`,
            u = speed·(1 − (z/half_height)²) between the plates; `rectangular`, between plates and walls; `grid`, as
            `field` says. 0 outside.
        origin: Of the prim's frame [µm].
        orientation: Of the prim's frame.
        speed: [µm/s], of a channel at the centre line.
        shear_rate: [1/s].
        half_height, half_width: Plates are at z = ±half_height, walls at y = ±half_width [µm].
        file: From which `field` was read.
        field: Velocities on a grid.
    """

    prim: str
    kind: str
    origin: Vec3 = (0.0, 0.0, 0.0)
    orientation: Quat = IDENTITY
    speed: float = 0.0
    shear_rate: float = 0.0
    half_height: float = 0.0
    half_width: float = 0.0
    file: str = ""
    field: FlowGrid | None = None


@dataclass(frozen=True, kw_only=True)
class Camera(KnownFields):
    """The microscope; light travels along the camera's +Z axis towards it.

    Attributes:
        prim: Path of the camera.
        numerical_aperture, condenser_aperture: Of objective and condenser.
        condenser_shape, condenser_inner: `disc`, or `annulus` that begins at this aperture.
        contrast: `brightField`, `darkField`, `phaseContrast` or `dic`, differential interference contrast.
        ring_delay, ring_transmission: Of the ring of phase contrast: path [wavelengths], share of light.
        shear, shear_angle, bias: Of differential interference contrast [µm, rad, wavelengths].
        wavelength, bandwidth: Of the illumination in vacuum; full width at half maximum [µm].
        immersion_index, depth: Index of immersion and glass; depth of the focal plane below it that counts [µm].
        defocus, astigmatism, coma, spherical_aberration: Of the objective, root mean square [wavelengths].
        magnification: From the object plane to the sensor.
        pixel_size: In the object plane [µm].
        focus: Height of the focal plane along the camera's axis [µm].
        noise: Standard deviation of what the sensor adds, relative to full scale.
        electrons: Of full scale, inf for no shot noise.
        nonuniformity: Standard deviation of the pixels' sensitivities.
        bits, gamma: Of a grey level.
        brightness: Of unhindered light, relative to full scale.
        exposure: [s].
        center: Middle of the image along the camera's x and y axes [µm].
        orientation: Of the camera's axes in the world.
        frame: Width and height of the image [µm].
    """

    prim: str
    numerical_aperture: float = 1.45
    condenser_aperture: float = 0.6
    condenser_shape: Literal["disc", "annulus"] = "disc"
    condenser_inner: float = 0.0
    contrast: Literal["brightField", "darkField", "phaseContrast", "dic"] = "brightField"
    ring_delay: float = -0.25
    ring_transmission: float = 0.25
    shear: float = 0.2
    shear_angle: float = 0.0
    bias: float = 0.25
    wavelength: float = 0.6328
    bandwidth: float = 0.0
    immersion_index: float = 1.518
    depth: float = 0.0
    defocus: float = 0.0
    astigmatism: float = 0.0
    coma: float = 0.0
    spherical_aberration: float = 0.0
    magnification: float = 100.0
    pixel_size: float = 0.065
    focus: float = 0.0
    noise: float = 0.01
    electrons: float = 10000.0
    nonuniformity: float = 0.0
    bits: int = 8
    gamma: float = 1.0
    brightness: float = 0.35
    exposure: float = 0.0
    center: tuple[float, float] = (0.0, 0.0)
    orientation: Quat = IDENTITY
    frame: tuple[float, float] = (60.0, 60.0)


@dataclass(frozen=True, kw_only=True)
class Goal(KnownFields):
    """The task: bring `cell` to `position`.

    Attributes:
        prim: Path of the goal's prim.
        position: Where the cell is wanted [µm].
        cell: Prim path of the cell, or of the one robot that goes there itself.
        robots: Prim paths of the robots that carry it; that robot alone where none carries anything.
        tolerance: Delivered when the cell is this close [µm].
        lost_distance: A robot is lost when any of its traps is this far from the sphere it holds [µm].
        cell_lost_distance: The cell is lost when this far from the midpoint of its robots [µm].
        distance_warning: Warning line of the robot–trap distance [µm].
    """

    prim: str
    position: Vec3
    cell: str
    robots: tuple[str, ...]
    tolerance: float
    lost_distance: float
    cell_lost_distance: float
    distance_warning: float
