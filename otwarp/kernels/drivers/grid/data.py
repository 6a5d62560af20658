"""Scratch of the grid driver, and the pose of a body as its kernels read it."""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import Pose, StateData


@wp.struct
class NeighbourData:
    """Cells and neighbour lists of the elements: colliding spheres, or slots where contacts are soft; E per world."""

    cells: wp.vec3i  # along each axis, powers of two
    edge: wp.vec3  # of a cell [µm]
    skin: float  # extra distance up to which neighbours are listed [µm]
    adhesion: float  # longest range of adhesion [µm]
    wander: float  # largest variance of the thermal motion of one element against another in a step [µm²]
    reach: float  # gap up to which elements may feel each other in a step [µm]
    elements: int  # E
    key: wp.array(dtype=wp.int32)  # (2·W·E) cell of each element, then sorted; the second half is the sort's
    item: wp.array(dtype=wp.int32)  # (2·W·E) element of each sorted key
    start: wp.array(dtype=wp.int32)  # (W·cells) first sorted entry of each cell
    finish: wp.array(dtype=wp.int32)  # (W·cells) one past its last
    reference: wp.array(dtype=wp.vec3)  # (W·E) centres when the lists were made [µm]
    count: wp.array(
        dtype=wp.int32
    )  # (W·E) neighbours listed, of slots on a CPU the later ones; FULL if there are too many
    neighbour: wp.array(dtype=wp.int32)  # (W·E·NEIGHBOURS) elements, ascending by sphere
    begin: wp.array(dtype=wp.int32)  # (W·E) where the lists of slots begin on a CPU, see `slot_lists`
    full: wp.array(dtype=wp.int32)  # (W) not 0: some slot of the world is FULL, on a CPU
    stride: int  # from one element's list to the next
    pitch: int  # from one entry of a list to the next
    walled: wp.array(dtype=wp.int32)  # (W·E) `obstacle_bit` of those that may be touched before the next lists
    stale: wp.array(dtype=wp.int32)  # (1|W) not 0: something moved by more than half the skin
    builds: wp.array(dtype=wp.int32)  # (1|W) how often the lists were made


def whole_contacts(f: Features) -> bool:
    """Whether a contact force moves a body in other ways than along the normal: it turns, or walls hinder it."""
    return f.rigid or f.walls > 0


def in_columns(f: Features) -> bool:
    """Whether a CPU finds the neighbours in a world among all its elements, component by component."""
    return f.by_world and f.in_turn and f.pairs


def lifts_noise(f: Features) -> bool:
    """Whether contacts ask how far noise alone moves bodies."""
    return f.bends and f.brownian and not f.soft_contacts


def shares_entries(f: Features) -> bool:
    """Whether the threads of a block share out the contacts of a world."""
    return f.by_world and f.contacts and not f.in_turn


@wp.struct
class Link:
    """What a contact of a lone sphere needs: see `Contact`; 92 bytes instead of 228."""

    b: int
    normal: wp.vec3
    radius: float
    overlap: float
    hardness: float
    force: float
    floor: float
    stiffness: float
    drift: wp.vec3
    curvature: float
    ridge: wp.vec3
    lift: float
    own: float
    """Opening of the gap per unit contact force by this sphere [µm/pN]; `give` by both partners."""
    give: float
    wander: float
    layer: float
    load: float


@wp.struct
class EntryData:
    """Contacts of worlds whose threads share them out; N = W·E·MAX_BODY_CONTACTS is room for all, see `entries`."""

    total: wp.array(dtype=wp.int32)  # (W) entries of each world
    pair: wp.array(dtype=wp.vec2i)  # (N) the elements of each, or one and an `obstacle_name`
    body: wp.array(dtype=wp.vec2i)  # (N) their bodies, -1 an obstacle
    part: wp.array2d(dtype=wp.vec4)  # (5 or 11, N) what does not change in a step, four numbers at a time
    load: wp.array(dtype=wp.float32)  # (N) λ [pN]
    ahead: wp.array2d(dtype=wp.float32)  # (2, N) force from which a sweep starts, in turn with the next one [pN]
    likely: wp.array(dtype=wp.float32)  # (N) weight in the row sums of others: 1 if a force is foreseen, else less
    free: wp.array(dtype=wp.float32)  # (N) opening of the gap by the free moves [µm]
    row_sum: wp.array(dtype=wp.float32)  # (N) row sum of G over its diagonal, ≥ 1
    link: wp.array2d(dtype=wp.int32)  # (W·B, MAX_BODY_CONTACTS) entries of each body, see `entry_of`
    links: wp.array2d(dtype=wp.int32)  # (W, B) how many of them are solved
    touched: wp.array(dtype=wp.int32)  # (W·B) bodies of each world that have some, in its first places
    touches: wp.array(dtype=wp.int32)  # (W) how many
    weight: wp.array2d(dtype=wp.int64)  # (W, 2) sums that scale the first guess, see `weigh`
    sweeps: wp.array(dtype=wp.int32)  # (W) how many were taken since the start


