"""The scatter of MPM on a GPU: the threads of a warp work out a particle each, then add up all 32, a node each.

Particles lie in the order of their cells, or nearly: those of a warp share few sets of 27 nodes. Each puts what it
gives beside that of those with the same nodes; then lanes 0 to 26 own a node each, go through these one after the
other, and write once for each set: few atomic additions, of 16 bytes, and all but the first step is out of the nearest
memory.
"""

import warp as wp

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.func
def stencil(bx: wp.vec3i, by: wp.vec3i, bz: wp.vec3i, lx: wp.vec3i, ly: wp.vec3i, lz: wp.vec3i):
    """Where the three nodes along each axis lie: for each its place in a block, 2 bits, and one for the other block."""
    code = int(0)
    for o in range(3):
        code += ((lx[o] >> 4) + wp.where(bx[o] == bx[0], 0, 4)) << (3 * o)
        code += ((ly[o] >> 2) + wp.where(by[o] == by[0], 0, 4)) << (9 + 3 * o)
        code += (lz[o] + wp.where(bz[o] == bz[0], 0, 4)) << (18 + 3 * o)
    return code


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    // a particle: momentum and mass, three columns, weights along x, y and z beside lowest node and code, slots
    __shared__ float4 store[128 * 9];
    const int lane = threadIdx.x & 31;
    const unsigned same = __match_any_sync(0xffffffffu, lowest);
    unsigned heads = 0;
    int rank = 0;
    for (unsigned left = 0xffffffffu, begin = 0; left;) {
        const unsigned set = __shfl_sync(0xffffffffu, same, __ffs(left) - 1);
        if (set >> lane & 1) rank = begin + __popc(set & ((1u << lane) - 1u));
        heads |= 1u << begin;
        begin += __popc(set);
        left &= ~set;
    }
    float4* const all = store + (threadIdx.x & ~31) * 9;
    float4* const own = all + rank * 9;
    own[0] = make_float4(momentum[0], momentum[1], momentum[2], mass);
    for (int c = 0; c < 3; ++c) own[1 + c] = make_float4(a.data[0][c], a.data[1][c], a.data[2][c], 0.0f);
    own[4] = make_float4(wx[0], wx[1], wx[2], __int_as_float(lowest));
    own[5] = make_float4(wy[0], wy[1], wy[2], __int_as_float(code));
    own[6] = make_float4(wz[0], wz[1], wz[2], 0.0f);
    own[7] = make_float4(__int_as_float(s0), __int_as_float(s1), __int_as_float(s2), __int_as_float(s3));
    own[8] = make_float4(__int_as_float(s4), __int_as_float(s5), __int_as_float(s6), __int_as_float(s7));
    __syncwarp();
    const int o = lane / 9, q = (lane / 3) % 3, r = lane % 3;
    const float fo = o, fq = q, fr = r;
    for (int first = 0; first < 32;) {
        const unsigned later = first == 31 ? 0u : heads >> (first + 1);
        const int end = later ? first + __ffs(later) : 32;
        const int* const place = (const int*)(all + first * 9);
        if (lane < 27 && place[19] >= 0) {
            float x = 0.0f, y = 0.0f, z = 0.0f, w = 0.0f;
            const float4* it = all + first * 9;
#pragma unroll 4
            for (int p = first; p < end; ++p, it += 9) {
                const float* const words = (const float*)it;
                const float weight = words[16 + o] * words[20 + q] * words[24 + r];
                const float4 m = it[0], ax = it[1], ay = it[2], az = it[3];
                x += weight * (m.x + fo * ax.x + fq * ay.x + fr * az.x);
                y += weight * (m.y + fo * ax.y + fq * ay.y + fr * az.y);
                z += weight * (m.z + fo * ax.z + fq * ay.z + fr * az.z);
                w += weight * m.w;
            }
            const int i = place[23] >> (3 * o) & 7, j = place[23] >> (9 + 3 * q) & 7, k = place[23] >> (18 + 3 * r) & 7;
            const int slot = place[28 + (i >> 2) * 4 + (j >> 2) * 2 + (k >> 2)];
            const int node = slot * 64 + ((i & 3) << 4) + ((j & 3) << 2) + (k & 3);
#if __CUDA_ARCH__ >= 900
            asm volatile("red.global.add.v4.f32 [%0], {%1, %2, %3, %4};"
                :: "l"(&raw.data[node]), "f"(x), "f"(y), "f"(z), "f"(w) : "memory");
#else
            float* const sum = (float*)&raw.data[node];
            atomicAdd(sum, x); atomicAdd(sum + 1, y); atomicAdd(sum + 2, z); atomicAdd(sum + 3, w);
#endif
        }
        first = end;
    }
    __syncwarp();
#else
    const wp::int32 slots[8] = { s0, s1, s2, s3, s4, s5, s6, s7 };
    for (unsigned o = 0; o < 3; ++o)
        for (unsigned q = 0; q < 3; ++q)
            for (unsigned r = 0; r < 3; ++r) {
                const unsigned i = code >> (3 * o) & 7, j = code >> (9 + 3 * q) & 7, k = code >> (18 + 3 * r) & 7;
                const unsigned slot = slots[(i >> 2) * 4 + (j >> 2) * 2 + (k >> 2)];
                const unsigned node = slot * 64 + ((i & 3) << 4) + ((j & 3) << 2) + (k & 3);
                const wp::float32 weight = wx[o] * wy[q] * wz[r];
                for (unsigned c = 0; c < 3; ++c)
                    raw.data[node][c]
                        += weight * (momentum[c] + o * a.data[c][0] + q * a.data[c][1] + r * a.data[c][2]);
                raw.data[node][3] += weight * mass;
            }
#endif
"""
)
def scatter_together(
    raw: wp.array(dtype=wp.vec4),
    lowest: int,
    code: int,
    s0: int,
    s1: int,
    s2: int,
    s3: int,
    s4: int,
    s5: int,
    s6: int,
    s7: int,
    wx: wp.vec3,
    wy: wp.vec3,
    wz: wp.vec3,
    momentum: wp.vec3,
    mass: float,
    a: wp.mat33,
):
    """Add w (momentum + a (o, q, r), mass) to `raw` at each of a particle's 27 nodes. `lowest` is the first node, -1
    for a thread that only keeps the others company; `code` is its `stencil`, s0 to s7 the slots of the blocks. The
    whole warp must ask, in blocks of 128 threads (crew.BLOCK), for which there is room."""
    ...
