"""Finding contacts: between the spheres of two bodies, and between the spheres of a body and the obstacles."""

import warp as wp

from otwarp.kernels.contact import NO_CONTACT, Contact, pair_law, pair_reach, rigid_response, sphere_response
from otwarp.kernels.faults import OVERLAP_LIMIT, Fault, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.types import BodyData, ModelData, Move, Pose, ReadoutData, world_row


def response_term(f: Features) -> wp.Function:
    """`(body, b, q, scale, arm, force) -> Move`: what a force at a point moves in one step; `scale` = dt/η."""

    @wp.func
    def response(body: BodyData, b: int, q: wp.quat, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
        """The sphere's or the rigid body's response, whichever `b` is."""
        move = Move(wp.vec3(0.0), wp.vec3(0.0))
        if wp.static(f.rigid and f.spheres):
            if body.rigid[b] != 0:
                move = rigid_response(body, b, q, scale, arm, force)
            else:
                move = sphere_response(body, b, scale, arm, force)
        elif wp.static(f.rigid):
            move = rigid_response(body, b, q, scale, arm, force)
        else:
            move = sphere_response(body, b, scale, arm, force)
        return move

    return response


def new_contact_term(f: Features) -> wp.Function:
    """Fill in what the solver needs of a contact: forces, and how far each body gives way."""
    response = response_term(f)

    @wp.func
    def new_contact(
        model: ModelData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose, arm_a: wp.vec3, arm_b: wp.vec3,
        normal: wp.vec3, radius: float, overlap: float,
    ) -> Contact:  # fmt: skip
        """Force law and response of one contact."""
        scale = wp.float32(model.time_step) / model.medium.viscosity[world_row(model.medium.viscosity.shape[0], world)]
        law = pair_law(model.contact, a, b, radius, overlap)
        c = Contact()
        c.a = a
        c.b = b
        c.normal = normal
        c.arm_a = arm_a
        c.arm_b = arm_b
        c.radius = radius
        c.force = law.force
        c.floor = law.floor
        c.stiffness = law.stiffness
        c.response_a = response(model.body, a, pose_a.rotation, scale, arm_a, normal)
        c.give = wp.dot(c.response_a.linear + wp.cross(c.response_a.angular, arm_a), normal)
        if b >= 0:
            c.response_b = response(model.body, b, pose_b.rotation, scale, arm_b, -normal)
            c.give -= wp.dot(c.response_b.linear + wp.cross(c.response_b.angular, arm_b), normal)
        return c

    return new_contact


@wp.func
def obstacle_drift(wall: Pose, later: Pose, point: wp.vec3) -> wp.vec3:
    """Displacement in one step of the obstacle's material point that is at `point` of its own frame [µm].

    The translation apart, so that an obstacle that does not turn gives it without rounding.
    """
    turned = wp.quat_rotate(later.rotation, point) - wp.quat_rotate(wall.rotation, point)
    return later.position - wall.position + turned


def touch_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, b, pose_a, pose_b, arm_a, arm_b, ri, rj, step) -> Contact` of two spheres that touch.

    Spheres on the same centre touch too: they have no normal, but a fault.
    """
    new_contact = new_contact_term(f)

    @wp.func
    def touch(
        model: ModelData, readout: ReadoutData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose,
        arm_a: wp.vec3, arm_b: wp.vec3, ri: float, rj: float, step: wp.int64,
    ) -> Contact:  # fmt: skip
        """Normal, overlap and effective radius of two spheres; a fault when they overlap too far."""
        way = pose_a.position - pose_b.position + arm_a - arm_b
        overlap = ri + rj - wp.length(way)
        if overlap > OVERLAP_LIMIT * wp.min(ri, rj):
            raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
        radius = ri * rj / (ri + rj)
        return new_contact(model, world, a, b, pose_a, pose_b, arm_a, arm_b, wp.normalize(way), radius, overlap)

    return touch


def touch_wall_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, pose, wall, later, arm, radius, local, hit, step) -> Contact` with an obstacle."""
    new_contact = new_contact_term(f)

    @wp.func
    def touch_wall(
        model: ModelData, readout: ReadoutData, world: int, a: int, pose: Pose, wall: Pose, later: Pose,
        arm: wp.vec3, radius: float, local: wp.vec3, hit: wp.vec4, step: wp.int64,
    ) -> Contact:  # fmt: skip
        """`local` is the sphere's centre in the obstacle's frame, `hit` the normal there and the distance."""
        overlap = radius - hit[3]
        if overlap > OVERLAP_LIMIT * radius:
            raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
        outward = wp.vec3(hit[0], hit[1], hit[2])
        normal = wp.quat_rotate(wall.rotation, outward)
        c = new_contact(model, world, a, NO_CONTACT, pose, wall, arm, wp.vec3(0.0), normal, radius, overlap)
        if wp.static(f.moving_obstacles):
            c.drift = wp.dot(obstacle_drift(wall, later, local - hit[3] * outward), normal)
        return c

    return touch_wall


def pair_contacts_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, b, pose_a, pose_b, contacts, count, step) -> count` for two bodies."""
    touch = touch_term(f)

    @wp.func
    def pair_contacts(
        model: ModelData,
        readout: ReadoutData,
        world: int,
        a: int,
        b: int,
        pose_a: Pose,
        pose_b: Pose,
        contacts: wp.array(dtype=Contact),
        count: int,
        step: wp.int64,
    ) -> int:
        """Bounding spheres first, then sphere against body, then sphere against sphere."""
        reach = pair_reach(model.contact, a, b)
        between = pose_a.position - pose_b.position
        if wp.length(between) < model.body.bound[a] + model.body.bound[b] + reach:
            for i in range(model.contact.start[a], model.contact.start[a + 1]):
                si = model.contact.sphere[i]
                arm_a = wp.quat_rotate(pose_a.rotation, wp.vec3(si[0], si[1], si[2]))
                # one sphere against the bounding sphere of b, before its spheres one by one
                if wp.length(between + arm_a) < si[3] + model.body.bound[b] + reach:
                    for j in range(model.contact.start[b], model.contact.start[b + 1]):
                        sj = model.contact.sphere[j]
                        arm_b = wp.quat_rotate(pose_b.rotation, wp.vec3(sj[0], sj[1], sj[2]))
                        if wp.length(between + arm_a - arm_b) < si[3] + sj[3] + reach:
                            if count < contacts.shape[0]:
                                contacts[count] = touch(
                                    model, readout, world, a, b, pose_a, pose_b, arm_a, arm_b, si[3], sj[3], step
                                )
                                count += 1
                            else:
                                raise_fault(readout, world, a, wp.static(int(Fault.OVERFLOW)), step)
        return count

    return pair_contacts


