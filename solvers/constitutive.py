"""The one material law: elasto-viscoplastic, isotropic, finite strain.

State of a material point: the volume ratio J = rho0 / rho and the isochoric elastic left Cauchy-Green tensor b
(symmetric, det b = 1), written as its six components. Kirchhoff stress

    tau = -J p(J) 1 + G dev(b) + 2 J eta dev(D),

with the pressure from an equation of state, the elastic deviator limited by Herschel-Bulkley flow and an explicit
Newtonian viscosity eta. Flow follows Simo (1988) and Yue et al. (2015, ACM TOG 34:160): the yield criterion is von
Mises, sqrt(J2) = yield stress in pure shear, so a bar in uniaxial compression yields at sqrt(3) times that. It may
harden with plastic strain (Voce): a step flows at the yield stress with which it begins. With a relaxation time instead
of a yield stress b is the conformation tensor of an Oldroyd-B liquid (det b is then free).

Every function is a plain law of floats (see bind.py): no solver, no array.
"""

from math import exp, pow, sqrt

STRETCHED = 1.0e6  # volume ratio, or stretch squared, that no matter reaches; nor does it reach one over it [-]


def pressure(compression: float, bulk_modulus: float, tait: float, tension_limit: float):
    """Pressure [Pa] at compression = rho / rho0 - 1.

    Linear (tait = 0): p = K c. Tait with gamma = 7 (tait = 1): p = K / 7 ((1 + c)^7 - 1), expanded in c because
    float32 would cancel. Tension is cut at `tension_limit` [Pa]. Monaghan 1994, J. Comput. Phys. 110:399.
    """
    c = compression
    stiffening = c * (3.0 + c * (5.0 + c * (5.0 + c * (3.0 + c * (1.0 + c / 7.0)))))
    return max(bulk_modulus * c * (1.0 + tait * stiffening), -tension_limit)


def flow_stress(trial: float, threshold: float, consistency: float, index: float, stiffness: float):
    """Shear stress tau = sqrt(J2) [Pa] after a step of Herschel-Bulkley flow, implicit in time.

    Solves tau + S r = trial with tau = threshold + consistency r^index for the plastic shear rate r [1/s];
    S = G dt tr(b) / 3 [Pa s] is `stiffness`. Closed form for index = 1; otherwise Newton from the side on which it is
    monotone. Below the threshold nothing flows. Yue et al. 2015, section 4.
    """
    tau = trial
    over = trial - threshold
    if over > 0.0:
        if index == 1.0 or consistency <= 0.0:
            tau = threshold + over * consistency / (consistency + stiffness)
        else:
            share = 1.0
            if index < 1.0:
                share = 0.5
            rate = min(pow(share * over / consistency, 1.0 / index), share * over / stiffness)
            for _ in range(8):
                power = consistency * pow(rate, index)
                slope = index * power / rate + stiffness
                rate = rate - (power + stiffness * rate - over) / slope
            tau = trial - stiffness * rate
    return tau


def hardened(initial: float, saturated: float, rate: float, strain: float):
    """Yield stress in pure shear [Pa] after an equivalent plastic strain `strain` [-] (that of uniaxial stress):
    saturated + (initial - saturated) exp(-rate strain). Voce 1948, J. Inst. Metals 74:537.
    """
    return saturated + (initial - saturated) * exp(-rate * strain)


def plastic_strain(b_xx: float, b_yy: float, b_zz: float, b_xy: float, b_xz: float, b_yz: float, keep: float):
    """Equivalent plastic strain of a step [-]: (trial - tau) / (sqrt(3) G tr(b) / 3), tau = sqrt(J2).

    `keep` = tau / trial is the share of the deviator that `strain_and_flow` kept of its trial, b what it returned.
    """
    m = (b_xx + b_yy + b_zz) / 3.0
    s_xx = b_xx - m
    s_yy = b_yy - m
    s_zz = b_zz - m
    j2 = 0.5 * (s_xx * s_xx + s_yy * s_yy + s_zz * s_zz) + b_xy * b_xy + b_xz * b_xz + b_yz * b_yz
    return (1.0 - keep) * sqrt(j2) / (sqrt(3.0) * keep * m)


