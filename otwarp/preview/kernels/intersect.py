"""Where a ray enters each canonical solid (see `otwarp.scene.drawing.draw_list`).

Every function takes the ray in the frame of the solid, its origin moved to the point closest to the frame's origin
(in float32 the discriminant of a small sphere far away would drown in rounding errors otherwise), the smallest ray
parameter allowed, and the solid's two parameters. It returns (outward normal, ray parameter); the parameter is `MISS`
when the ray does not enter. Surfaces are seen from outside only.
"""

import warp as wp

MISS = wp.constant(1.0e30)


@wp.func
def enter_sphere(o: wp.vec3, d: wp.vec3, low: float, size: wp.vec2) -> wp.vec4:
    """Unit ball: |o + t·d| = 1 at the nearer root; `o` is the point closest to its centre."""
    room = 1.0 - wp.dot(o, o)
    if room <= 0.0:
        return wp.vec4(0.0, 0.0, 0.0, MISS)
    t = -wp.sqrt(room / wp.dot(d, d))
    if t <= low:
        return wp.vec4(0.0, 0.0, 0.0, MISS)
    n = o + t * d
    return wp.vec4(n[0], n[1], n[2], t)


@wp.func
def enter_box(o: wp.vec3, d: wp.vec3, low: float, size: wp.vec2) -> wp.vec4:
    """Cube from −1 to 1, by slabs: the latest entry into one, if it comes before the first exit (T. L. Kay and
    J. T. Kajiya, SIGGRAPH 1986, doi:10.1145/15922.15916)."""
    near = float(-MISS)
    far = float(MISS)
    axis = wp.int32(0)
    for k in range(3):
        if wp.abs(d[k]) < 1.0e-12:
            if wp.abs(o[k]) > 1.0:
                far = -MISS
        else:
            a = (-wp.sign(d[k]) - o[k]) / d[k]
            b = (wp.sign(d[k]) - o[k]) / d[k]
            if a > near:
                near = a
                axis = k
            far = wp.min(far, b)
    if near >= far or near <= low:
        return wp.vec4(0.0, 0.0, 0.0, MISS)
    n = wp.vec4(0.0, 0.0, 0.0, near)
    n[axis] = -wp.sign(d[axis])
    return n


@wp.func
def enter_tube(o: wp.vec3, d: wp.vec3, low: float, size: wp.vec2) -> wp.vec4:
    """Frustum about z from −1 to 1, radius 1 at −1 and size[0] at +1: x² + y² = (m + s·z)²."""
    hit = wp.vec4(0.0, 0.0, 0.0, MISS)
    middle = 0.5 * (1.0 + size[0])
    slope = 0.5 * (size[0] - 1.0)
    radius = middle + slope * o[2]
    a = d[0] * d[0] + d[1] * d[1] - slope * slope * d[2] * d[2]
    b = o[0] * d[0] + o[1] * d[1] - slope * radius * d[2]
    c = o[0] * o[0] + o[1] * o[1] - radius * radius
    room = b * b - a * c
    if room > 0.0 and wp.abs(a) > 1.0e-20:
        root = wp.sqrt(room)
        for k in range(2):
            t = (-b + (2.0 * float(k) - 1.0) * root) / a
            z = o[2] + t * d[2]
            n = wp.vec3(o[0] + t * d[0], o[1] + t * d[1], -slope * (middle + slope * z))
            if t > low and t < hit[3] and wp.abs(z) <= 1.0 and wp.dot(n, d) < 0.0:
                hit = wp.vec4(n[0], n[1], n[2], t)
    if wp.abs(d[2]) > 1.0e-12:
        z = -wp.sign(d[2])  # the end cap that faces the ray
        t = (z - o[2]) / d[2]
        x = o[0] + t * d[0]
        y = o[1] + t * d[1]
        if t > low and t < hit[3] and x * x + y * y <= (middle + slope * z) * (middle + slope * z):
            hit = wp.vec4(0.0, 0.0, z, t)
    return hit


@wp.func
def enter_capsule(o: wp.vec3, d: wp.vec3, low: float, size: wp.vec2) -> wp.vec4:
    """Radius 1 about the segment z = ±size[0]: the side, else the ball at the end where the side is missed."""
    hit = wp.vec4(0.0, 0.0, 0.0, MISS)
    a = d[0] * d[0] + d[1] * d[1]
    b = o[0] * d[0] + o[1] * d[1]
    room = b * b - a * (o[0] * o[0] + o[1] * o[1] - 1.0)
    if room > 0.0 and a > 1.0e-20:
        t = (-b - wp.sqrt(room)) / a
        z = o[2] + t * d[2]
        if t > low and wp.abs(z) <= size[0]:
            return wp.vec4(o[0] + t * d[0], o[1] + t * d[1], 0.0, t)
    for k in range(2):
        centre = wp.vec3(0.0, 0.0, (2.0 * float(k) - 1.0) * size[0])
        shift = -wp.dot(o - centre, d) / wp.dot(d, d)
        ball = enter_sphere(o - centre + shift * d, d, low - shift, size)
        if ball[3] < MISS and ball[3] + shift < hit[3] and ball[2] * centre[2] >= 0.0:
            hit = wp.vec4(ball[0], ball[1], ball[2], ball[3] + shift)
    return hit


@wp.func
def enter_plane(o: wp.vec3, d: wp.vec3, low: float, size: wp.vec2) -> wp.vec4:
    """Rectangle |x| ≤ size[0], |y| ≤ size[1] in z = 0, seen from +z."""
    if d[2] > -1.0e-12:
        return wp.vec4(0.0, 0.0, 0.0, MISS)
    t = -o[2] / d[2]
    if t <= low or wp.abs(o[0] + t * d[0]) > size[0] or wp.abs(o[1] + t * d[1]) > size[1]:
        return wp.vec4(0.0, 0.0, 0.0, MISS)
    return wp.vec4(0.0, 0.0, 1.0, t)


@wp.func
def enter_mesh(
    o: wp.vec3, d: wp.vec3, low: float, mesh: wp.uint64, corner: wp.array(dtype=wp.vec3), first: int
) -> wp.vec4:
    """Triangles, seen from both sides; the normal is interpolated between corners and turned towards the viewer.

    Args:
        mesh: Id of the `wp.Mesh`.
        corner: Normals of all meshes' corners, three for each triangle.
        first: Index of this mesh's first.
    """
    query = wp.mesh_query_ray(mesh, o + low * d, d, MISS)
    if not query.result:
        return wp.vec4(0.0, 0.0, 0.0, MISS)
    k = first + 3 * query.face
    # Warp's barycentric u and v belong to the first and second corner.
    n = query.u * corner[k] + query.v * corner[k + 1] + (1.0 - query.u - query.v) * corner[k + 2]
    if wp.dot(n, d) > 0.0:
        n = -n
    return wp.vec4(n[0], n[1], n[2], low + query.t)
