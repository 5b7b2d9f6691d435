"""Chance that depends on what a particle is, not on where it lies in memory: the same for every method and device."""

import zlib

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Chance:
    """A source of random numbers for one purpose."""

    key: int


def chance_of(seed: int, purpose: str) -> Chance:
    """The source for a scenario's seed and a purpose."""
    chance = Chance()
    chance.key = zlib.crc32(f"{seed} {purpose}".encode()) & 0x7FFFFFFF
    return chance


@wp.func
def uniform(chance: Chance, particle: int, generation: int, draw: int):
    """A number in [0, 1) for a particle (its `origin`), a generation and a draw."""
    state = wp.rand_init(chance.key, particle)
    state = wp.rand_init(int(state) + generation, draw)
    return wp.randf(state)


@wp.func
def direction(chance: Chance, particle: int, generation: int, draw: int):
    """A random unit vector, uniform on the sphere; uses draws `draw` and `draw + 1`."""
    z = 2.0 * uniform(chance, particle, generation, draw) - 1.0
    angle = 6.2831853 * uniform(chance, particle, generation, draw + 1)
    flat = wp.sqrt(wp.max(1.0 - z * z, 0.0))
    return wp.vec3(flat * wp.cos(angle), flat * wp.sin(angle), z)
