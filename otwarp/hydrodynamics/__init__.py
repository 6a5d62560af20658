"""How rigid bodies move in a viscous liquid: mobilities, near walls too, and bodies that stand for meshes (float64).

In come spheres, rods or a closed mesh [µm], out come 6×6 matrices at unit viscosity, in the order (force, torque) →
(velocity, angular velocity), about the centre of diffusion. Nothing here knows a scene, or Warp.

Floor plan, each file importing only from those above it; to begin with, open `mobility`:

    rpy                        two spheres that overlap or not: the Rotne–Prager–Yamakawa tensors
    rigid                      `BodyMobility`, the centre of diffusion, and matrices about other points
    covering, symmetry         surfaces of spheres and rods as even sets of nodes; what carries a body into itself
    surface, sphere_coupling   friction of a covered surface; how its body follows a flow known at the spheres
    blobs, mobility_cache      coverings refined to a wanted accuracy; what they gave, on disk
    mobility                   `body_mobility`: spheres and rods, by pair tensors or by blobs
    mesh_surface, solid        a closed mesh, covered; as cells of a grid
    decomposition              a mesh as a union of spheres
    bispherical, walls         one sphere near a plane, exactly; bodies near planes, by fits of it
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.hydrodynamics.bispherical import WallResistance as WallResistance
    from otwarp.hydrodynamics.bispherical import wall_resistance as wall_resistance
    from otwarp.hydrodynamics.decomposition import Decomposition as Decomposition
    from otwarp.hydrodynamics.decomposition import decompose as decompose
    from otwarp.hydrodynamics.mesh_surface import mesh_mobility as mesh_mobility
    from otwarp.hydrodynamics.mobility import body_mobility as body_mobility
    from otwarp.hydrodynamics.mobility import from_override as from_override
    from otwarp.hydrodynamics.rigid import BodyMobility as BodyMobility
    from otwarp.hydrodynamics.rigid import about_centre_of_diffusion as about_centre_of_diffusion
    from otwarp.hydrodynamics.rpy import grand_mobility as grand_mobility
    from otwarp.hydrodynamics.walls import body_resistance as body_resistance
    from otwarp.hydrodynamics.walls import sphere_mobility as sphere_mobility

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "bispherical": ("WallResistance", "wall_resistance"),
        "decomposition": ("Decomposition", "decompose"),
        "mesh_surface": ("mesh_mobility",),
        "mobility": ("body_mobility", "from_override"),
        "rigid": ("BodyMobility", "about_centre_of_diffusion"),
        "rpy": ("grand_mobility",),
        "walls": ("body_resistance", "sphere_mobility"),
    },
)
