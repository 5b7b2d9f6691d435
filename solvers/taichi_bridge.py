"""Taichi beside Warp on the same memory: start-up, types, and launches on Warp's arrays without copies.

Kernels of Taichi read a NumPy header over the memory of a Warp array. On CUDA the header points to device memory, which
Taichi recognises and uses in place; nobody reads such a header on the host.
"""

import contextlib
import ctypes
import functools
import io
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
import taichi as ti

from fluidbench.errors import UserError
from fluidbench.native.device import note_launch
from fluidbench.native.scene import Phase

from .bind import rebound

vec2, vec3, vec4, ivec3, mat3 = ti.math.vec2, ti.math.vec3, ti.math.vec4, ti.math.ivec3, ti.math.mat3
Floats = ti.types.ndarray(dtype=ti.f32, ndim=1)
Ints = ti.types.ndarray(dtype=ti.i32, ndim=1)
Vectors = ti.types.ndarray(dtype=vec3, ndim=1)
Quads = ti.types.ndarray(dtype=vec4, ndim=1)
Matrices = ti.types.ndarray(dtype=mat3, ndim=1)
Phases = ti.types.ndarray(dtype=ti.f32, ndim=3)  # world, level of cure, parameter in the order of scene.Phase
Forces = ti.types.ndarray(dtype=ti.f32, ndim=2)  # world, component: uniform, then gradient by rows
SCALARS = {wp.float32: ti.f32, wp.int32: ti.i32, wp.vec3: vec3, wp.vec3i: ivec3}
TYPESTR = {wp.float32: "<f4", wp.int32: "<i4", wp.int64: "<i8"}
REPLAYS = ti.__name__ == "taichi" and ti.__version__[:2] == (1, 7)  # others launch in ways of their own: left alone
_running: list[tuple[str, int]] = []  # architecture and threads, once started


def _keep_the_smallest_numbers() -> None:
    """Taichi tells the processor to take the smallest numbers for zero, in all of this process: 1e-310 would be read as
    0.0 from then on. Back to the default environment of C's <fenv.h>, FE_DFL_ENV."""
    if sys.platform == "linux":
        ctypes.CDLL(None).fesetenv(ctypes.c_void_p(-1))


def start(device: str, threads: int) -> None:
    """Start Taichi for a device, once in a process; raises UserError when it runs with other settings already."""
    wanted = ("cpu" if device == "cpu" else "cuda", threads)
    if not _running:
        with contextlib.redirect_stdout(io.StringIO()):
            ti.init(
                arch=getattr(ti, wanted[0]),
                cpu_max_num_threads=threads,
                default_fp=ti.f32,
                default_ip=ti.i32,
                offline_cache=True,
                log_level=ti.ERROR,
            )
        _keep_the_smallest_numbers()
        if ti.cfg.arch not in ({ti.x64, ti.arm64} if wanted[0] == "cpu" else {ti.cuda}):
            raise UserError(f"taichi could not start on {wanted[0]} and took {ti.cfg.arch} instead")
        _running.append(wanted)
    if _running[0] != wanted:
        raise UserError(f"taichi runs on {_running[0]} in this process already and cannot be restarted for {wanted}")


@functools.cache
def taichi_func(law: Callable, *inner: Callable) -> Callable:
    """A law as a Taichi function, see bind.py; `inner` are the laws that it calls, in order of their own needs."""
    names: dict[str, object] = {
        "sqrt": ti.sqrt,
        "exp": ti.exp,
        "pow": ti.pow,
        "min": ti.min,
        "max": ti.max,
        "abs": ti.abs,
    }
    for function in inner:
        names[function.__name__] = taichi_func(function)
    return ti.func(rebound(law, names))


@functools.cache
def struct_of(struct: Any) -> Any:
    """A Warp structure's numbers and vectors as a Taichi type; its arrays become arguments of their own."""
    return ti.types.struct(**{name: SCALARS[var.type] for name, var in struct.vars.items() if var.type in SCALARS})


PhaseT = struct_of(Phase)


@ti.func
def phase_at(phases: ti.template(), world, level):
    """A row of the phase table."""
    return PhaseT(*[phases[world, level, k] for k in ti.static(range(len(Phase.vars)))])


@ti.func
def force_at(force: ti.template(), world, x):
    """Force per unit mass [m/s^2] at a point."""
    f = vec3(force[world, 0], force[world, 1], force[world, 2])
    for a in ti.static(range(3)):
        for b in ti.static(range(3)):
            f[a] += force[world, 3 + 3 * a + b] * x[b]
    return f


@ti.func
def is_solid(phase):
    """Whether the material never flows."""
    return phase.shear_modulus > 0.0 and phase.yield_stress >= phase.shear_modulus and phase.relaxation_rate == 0.0


@ti.func
def beyond(x, limit):
    """Whether |x| exceeds a positive limit or is no number: by its bits, for Taichi compares as if all were numbers."""
    return (ti.bit_cast(ti.cast(x, ti.f32), ti.i32) & 0x7FFFFFFF) > ti.bit_cast(ti.cast(limit, ti.f32), ti.i32)


@ti.func
def too_fast(v, top_speed):
    """Whether a velocity cannot come from the scenario."""
    return beyond(v.norm_sqr(), top_speed * top_speed)


@ti.func
def rest_density(mass: ti.template(), volume: ti.template(), i):
    """Of a particle that may have grown [kg/m^3]."""
    return mass[i] / volume[i]


@ti.func
def symmetric(b, s):
    """The matrix with diagonal b and off-diagonal s: xy, xz, yz."""
    return mat3(b[0], s[0], s[1], s[0], b[1], s[2], s[1], s[2], b[2])


