"""The material law on Warp's vectors and matrices."""

import warp as wp

from fluidbench.native.pool import MOST, Pool
from fluidbench.native.scene import Phase, Scene

from . import constitutive
from .bind import warp_func

wp.set_module_options({"enable_backward": False, "fast_math": True})

pressure = warp_func(constitutive.pressure)
strain_and_flow = warp_func(constitutive.strain_and_flow, constitutive.flow_stress)
hardened = warp_func(constitutive.hardened)
plastic_strain = warp_func(constitutive.plastic_strain)


def plastic_strains(scene: Scene, pool: Pool) -> wp.array:
    """Equivalent plastic strain of every slot, a field of the pool; where nothing hardens one zero, never read."""
    if scene.hardens:
        return pool.add_field("plastic_strain", float, within=(0.0, MOST))
    return wp.zeros(1, dtype=float, device=scene.device)


@wp.func
def threshold_of(phase: Phase, i: int, plastic: wp.array(dtype=float)):
    """The yield stress of particle i now [Pa]."""
    threshold = phase.yield_stress
    if phase.hardening > 0.0:
        threshold = hardened(threshold, phase.saturated_yield_stress, phase.hardening, plastic[i])
    return threshold


@wp.func
def advanced(phase: Phase, modulus: float, threshold: float, l: wp.mat33, b: wp.vec3, s: wp.vec3, h: float):
    """The elastic tensor after a step h [s] under the velocity gradient l, its diagonal b, and s: xy, xz, yz; the share
    of its deviator that was kept."""
    xx, yy, zz, xy, xz, yz, kept = strain_and_flow(
        l[0, 0], l[0, 1], l[0, 2],
        l[1, 0], l[1, 1], l[1, 2],
        l[2, 0], l[2, 1], l[2, 2],
        b[0], b[1], b[2], s[0], s[1], s[2],
        modulus,
        threshold,
        phase.plastic_viscosity,
        phase.flow_index,
        phase.relaxation_rate,
        h,
    )  # fmt: skip
    return wp.vec3(xx, yy, zz), wp.vec3(xy, xz, yz), kept


@wp.func
def strained(
    phase: Phase,
    modulus: float,
    l: wp.mat33,
    b: wp.vec3,
    s: wp.vec3,
    h: float,
    i: int,
    plastic: wp.array(dtype=float),
):
    """The same of particle i, whose plastic strain grows where it hardens."""
    b, s, kept = advanced(phase, modulus, threshold_of(phase, i, plastic), l, b, s, h)
    if phase.hardening > 0.0:
        plastic[i] = plastic[i] + plastic_strain(b[0], b[1], b[2], s[0], s[1], s[2], kept)
    return b, s, kept


@wp.func
def flows(
    phase: Phase,
    l: wp.mat33,
    b: wp.vec3,
    s: wp.vec3,
    h: float,
    i: int,
    plastic: wp.array(dtype=float),
):
    """Whether particle i is a liquid's, or would yield in a step as it is."""
    flowing = phase.shear_modulus <= 0.0 or phase.relaxation_rate > 0.0
    if not flowing:
        _b, _s, kept = advanced(phase, phase.shear_modulus, threshold_of(phase, i, plastic), l, b, s, h)
        flowing = kept < 1.0
    return flowing


@wp.func
def shear_rate(l: wp.mat33):
    """sqrt(2 dev D : dev D) [1/s] of a velocity gradient."""
    d = 0.5 * (l + wp.transpose(l))
    return wp.sqrt(wp.max(2.0 * (wp.ddot(d, d) - wp.trace(d) * wp.trace(d) / 3.0), 0.0))
