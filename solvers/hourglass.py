"""Hourglass control of SPH and PBD: what pulls matter back to its neighbours' linear flow.

A velocity that alternates from particle to particle has no gradient at any of them, so no stress resists it (hourglass
modes). What particle i moves off its neighbours' linear field is, with a weight w of pairs,

    q_i = sum_j V_j w (v_i - v_j) - L_i sum_j V_j w r_ij    [1/(m s)],

zero in any linear flow; its integral z is a strain like the elastic tensor: it turns with the matter and is scaled back
with the deviator. The traction g = zeta G l^2 z [Pa m] pulls it back, with the transpose of q's own operator, so it
does exactly the work of q: between partners w (g_j - g_i), and a share - g x sum_j V_j w r_ij of the stress. Momentum
and angular momentum stay. After the penalty of Zhang et al. (2024) with their linear prediction, but one memory a
particle, and the transpose.

l = 1 / `opposing` makes the shortest wave of a lattice at zeta = 1 as stiff as stress between neighbours would, and at
zeta = pi^2 / 4 as fast as all others.
"""

import warp as wp

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.func
def off_linear(z: wp.vec3, gradient: wp.mat33, q: wp.vec3, kept: float, dt: float):
    """z [1/m] after a step dt [s] in which the share `kept` of the deviator was kept. It turns to second order: to
    first it would grow by (dt w)^2 / 2 a step."""
    spin = 0.5 * (gradient - wp.transpose(gradient))
    return kept * (z + dt * (spin * (z + (0.5 * dt) * (spin * z)) + q))