def obstacle_contacts_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, pose, contacts, count, step, time) -> count` for one body and all obstacles."""
    touch_wall = touch_wall_term(f)
    pose_at = moving_pose if f.moving_obstacles else still_pose
    distance_to = distance_term(f.obstacles)

    @wp.func
    def obstacle_contacts(
        model: ModelData,
        readout: ReadoutData,
        world: int,
        a: int,
        pose: Pose,
        contacts: wp.array(dtype=Contact),
        count: int,
        step: wp.int64,
        time: wp.float64,
    ) -> int:
        """Bounding sphere first, then the true shape, then sphere by sphere."""
        reach = pair_reach(model.contact, a, NO_CONTACT)
        bound = model.body.bound[a] + reach
        for o in range(model.obstacles.shape.shape[0]):
            wall = pose_at(model.obstacles, o, time)
            centre = wp.quat_rotate_inv(wall.rotation, pose.position - wall.position)
            near = wp.length(centre) < bound + model.obstacles.bound[o]
            if near:
                # the body's bounding sphere against the true shape, before its spheres one by one
                near = distance_to(model.obstacles, o, centre, bound)[3] < bound
            if near:
                later = wall
                if wp.static(f.moving_obstacles):
                    later = pose_at(model.obstacles, o, time + model.time_step)
                for i in range(model.contact.start[a], model.contact.start[a + 1]):
                    s = model.contact.sphere[i]
                    arm = wp.quat_rotate(pose.rotation, wp.vec3(s[0], s[1], s[2]))
                    local = wp.quat_rotate_inv(wall.rotation, pose.position + arm - wall.position)
                    hit = distance_to(model.obstacles, o, local, s[3] + reach)
                    if hit[3] < s[3] + reach:
                        if count < contacts.shape[0]:
                            contacts[count] = touch_wall(
                                model, readout, world, a, pose, wall, later, arm, s[3], local, hit, step
                            )
                            count += 1
                        else:
                            raise_fault(readout, world, a, wp.static(int(Fault.OVERFLOW)), step)
        return count

    return obstacle_contacts
