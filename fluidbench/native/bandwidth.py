"""What the memory of a device gives: the ceilings that a method's speed is held against."""

import time

import warp as wp

from .device import quiet_warp
from .vector_access import load_vec4, store_vec4

quiet_warp()
wp.set_module_options({"enable_backward": False})
QUAD = 16  # bytes of what is read at a time
GATHERS = wp.constant(64)  # reads of a thread
SECONDS = 0.2  # that a measurement takes, at least


@wp.kernel
def stream(source: wp.array(dtype=wp.vec4), target: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    store_vec4(target, i, load_vec4(source, i))


@wp.kernel
def gather(mask: int, source: wp.array(dtype=wp.vec4), target: wp.array(dtype=wp.vec4)):
    """Reads from all over the 16 kB around, time and again."""
    i = wp.tid()
    total = wp.vec4()
    for k in range(GATHERS):
        total += load_vec4(source, (i + ((k * 40503) & 1023)) & mask)
    store_vec4(target, i, total)


def bandwidth(device: str) -> dict[str, float]:
    """Bytes a second that a device (one thread of the CPU) streams to and from memory, and reads from its nearest
    caches."""
    on_cpu = wp.get_device(device).is_cpu
    large, small = (2**24, 2**16) if on_cpu else (2**27, 2**20)  # 256 MB and 1 MB; 2 GB and 16 MB
    with wp.ScopedDevice(device):
        source, target = (wp.zeros(large, dtype=wp.vec4) for _ in range(2))
        streamed = _rate(lambda: wp.launch(stream, large, [source], [target]), 2 * QUAD * large)
        gathered = _rate(lambda: wp.launch(gather, small, [small - 1, source], [target]), QUAD * int(GATHERS) * small)
    return {"memory": streamed, "cache": gathered}


def _rate(launch, moved: int) -> float:
    """Bytes a second: the best of repeated launches, for other work only slows them down."""
    launch()
    wp.synchronize()
    best, begin = float("inf"), time.perf_counter()
    while time.perf_counter() - begin < SECONDS:
        start = time.perf_counter()
        launch()
        wp.synchronize()
        best = min(best, time.perf_counter() - start)
    return moved / best
