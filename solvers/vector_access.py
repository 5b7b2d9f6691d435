"""Four floats at once: loads of 16 bytes and additions to memory that a warp of GPU threads prepares together.

Each function has a portable fallback; the CPU backend runs one thread and needs neither atomics nor company.
"""

import warp as wp


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    return true;
#else
    return false;
#endif
"""
)
def in_company() -> bool:
    """Whether threads run in warps, all of which must take part in `run_of` and `add_vec4`."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    const int lane = threadIdx.x & 31;
    const int before = __shfl_up_sync(0xffffffffu, key, 1);
    const bool head = lane == 0 || before != key;
    const unsigned heads = __ballot_sync(0xffffffffu, head);
    const unsigned later = lane == 31 ? 0u : heads >> (lane + 1);
    const int span = later ? __ffs(later) - 1 : 31 - lane;
    int longest = span;
    for (int o = 16; o > 0; o >>= 1) longest = max(longest, __shfl_xor_sync(0xffffffffu, longest, o));
    return (head ? 1 : 0) | (span << 1) | (longest << 6);
#else
    return 1;
#endif
"""
)
def run_of(key: int) -> int:
    """How this thread stands among neighbours of its warp with the same key: bit 0 for the first of a run, then five
    bits for how many follow, then five for the longest run of the warp."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    float a = value[0], b = value[1], c = value[2], d = value[3];
    const int span = (run >> 1) & 31, longest = run >> 6;
    for (int o = 1; o <= longest; o <<= 1) {
        const float e = __shfl_down_sync(0xffffffffu, a, o), f = __shfl_down_sync(0xffffffffu, b, o);
        const float g = __shfl_down_sync(0xffffffffu, c, o), h = __shfl_down_sync(0xffffffffu, d, o);
        if (o <= span) { a += e; b += f; c += g; d += h; }
    }
    if ((run & 1) && index >= 0) {
#if __CUDA_ARCH__ >= 900
        asm volatile("red.global.add.v4.f32 [%0], {%1, %2, %3, %4};"
            :: "l"(&target[index]), "f"(a), "f"(b), "f"(c), "f"(d) : "memory");
#else
        float* node = (float*)&target[index];
        atomicAdd(node, a); atomicAdd(node + 1, b); atomicAdd(node + 2, c); atomicAdd(node + 3, d);
#endif
    }
#else
    target[index] = target[index] + value;
#endif
"""
)
def add_vec4(target: wp.array(dtype=wp.vec4), index: int, value: wp.vec4, run: int):
    """target[index] += value. Threads of a run (see `run_of`) share an index: they add up, and the first one writes;
    a negative index writes nothing."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    const float4 node = __ldg((const float4*)&source[index]);
    return wp::vec_t<4, wp::float32>(node.x, node.y, node.z, node.w);
#else
    return source[index];
#endif
"""
)
def load_vec4(source: wp.array(dtype=wp.vec4), index: int) -> wp.vec4:
    """source[index], which the running kernel must not write."""
    ...
