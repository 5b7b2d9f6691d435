"""The material law on Taichi's vectors and matrices."""

from . import constitutive
from .taichi_bridge import taichi_func, ti, vec3

pressure = taichi_func(constitutive.pressure)
strain_and_flow = taichi_func(constitutive.strain_and_flow, constitutive.flow_stress)
hardened = taichi_func(constitutive.hardened)
plastic_strain = taichi_func(constitutive.plastic_strain)


@ti.func
def strained(phase, modulus, l, b, s, h, i, plastic: ti.template()):
    """The elastic tensor of particle i after a step h [s] under the velocity gradient l, its diagonal b, and s: xy, xz,
    yz; the share of its deviator that was kept. Its plastic strain grows where it hardens."""
    threshold = phase.yield_stress
    if phase.hardening > 0.0:
        threshold = hardened(threshold, phase.saturated_yield_stress, phase.hardening, plastic[i])
    xx, yy, zz, xy, xz, yz, kept = strain_and_flow(
        l[0, 0],
        l[0, 1],
        l[0, 2],
        l[1, 0],
        l[1, 1],
        l[1, 2],
        l[2, 0],
        l[2, 1],
        l[2, 2],
        b[0],
        b[1],
        b[2],
        s[0],
        s[1],
        s[2],
        modulus,
        threshold,
        phase.plastic_viscosity,
        phase.flow_index,
        phase.relaxation_rate,
        h,
    )
    if phase.hardening > 0.0:
        plastic[i] += plastic_strain(xx, yy, zz, xy, xz, yz, kept)
    return vec3(xx, yy, zz), vec3(xy, xz, yz), kept


@ti.func
def shear_rate(l):
    """sqrt(2 dev D : dev D) [1/s] of a velocity gradient."""
    d = 0.5 * (l + l.transpose())
    return ti.sqrt(ti.max(2.0 * (d.norm_sqr() - d.trace() ** 2 / 3.0), 0.0))
