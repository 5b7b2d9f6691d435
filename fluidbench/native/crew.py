"""Launches of a native method, and the threads of the CPU that share them out.

Warp runs a launch on one thread of the CPU. A crew of several records the same launches once a thread, each its share
of every kernel that takes one, and all meet after each launch: what a kernel reads was written by the one before, as on
a GPU. Shares are small and dealt in turn, for only the first part of a pool is in use. Which thread does what never
changes a sum: results are the same bits for any number of threads.
"""

import ctypes
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import warp as wp
from warp import launch as uncounted_launch  # meeting is no launch of the method's

wp.set_module_options({"enable_backward": False})
BLOCK = 128  # threads of a block on a GPU, of every launch: each other number would be compiled anew
DEAL = 5  # shares of 2^5 particles, where there are plenty


@wp.func
def index_of(share: wp.vec3i, thread: int):
    """The index of a thread's item among all: share is (whose turn, of how many, log2 of items at a time)."""
    turn = thread >> share[2]
    return ((turn * share[1] + share[0]) << share[2]) + thread - (turn << share[2])


@wp.func_native(
    snippet="""
#if !defined(__CUDA_ARCH__)
    wp::int32* const arrived = &gate.data[0];
    wp::int32* const round = &gate.data[1];
    const wp::int32 now = __atomic_load_n(round, __ATOMIC_ACQUIRE);
    if (__atomic_add_fetch(arrived, 1, __ATOMIC_ACQ_REL) == threads) {
        __atomic_store_n(arrived, 0, __ATOMIC_RELAXED);
        __atomic_store_n(round, now + 1, __ATOMIC_RELEASE);
    } else {
        wp::int32 turns = 0;
        while (__atomic_load_n(round, __ATOMIC_ACQUIRE) == now) {
#if defined(__x86_64__)
            __builtin_ia32_pause();
#endif
            if (++turns > 1000) ((void (*)())give_way)();
        }
    }
#endif
"""
)
def wait_for_all(gate: wp.array(dtype=int), threads: int, give_way: wp.uint64):
    """Return once `threads` threads have come: they spin, then let others have the core."""
    ...


@wp.kernel
def meet(gate: wp.array(dtype=int), threads: int, give_way: wp.uint64):
    wait_for_all(gate, threads, give_way)


@wp.kernel
def put(value: int, flag: wp.array(dtype=int)):
    """flag[0] = value, in its turn among launches."""
    flag[0] = value


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    atomicOr(&fault.data[0], bit);
#else
    __atomic_fetch_or(&fault.data[0], bit, __ATOMIC_RELAXED);
#endif
"""
)
def raise_fault(fault: wp.array(dtype=int), bit: int):
    """Set a bit of fault[0], whichever threads set others."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    return atomicCAS(&flags.data[index], 0, -1) == 0;
#else
    wp::int32 free = 0;
    return __atomic_compare_exchange_n(&flags.data[index], &free, -1, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED);
#endif
"""
)
def claimed(flags: wp.array(dtype=int), index: int) -> bool:
    """Turn flags[index] from 0 to -1; false where another thread was first."""
    ...


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    return atomicAdd(&counter.data[index], 1);
#else
    return __atomic_fetch_add(&counter.data[index], 1, __ATOMIC_RELAXED);
#endif
"""
)
def drawn(counter: wp.array(dtype=int), index: int) -> int:
    """counter[index], which goes up by one: another number for each that asks."""
    ...


def _give_way() -> int:
    """The address of the system's function that lets another thread have the core."""
    library = ctypes.WinDLL("kernel32") if sys.platform == "win32" else ctypes.CDLL(None)
    function = library.SwitchToThread if sys.platform == "win32" else library.sched_yield
    return ctypes.cast(function, ctypes.c_void_p).value or 0


class Crew:
    """Launches kernels on a device; on the CPU, recorded launches are shared by `threads` threads.

    A kernel that can be shared takes its share (wp.vec3i, see `index_of`) as first argument, `share`, which is not
    among the inputs. Others are launched by the first thread alone.
    """

    def __init__(self, device: wp.Device, threads: int = 1) -> None:
        self.device = device
        self.threads = threads if device.is_cpu else 1
        self.graphs: dict[Any, list[Any]] = {}
        self._number, self._of = 0, 1  # the thread that is being recorded, and of how many
        if self.threads > 1:
            self._gate = wp.zeros(32, dtype=int, device=device)
            self._others = ThreadPoolExecutor(self.threads - 1, thread_name_prefix="crew")
            self._address = _give_way()
            wp.load_module(device=device)

    @property
    def leading(self) -> bool:
        """Whether what is launched now is the part of the first thread."""
        return self._number == 0

    def load(self, module: Any) -> None:
        """Compile and load a module as its kernels will be launched."""
        wp.load_module(module, device=self.device, block_dim=None if self.device.is_cpu else BLOCK)

    def launch(self, kernel: Any, size: Any, inputs: Sequence[Any], outputs: Sequence[Any] = ()) -> None:
        assert not kernel.is_generic, "a recording on the CPU tells kernels by their names alone"
        shared = kernel.adj.args[0].label == "share"
        if shared:
            deal = DEAL if size % 2**DEAL == 0 and size >= 64 * 2**DEAL else 0
            turns = (size >> deal) + self._of - 1 - self._number
            size = (turns // self._of) << deal
            inputs = [wp.vec3i(self._number, self._of, deal), *inputs]
        if size and (shared or self._number == 0):
            launch = wp.launch if self._number == 0 else uncounted_launch
            launch(kernel, size, inputs, outputs, device=self.device, block_dim=BLOCK)
        self._meet()

    def _meet(self) -> None:
        if self._of > 1:
            uncounted_launch(meet, 1, [self._gate, self._of, wp.uint64(self._address)], device=self.device)

    def alone(self, work: Callable[[], object]) -> None:
        """Enqueue what is no launch: the first thread's."""
        if self.leading:
            work()
        self._meet()

    def run(self, key: Any, work: Callable[[], object]) -> None:
        """Replay some work, recorded at the first time."""
        self.replay([(self.recorded(key, work), 1)])

    def recorded(self, key: Any, work: Callable[[], object]) -> list[Any]:
        """The graphs of some work, one a thread."""
        if key not in self.graphs:
            self.graphs[key] = self._record(work)
        return self.graphs[key]

    def _record(self, work: Callable[[], object]) -> list[Any]:
        graphs = []
        try:
            self._of = self.threads
            for number in range(self.threads):
                self._number = number
                with wp.ScopedCapture(device=self.device) as capture:
                    work()
                graphs.append(capture.graph)
        finally:
            self._number, self._of = 0, 1
        return graphs

    def replay(self, parts: Sequence[tuple[Sequence[Any], int]]) -> None:
        """Launch what was recorded, one part after the other, each so many times; on the CPU, it is done then."""
        shares = [[(graphs[k], times) for graphs, times in parts] for k in range(self.threads)]
        waiting = [self._others.submit(_replay, share) for share in shares[1:]]
        _replay(shares[0])
        for future in waiting:
            future.result()


def _replay(share: Sequence[tuple[Any, int]]) -> None:
    for graph, times in share:
        for _ in range(times):
            wp.capture_launch(graph)
