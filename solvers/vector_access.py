"""Four floats at once: one vector reduction and one 16-byte load, where the GPU has them."""

import warp as wp


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    asm volatile("red.global.add.v4.f32 [%0], {%1, %2, %3, %4};"
        :: "l"(&target[index]), "f"(value[0]), "f"(value[1]), "f"(value[2]), "f"(value[3]) : "memory");
#elif defined(__CUDA_ARCH__)
    float* node = (float*)&target[index];
    for (int i = 0; i < 4; ++i) atomicAdd(node + i, value[i]);
#else
    target[index] = target[index] + value;
#endif
"""
)
def add_vec4(target: wp.array(dtype=wp.vec4), index: int, value: wp.vec4):
    """target[index] += value, atomic per component. The CPU backend runs one thread and needs no atomics."""
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