class _Header:
    """What NumPy needs to know to describe memory that it does not own."""

    def __init__(self, array: wp.array) -> None:
        inner, dtype = (), array.dtype
        if hasattr(dtype, "vars"):  # a structure: all of its members are float32
            inner, dtype = (wp.types.type_size_in_bytes(dtype) // 4,), wp.float32
        elif hasattr(dtype, "_shape_"):
            inner, dtype = dtype._shape_, dtype._wp_scalar_type_
        self.__array_interface__ = {
            "data": (array.ptr, False),
            "shape": (*array.shape, *inner),
            "typestr": TYPESTR[dtype],
            "version": 3,
        }


class Taichi:
    """Launches Taichi's kernels on Warp's arrays and structures."""

    name = "taichi"

    def __init__(self, device: wp.Device, threads: int) -> None:
        self.device, self.threads = device, threads
        self._known: dict[int, tuple[Any, list[Any]]] = {}
        self._compiled: set[tuple[Any, ...]] = set()
        self._replays: dict[tuple[Any, ...], Callable[[], None]] = {}
        start("cpu" if device.is_cpu else "cuda", threads)

    def launch(self, kernel: Callable, size: int, inputs: Sequence[Any], outputs: Sequence[Any] = ()) -> None:
        """Run a kernel, which finds its size in its arguments.

        Handing some twenty arguments over from Python takes longer than most kernels do, and they are always the same:
        the first call compiles, the second is recorded, later ones are replayed.
        """
        note_launch()
        arguments = (*inputs, *outputs)
        call = (kernel, *(a if isinstance(a, (int, float)) else id(a) for a in arguments))
        if call in self._replays:
            self._replays[call]()
            return
        parts = [part for argument in arguments for part in self._translated(argument)]
        if call in self._compiled and REPLAYS:
            self._replays[call] = _recorded(kernel, parts)
        else:
            self._compiled.add(call)
            kernel(*parts)

    def repeat(self, going: wp.array, body: Callable[[], None]) -> None:
        self.wait()
        while going.numpy()[0]:
            body()
            self.wait()

    def prepare(self, solver: Any) -> None:
        """Taichi compiles a kernel when it is called: one substep of an empty pool calls them all. What the pool holds
        is put back: a pass may copy whole arrays."""
        arrays = [solver.pool.count, *solver.pool.fields.values()]
        kept = [wp.clone(array) for array in arrays]
        solver.pool.count.zero_()
        solver.refresh()
        solver.substep()
        self.wait()
        for array, before in zip(arrays, kept, strict=True):
            wp.copy(array, before)

    def _translated(self, argument: Any) -> list[Any]:
        """What a Warp argument is to Taichi; arrays and structures are kept, so they must not be replaced."""
        if isinstance(argument, (int, float)):
            return [argument]
        if id(argument) not in self._known:
            self._known[id(argument)] = (argument, _translate(argument))
        return self._known[id(argument)][1]

    def wait(self) -> None:
        wp.synchronize_device(self.device)
        ti.sync()


class _Listener:
    """Stands in for one of Taichi's objects during a call: passes everything on, and keeps the calls of methods."""

    def __init__(self, target: Any) -> None:
        self.target, self.calls = target, []

    def __getattr__(self, name: str) -> Any:
        method = getattr(self.target, name)

        def passed_on(*args: Any) -> Any:
            self.calls.append((method.__name__, args))
            return method(*(a.target if isinstance(a, _Listener) else a for a in args))

        return passed_on


def _recorded(kernel: Callable, parts: list[Any]) -> Callable[[], None]:
    """Call a compiled kernel and return what calls it again with the same arguments.

    Taichi fills a launch context for every call, in Python, argument by argument, with checks; the second time the same
    calls are made without. (The context itself cannot be kept: on CUDA a launch consumes it.)
    """
    runtime, primal = ti.lang.impl.get_runtime(), kernel._primal
    compiled_kernel = primal.compiled_kernels[primal.ensure_compiled(*parts)]
    program, context = runtime.prog, _Listener(compiled_kernel.make_launch_context())
    function, listening = _Listener(compiled_kernel), _Listener(program)
    function.make_launch_context = lambda: context
    runtime.prog = listening
    try:
        primal.launch_kernel(function, *parts)
    finally:
        runtime.prog = program
    (compiled,) = [args[0] for name, args in listening.calls if name == "launch_kernel"]
    settings = [(getattr(type(context.target), name), args) for name, args in context.calls]

    def again() -> None:
        fresh = compiled_kernel.make_launch_context()
        for set_argument, args in settings:
            set_argument(fresh, *args)
        program.launch_kernel(compiled, fresh)

    return again


def _translate(argument: Any) -> list[Any]:
    if isinstance(argument, wp.array):
        return [np.asarray(_Header(argument))]
    struct = argument._cls
    values = {name: getattr(argument, name) for name in struct.vars}
    values = {name: v for name, v in values.items() if not hasattr(v, "_cls")}  # of a part, which no pass here has
    plain = {name: _plain(v) for name, v in values.items() if not isinstance(v, wp.array)}
    arrays = [np.asarray(_Header(v)) for v in values.values() if isinstance(v, wp.array)]
    return ([struct_of(struct)(**plain)] if plain else []) + arrays


def _plain(value: Any) -> Any:
    """A Warp vector as a Taichi one."""
    if isinstance(value, wp.vec3i):
        return ivec3(*[int(v) for v in value])
    return vec3(*[float(v) for v in value]) if isinstance(value, wp.vec3) else value
