"""Square roots and reciprocals that cost one instruction on CUDA, and a cube root that calls nothing on a CPU.

The compiler's own are rounded correctly, which takes some ten instructions and a slow path that blocks the scheduling
of what surrounds it. These are PTX `sqrt.approx.ftz`, `rsqrt.approx.ftz` and `rcp.approx.ftz`, with the error bounds of
the PTX ISA; on a CPU they are the ordinary ones.
"""

import warp as wp


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    float result;
    asm("sqrt.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x));
    return result;
#else
    return sqrtf(x);
#endif
""")
def square_root(x: wp.float32) -> wp.float32:
    """√x of x = 0 or normal x > 0, relative error at most 2⁻²³."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    float result;
    asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x));
    return result;
#else
    return 1.0f / sqrtf(x);
#endif
""")
def reciprocal_root(x: wp.float32) -> wp.float32:
    """1/√x of normal x > 0, relative error at most 2⁻²²·⁴; inf for x = 0."""
    ...


@wp.func
def length_of(v: wp.vec3) -> float:
    """|v|, in its units, relative error at most 2⁻²²; 0 on CUDA where it is below 1e-19."""
    return square_root(wp.dot(v, v))


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    const float square = wp::dot(v, v);
    float inverse;
    asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(inverse) : "f"(square));
    return square >= 1.17549435e-38f ? v * inverse : wp::vec_t<3, float>();
#else
    return wp::normalize(v);
#endif
""")
def direction_of(v: wp.vec3) -> wp.vec3:
    """v/|v| [1], relative error at most 2⁻²¹; 0 of a vector without length, on CUDA of one shorter than 1e-19."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return cbrtf(x);
#else
    int bits;
    __builtin_memcpy(&bits, &x, 4);
    // a third of the exponent, negative: within 3.5 % of 1/∛x, of which Newton's method needs no division
    bits = 0x54a21d2a - bits / 3;
    float y;
    __builtin_memcpy(&y, &bits, 4);
    for (int i = 0; i < 3; ++i)
        y *= (4.0f - x * y * y * y) * (1.0f / 3.0f);
    return x * y * y;
#endif
""")
def cube_root(x: wp.float32) -> wp.float32:
    """∛x of normal x > 0, relative error at most 2⁻²¹."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    float result;
    asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x));
    return result;
#else
    return 1.0f / x;
#endif
""")
def reciprocal(x: wp.float32) -> wp.float32:
    """1/x of normal x, relative error at most 2⁻²³; inf for x = 0."""
    ...