def strain_and_flow(
    l_xx: float,
    l_xy: float,
    l_xz: float,
    l_yx: float,
    l_yy: float,
    l_yz: float,
    l_zx: float,
    l_zy: float,
    l_zz: float,
    b_xx: float,
    b_yy: float,
    b_zz: float,
    b_xy: float,
    b_xz: float,
    b_yz: float,
    shear_modulus: float,
    threshold: float,
    consistency: float,
    index: float,
    relaxation: float,
    dt: float,
):
    """b after a step dt [s] under the velocity gradient l_ij = dv_i/dx_j [1/s]: (xx, yy, zz, xy, xz, yz); and the share
    of the trial's deviator that was kept.

    Trial: b <- A b A^T, A = 1 + dt dev(l). With relaxation = 0, sqrt(J2) = G |dev b| / sqrt(2) returns to
    `flow_stress`, and b is scaled back to det b = 1 (one Newton step for the cube root). Otherwise b is the
    conformation tensor of an Oldroyd-B liquid of relaxation rate `relaxation` [1/s]: b - 1 decays as
    exp(-relaxation dt).
    """
    t = (l_xx + l_yy + l_zz) / 3.0
    a_xx = 1.0 + dt * (l_xx - t)
    a_yy = 1.0 + dt * (l_yy - t)
    a_zz = 1.0 + dt * (l_zz - t)
    a_xy = dt * l_xy
    a_xz = dt * l_xz
    a_yx = dt * l_yx
    a_yz = dt * l_yz
    a_zx = dt * l_zx
    a_zy = dt * l_zy
    # A b
    p_xx = a_xx * b_xx + a_xy * b_xy + a_xz * b_xz
    p_xy = a_xx * b_xy + a_xy * b_yy + a_xz * b_yz
    p_xz = a_xx * b_xz + a_xy * b_yz + a_xz * b_zz
    p_yx = a_yx * b_xx + a_yy * b_xy + a_yz * b_xz
    p_yy = a_yx * b_xy + a_yy * b_yy + a_yz * b_yz
    p_yz = a_yx * b_xz + a_yy * b_yz + a_yz * b_zz
    p_zx = a_zx * b_xx + a_zy * b_xy + a_zz * b_xz
    p_zy = a_zx * b_xy + a_zy * b_yy + a_zz * b_yz
    p_zz = a_zx * b_xz + a_zy * b_yz + a_zz * b_zz
    # (A b) A^T
    c_xx = p_xx * a_xx + p_xy * a_xy + p_xz * a_xz
    c_yy = p_yx * a_yx + p_yy * a_yy + p_yz * a_yz
    c_zz = p_zx * a_zx + p_zy * a_zy + p_zz * a_zz
    c_xy = p_xx * a_yx + p_xy * a_yy + p_xz * a_yz
    c_xz = p_xx * a_zx + p_xy * a_zy + p_xz * a_zz
    c_yz = p_yx * a_zx + p_yy * a_zy + p_yz * a_zz
    # return of the deviator
    m = (c_xx + c_yy + c_zz) / 3.0
    s_xx = c_xx - m
    s_yy = c_yy - m
    s_zz = c_zz - m
    j2 = 0.5 * (s_xx * s_xx + s_yy * s_yy + s_zz * s_zz) + c_xy * c_xy + c_xz * c_xz + c_yz * c_yz
    trial = shear_modulus * sqrt(j2)
    keep = 1.0
    if trial > threshold:
        keep = flow_stress(trial, threshold, consistency, index, shear_modulus * dt * m) / trial
    c_xx = m + keep * s_xx
    c_yy = m + keep * s_yy
    c_zz = m + keep * s_zz
    c_xy = keep * c_xy
    c_xz = keep * c_xz
    c_yz = keep * c_yz
    det = c_xx * (c_yy * c_zz - c_yz * c_yz) - c_xy * (c_xy * c_zz - c_yz * c_xz) + c_xz * (c_xy * c_yz - c_yy * c_xz)
    unit = 3.0 / (2.0 + max(det, 0.0))
    rest = 0.0
    if relaxation > 0.0:
        unit = exp(-relaxation * dt)
        rest = 1.0 - unit
        keep = keep * unit
    return c_xx * unit + rest, c_yy * unit + rest, c_zz * unit + rest, c_xy * unit, c_xz * unit, c_yz * unit, keep


def relieved(b_xx: float, b_yy: float, b_zz: float, b_xy: float, b_xz: float, b_yz: float, ratio: float):
    """b, det b = 1, whose deviator is `ratio` times that of the given one: (xx, yy, zz, xy, xz, yz).

    With ratio = G / G' the shear stress G dev(b) carries over when the modulus changes from G to G': bonds that form
    while a material cures form without stress (references.md, E, stiffening_under_load). The mean m of the new b solves
    det(m 1 + s) = m^3 - J2 m + det s = 1; Newton from 1.
    """
    mean = (b_xx + b_yy + b_zz) / 3.0
    s_xx = ratio * (b_xx - mean)
    s_yy = ratio * (b_yy - mean)
    s_zz = ratio * (b_zz - mean)
    s_xy = ratio * b_xy
    s_xz = ratio * b_xz
    s_yz = ratio * b_yz
    j2 = 0.5 * (s_xx * s_xx + s_yy * s_yy + s_zz * s_zz) + s_xy * s_xy + s_xz * s_xz + s_yz * s_yz
    det = s_xx * (s_yy * s_zz - s_yz * s_yz) - s_xy * (s_xy * s_zz - s_yz * s_xz) + s_xz * (s_xy * s_yz - s_yy * s_xz)
    m = 1.0
    for _ in range(6):
        m = m - (m * m * m - j2 * m + det - 1.0) / max(3.0 * m * m - j2, 0.1)
    return m + s_xx, m + s_yy, m + s_zz, s_xy, s_xz, s_yz
