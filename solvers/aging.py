"""What every method does to its state when its material cures or grows.

Curing: new bonds form without stress. When moduli change, shear stress and pressure carry over: the elastic tensor is
relieved in proportion, and the rest volume is taken anew such that the present volume has the present pressure.
Growth: rest volume grows while the present volume stays, so fresh foam is under pressure and pushes its neighbours.
"""

import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.scene import Phase, is_solid

from . import constitutive
from .bind import warp_func
from .flow import pressure

wp.set_module_options({"enable_backward": False})

# Offspring lie in no order: the density that a grid or a kernel sum sees fluctuates by a tenth. Corrections that only
# ever make matter denser must leave that alone: they rectified the noise into 5 to 9 % of volume.
DISORDER = wp.constant(0.1)
GROWN = wp.constant(0.99)  # of the fresh density, below which matter has grown and split

relieved = warp_func(constitutive.relieved)


@wp.func
def relief(before: Phase, after: Phase):
    """What shear strain is multiplied by where the modulus changes and stress carries over."""
    ratio = float(0.0)
    if after.shear_modulus > 0.0:
        ratio = wp.min(before.shear_modulus / after.shear_modulus, 1.0e3)
    return ratio


@wp.func
def relieved_tensor(before: Phase, after: Phase, b: wp.vec3, s: wp.vec3):
    """The elastic tensor (diagonal b, s: xy, xz, yz) that carries the shear stress over to another modulus."""
    if after.shear_modulus <= 0.0:
        return wp.vec3(1.0, 1.0, 1.0), wp.vec3(0.0, 0.0, 0.0)
    ratio = relief(before, after)
    b_xx, b_yy, b_zz, b_xy, b_xz, b_yz = relieved(b[0], b[1], b[2], s[0], s[1], s[2], ratio)
    return wp.vec3(b_xx, b_yy, b_zz), wp.vec3(b_xy, b_xz, b_yz)


@wp.func
def carried_compression(before: Phase, after: Phase, compression: float):
    """rho / rho0 - 1 that has the same pressure with another bulk modulus (linear about rest)."""
    p = pressure(compression, before.bulk_modulus, before.tait, before.tension_limit)
    return p / after.bulk_modulus


@wp.func
def rest_density(mass: wp.array(dtype=float), volume: wp.array(dtype=float), i: int):
    """Of a particle that may have grown [kg/m^3]."""
    return mass[i] / volume[i]


@wp.kernel
def swell(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    growth: wp.array(dtype=float),
    # outputs
    volume: wp.array(dtype=float),
):
    """Rest volume grows at `growth` [1/s]."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and growth[i] > 0.0:
        volume[i] = volume[i] * wp.exp(growth[i] * dt[world])


@wp.kernel
def swell_at_volume(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    growth: wp.array(dtype=float),
    # outputs
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
):
    """The same for a method that integrates J: an eigenstrain, the present volume V0 J stays."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and growth[i] > 0.0:
        factor = wp.exp(growth[i] * dt[world])
        volume[i] = volume[i] * factor
        volume_ratio[i] = volume_ratio[i] / factor


@wp.kernel
def swell_by_phase(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    growth: wp.array(dtype=float),
    # outputs
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
):
    """The same for a method that integrates J of solids alone."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and growth[i] > 0.0:
        factor = wp.exp(growth[i] * dt[world])
        volume[i] = volume[i] * factor
        if is_solid(phases[world, phase_of[i]]):
            volume_ratio[i] = volume_ratio[i] / factor


@wp.func
def relieve(
    before: Phase, after: Phase, i: int, elastic_normal: wp.array(dtype=wp.vec3), elastic_shear: wp.array(dtype=wp.vec3)
):
    """Carry the shear stress of particle i over."""
    b, s = relieved_tensor(before, after, elastic_normal[i], elastic_shear[i])
    elastic_normal[i] = b
    elastic_shear[i] = s


@wp.kernel
def relieve_off_linear(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    due: wp.array(dtype=int),
    phase_of: wp.array(dtype=int),
    # outputs
    off_linear: wp.array(dtype=wp.vec3),
):
    """Carry over what pulls back strain that no gradient shows, before the phase changes."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and due[i] != phase_of[i]:
        off_linear[i] = relief(phases[world, phase_of[i]], phases[world, due[i]]) * off_linear[i]


@wp.kernel
def harden(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    due: wp.array(dtype=int),
    # outputs
    phase_of: wp.array(dtype=int),
):
    """Move particles to the phase they are due, where nothing is elastic and no pressure law holds."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and due[i] != phase_of[i]:
        phase_of[i] = due[i]


@wp.kernel
def harden_at_ratio(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    due: wp.array(dtype=int),
    # outputs
    phase_of: wp.array(dtype=int),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
):
    """The same for a method that integrates J: the present volume V0 J stays."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and due[i] != phase_of[i]:
        before, after = phases[world, phase_of[i]], phases[world, due[i]]
        phase_of[i] = due[i]
        relieve(before, after, i, elastic_normal, elastic_shear)
        j = volume_ratio[i]
        carried = 1.0 / (1.0 + carried_compression(before, after, 1.0 / j - 1.0))
        volume_ratio[i] = carried
        volume[i] = volume[i] * (j / carried)


@wp.kernel
def harden_at_density(
    share: wp.vec3i,
    elastic: int,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    due: wp.array(dtype=int),
    mass: wp.array(dtype=float),
    density: wp.array(dtype=float),
    # outputs
    phase_of: wp.array(dtype=int),
    volume: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    off_linear: wp.array(dtype=wp.vec3),
):
    """The same for a method that integrates density, which stays, and the strain that no gradient shows."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and due[i] != phase_of[i]:
        before, after = phases[world, phase_of[i]], phases[world, due[i]]
        phase_of[i] = due[i]
        if elastic == 1:
            relieve(before, after, i, elastic_normal, elastic_shear)
            off_linear[i] = relief(before, after) * off_linear[i]
        compression = density[i] / rest_density(mass, volume, i) - 1.0
        volume[i] = mass[i] * (1.0 + carried_compression(before, after, compression)) / density[i]
