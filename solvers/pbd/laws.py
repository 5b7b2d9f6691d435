"""What position-based dynamics makes of material parameters at a given time step, as plain laws (see bind.py)."""


def largest_modulus(share: float, density: float, spacing: float, dt: float):
    """The most that a substep conveys [Pa]: share rho (d / dt)^2."""
    return density * share * spacing * spacing / (dt * dt)


def conveyed_modulus(modulus: float, share: float, density: float, spacing: float, dt: float):
    """Modulus [Pa] that acts at this dt: 1 / M_eff = 1 / M + dt^2 / (share rho d^2).

    The XPBD multiplier -C / (S + 1 / (M dt^2)) of a strain constraint C with inverse mass S is that of an elastic
    stress with this modulus: beyond what dt allows a stiffer material does not get stiffer.
    """
    most = largest_modulus(share, density, spacing, dt)
    return modulus * most / (modulus + most)


def bond_stiffness(youngs_modulus: float, spacing: float, rest: float):
    """Spring constant [N/m] of a bond of this rest length in a lattice of this spacing.

    Bonds to the 26 nearest of a cubic lattice with constants k (1, 1/2, 3/16) at lengths d (1, sqrt 2, sqrt 3) are
    elastically isotropic, C11 = 3 C12 = 3 C44 = 9 k / (4 d): Poisson ratio 1/4, as for all central forces, and
    E = 15 k / (8 d). Linear in between, for lattices out of order. Cauchy's relations; Born & Huang 1954.
    """
    ratio = rest / spacing
    near = 1.0 + 0.5 * (1.0 - max(ratio, 1.0)) / 0.41421356
    far = 0.1875 + 0.3125 * (1.7320508 - ratio) / 0.31783725
    share = near
    if ratio > 1.41421356:
        share = max(far, 0.05)
    return 8.0 / 15.0 * youngs_modulus * spacing * share
