"""Four floats at once, and what the threads of a GPU's warp do together. Each function has a portable fallback."""

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
    """Whether threads run in warps, all of which must take part in what they do together."""
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


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    *(float4*)&target.data[index] = make_float4(value[0], value[1], value[2], value[3]);
#else
    target.data[index] = value;
#endif
"""
)
def store_vec4(target: wp.array(dtype=wp.vec4), index: int, value: wp.vec4):
    """target[index] = value, 16 bytes at once."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
#if __CUDA_ARCH__ >= 900
    asm volatile("red.global.add.v4.f32 [%0], {%1, %2, %3, %4};"
        :: "l"(&target.data[index]), "f"(value[0]), "f"(value[1]), "f"(value[2]), "f"(value[3]) : "memory");
#else
    for (unsigned k = 0; k < 4; ++k) atomicAdd((float*)&target.data[index] + k, value[k]);
#endif
#else
    for (unsigned k = 0; k < 4; ++k) target.data[index][k] += value[k];
#endif
"""
)
def add_vec4(target: wp.array(dtype=wp.vec4), index: int, value: wp.vec4):
    """Add to target[index], as other threads of a GPU may at once; on the CPU for a kernel that one thread runs."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    return __ldg(&source.data[index]);
#else
    return source.data[index];
#endif
"""
)
def load_int(source: wp.array(dtype=int), index: int) -> int:
    """source[index] of an array without gaps, which the running kernel must not write."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    if (threads > 1) value += __shfl_xor_sync(0xffffffffu, value, 1);
    if (threads > 2) value += __shfl_xor_sync(0xffffffffu, value, 2);
    if (threads > 4) value += __shfl_xor_sync(0xffffffffu, value, 4);
    if (threads > 8) value += __shfl_xor_sync(0xffffffffu, value, 8);
    if (threads > 16) value += __shfl_xor_sync(0xffffffffu, value, 16);
#endif
    return value;
"""
)
def joined(value: float, threads: int) -> float:
    """The sum over a team of `threads` neighbouring threads, a power of two; the whole warp must ask."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    __shared__ float warps[32];
    for (int o = 16; o > 0; o >>= 1) value += __shfl_xor_sync(0xffffffffu, value, o);
    __syncthreads();
    if ((threadIdx.x & 31) == 0) warps[threadIdx.x >> 5] = value;
    __syncthreads();
    value = 0.0f;
    for (int w = 0; w < (int)(blockDim.x >> 5); ++w) value += warps[w];
#endif
    return value;
"""
)
def joined_in_block(value: float) -> float:
    """The sum over all threads of a block, whole warps, all of which must ask; on the CPU a thread is a block."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    const int lane = threadIdx.x & 31;
    const unsigned all = __ballot_sync(0xffffffffu, yes) >> (lane & ~(threads - 1));
    __syncwarp();
    const unsigned team = threads == 32 ? all : all & ((1u << threads) - 1u);
    return __popc(team & ((1u << (lane & (threads - 1))) - 1u)) | (__popc(team) << 8);
#else
    return yes ? 1 << 8 : 0;
#endif
"""
)
def ranked(yes: bool, threads: int) -> int:
    """How many of a team of `threads` before this one say yes, and from bit 8 on how many do; what they have written to
    memory is seen by all. The whole warp must ask."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    for (int o = 16; o > 0; o >>= 1) value = max(value, __shfl_xor_sync(0xffffffffu, value, o));
#endif
    return value;
"""
)
def largest_of_warp(value: int) -> int:
    """The largest value of the warp's threads. The whole warp must ask."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    const int lane = threadIdx.x & 31;
    int sum = value;
    for (int o = 1; o < 32; o <<= 1) {
        const int below = __shfl_up_sync(0xffffffffu, sum, o);
        if (lane >= o) sum += below;
    }
    return sum - value;
#else
    return 0;
#endif
"""
)
def sum_before(value: int) -> int:
    """The sum over the threads of the warp before this one. The whole warp must ask."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    return (threadIdx.x & 31) == 31;
#else
    return true;
#endif
"""
)
def last_of_warp() -> bool:
    """Whether this is the last thread of its warp; on the CPU each is a warp of its own."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    return __shfl_sync(0xffffffffu, value, 31);
#else
    return value;
#endif
"""
)
def from_last(value: int) -> int:
    """What the last thread of the warp has. The whole warp must ask."""
    ...