@wp.struct
class GridData:
    """Scratch of the grid driver; a slot holds a body, and slots follow the cells where contacts are soft.

    What is marked (1|W) all worlds share, or each has its own, see `own_term`.
    """

    clock: wp.array(dtype=wp.int64)  # (1|W) step counter
    until: wp.array(dtype=wp.int64)  # (1|W) step after the last one of this call
    left: wp.array(dtype=wp.int32)  # (1) steps left in this launch
    linear: wp.array2d(dtype=wp.vec3)  # (W, B) free displacement [µm]
    angular: wp.array2d(dtype=wp.vec3)  # (W, B) free rotation [rad]
    drift: wp.array2d(dtype=wp.vec3)  # (W, B) displacement without noise in the first stage [µm]
    turning: wp.array2d(dtype=wp.vec3)  # (W, B) and rotation [rad]
    contact: wp.array2d(
        dtype=Contact
    )  # (W·B, MAX_BODY_CONTACTS) contacts of each body, seen from it, if `whole_contacts`
    link: wp.array2d(dtype=Link)  # (W·B, MAX_BODY_CONTACTS) the same if not
    count: wp.array2d(dtype=wp.int32)  # (W, B) how many
    row_sum: wp.array2d(dtype=wp.float32)  # (W, B) largest row sum of its share of G over the diagonal, 1 for one
    ahead: wp.array2d(dtype=wp.float32)  # (W·B, MAX_BODY_CONTACTS) force from which the next sweep starts [pN]
    outside: wp.array(dtype=wp.int32)  # (1|W) not 0: some body that comes in again is outside
    slot: wp.array2d(dtype=wp.int32)  # (W, B) slot of each body, (W, 0) without slots or an inlet
    touching: wp.array(dtype=wp.int32)  # (1|W) not 0: there are contacts in this step
    sweep: wp.array(dtype=wp.int32)  # (1) first of the two sweeps to come
    unsettled: wp.array(dtype=wp.int32)  # (1) not 0: there are sweeps to come
    again: wp.array(dtype=wp.int32)  # (1|W) 1: the sweeps of this step are those after its first solution
    active: wp.array(dtype=wp.int32)  # (RELAXATIONS) 1: some contact of any world was not settled in this sweep
    moving: wp.array2d(dtype=wp.int32)  # (W, RELAXATIONS) 1: some contact of the world was not settled in this sweep
    way: wp.array2d(dtype=wp.float64)  # (W, B) where contacts take turns: how far they have moved each body [µm]
    due: wp.array2d(dtype=wp.float64)  # (W·B, MAX_BODY_CONTACTS) way of its bodies after which each is solved anew
    share: wp.array2d(dtype=wp.vec2)  # (W, CHUNKS) parts of the sums that scale the first guess [pN·µm]
    place: wp.array2d(dtype=wp.vec4)  # (2, W·B) centre and contact radius of each slot, now and next [µm]
    sorted: wp.array2d(dtype=wp.float32)  # (4, W·E + PAIRS) places [µm] and radii when lists were made, on a CPU
    push: wp.array(dtype=wp.vec4l)  # (W·B) contact force and load on each slot, see `whole_quanta`, on a CPU
    order: wp.array2d(dtype=wp.int32)  # (2, W·B) body of each slot, now and while being sorted
    row: wp.array(dtype=wp.int32)  # (1) which row of `place` is now
    turn: wp.array(dtype=wp.int32)  # (1) which row of `order` is now
    near: NeighbourData
    entry: EntryData


def own_term(f: Features) -> wp.Function:
    """`(world) -> int`: where a world finds its clock and flags; it has its own where it goes through steps alone."""

    @wp.func
    def of_world(world: int) -> int:
        """Index [1] of the clock and flags that a world has to itself."""
        return world

    @wp.func
    def of_all(world: int) -> int:
        """Index 0 of the one clock and the one set of flags that all worlds share."""
        return 0

    return of_world if f.by_world else of_all


@wp.struct
class PushData:
    """What the contacts move in a step."""

    linear: wp.array2d(dtype=wp.vec3)  # (W, B) [µm]
    angular: wp.array2d(dtype=wp.vec3)  # (W, B), (W, 0) without rotation [rad]


def body_pose_term(f: Features) -> wp.Function:
    """`(state, world, b) -> Pose`."""

    @wp.func
    def body_pose(state: StateData, world: int, b: int) -> Pose:
        """Position [µm] and orientation of body b; the identity where no body rotates."""
        pose = Pose(state.position[world, b], wp.quat_identity())
        if wp.static(f.rigid):
            pose.rotation = state.orientation[world, b]
        return pose

    return body_pose
