"""What a scenario is refused for, just beyond each limit, and what it is warned about."""

import math

import numpy as np
import pytest

from fluidbench.errors import UserError
from fluidbench.scenario.extent import ADDRESSABLE, MOST_OUTPUTS, MOST_TICKS, RESOLVED

from ..conftest import bead, scenario

BOX = {"kind": "box", "center": [0.1, 0.1, 0.1], "size": [0.04, 0.06, 0.08]}

BOX = {"kind": "box", "center": [0.1, 0.1, 0.1], "size": [0.04, 0.06, 0.08]}


def boxed(**more):
    """A box of half diagonal sqrt(0.02^2 + 0.03^2 + 0.04^2) without gravity."""
    return scenario(**{"bodies": [BOX], "gravity": [0, 0, 0], **more})


def refused(words, make=scenario, **table):
    with pytest.raises(UserError, match=words):
        make(**table)


def test_names_and_titles():
    for name in ("a", "x" * 80, "ä b.c-1"):
        assert scenario(name=name).name == name
    for name in (
        "",
        "x" * 81,
        "a/b",
        "a\\b",
        "a:b",
        "a*",
        "a?",
        'a"',
        "a<",
        "a>",
        "a|b",
        " a",
        "a ",
        ".a",
        "a.",
        "a\nb",
    ):
        refused("names a folder", name=name)
    assert scenario(title="x" * 300).title == "x" * 300
    for title in ("x" * 301, "two\nlines"):
        refused("is one line of at most 300", title=title)


def test_something_to_simulate():
    refused("nothing to simulate", bodies=[])
    nozzle, path = bead().nozzle.model_dump(exclude_none=True), bead().toolpath.model_dump(exclude_none=True)
    refused("belong together", nozzle=nozzle)
    refused("belong together", toolpath=path)
    both = bead(bodies=[{"kind": "box", "center": [0, 0, 0.005], "size": [0.01] * 3}])
    assert both.nozzle and both.bodies


def test_pools_and_bodies_are_addressable():
    """A cube of n spacings counts (n + 1)^3; eight times what can be addressed may turn out less, when laid out."""
    assert scenario(pool=ADDRESSABLE).pool == ADDRESSABLE == 2**26
    refused("pool = 6.71089e.07: .*can be addressed", pool=ADDRESSABLE + 1)
    edge = (8 * ADDRESSABLE) ** (1 / 3)  # 812.7
    room = {"domain": {"lower": [0, 0, 0], "upper": [2000.0] * 3}, "spacing": 1.0, "duration": 1.0, "tick": 1.0}

    def cube(n, **more):
        return scenario(bodies=[{"kind": "box", "center": [1000.0] * 3, "size": [float(n)] * 3}], **room, **more)

    cube(math.floor(edge) - 1)
    refused("bodies and nozzle would be", cube, n=math.ceil(edge))
    foam = {"density": 1.0, "expansion": {"ratio": 2.0}}
    cube(math.floor(edge / 4 ** (1 / 3)) - 1, material=foam)  # offspring: twice the ratio
    refused("bodies and nozzle would be", cube, n=math.ceil(edge / 4 ** (1 / 3)), material=foam)


def test_a_stream_counts_what_the_nozzle_gives_and_holds():
    """Q T / d^3 and (D / d + 5)^2 in it: of 537 million, with d = 1 and 100 spacings across."""
    most, inside = 8 * ADDRESSABLE, 105**2
    table = {
        "domain": {"lower": [-200.0] * 3, "upper": [200.0] * 3},
        "spacing": 1.0,
        "tick": 1.0,
        "gravity": [0, 0, 0],
        "toolpath": {"kind": "line", "start": [0, 0], "speed": 0.0, "dwell": 1.0},
        "output_interval": 1.0,
    }

    def stream(duration):
        return bead(nozzle={"diameter": 100.0, "flow_rate": 1.0e6, "standoff": 1.0}, duration=duration, **table)

    stream((most - inside) / 1e6 - 1e-4)
    refused("bodies and nozzle would be", stream, duration=(most - inside) / 1e6 + 1e-4)


def test_positions_are_resolved_in_single_precision():
    """At 2^18 spacings from the origin a float32 steps by a 32nd or 64th of one."""
    assert RESOLVED == 2**18 and np.spacing(np.float32(2.0**18 * 0.99)) == 2.0**-6
    body = {"kind": "box", "center": [4.0, 4.0, 4.0], "size": [4.0] * 3}

    def far(low=0.0, high=8.0):
        return scenario(
            domain={"lower": [0, low, 0], "upper": [8.0, high, 8.0]}, bodies=[body], spacing=1.0, duration=1.0
        )

    far(high=float(RESOLVED)), far(low=-float(RESOLVED))
    refused("domain: it reaches to 262145 m", far, high=RESOLVED + 1.0)
    refused("domain: it reaches to 262145 m", far, low=-RESOLVED - 1.0)
    refused("poisson_ratio = 1e-39 is beyond", material={"density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 1e-39})
    for ratio in (-1e-30, 0.0):
        scenario(material={"density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": ratio})


def test_ticks_and_outputs_come_to_an_end():
    assert (MOST_TICKS, MOST_OUTPUTS) == (10**8, 10**6)
    scenario(duration=1.0, output_interval=1.0001e-6)
    refused("makes 1e.06 outputs", duration=1.0, output_interval=0.9999e-6)
    scenario(duration=1.0, tick=1.0001e-8)
    refused("tick = 9.999e-09 s makes 1e.08 ticks", duration=1.0, tick=0.9999e-8)
    quick = {**BOX, "velocity": [2.5e4, 0, 0]}  # a quarter of 10 mm in 1e-7 s
    boxed(bodies=[quick], duration=9.99)
    refused("spacing = 0.01 m, 2.5e.04 m/s makes", boxed, bodies=[quick], duration=10.01)


def test_two_particles_fit_across_the_nozzle_and_it_stays_inside():
    bead(spacing=0.006, duration=0.2)
    refused("too coarse for nozzle.diameter", bead, spacing=0.00601)
    room = [[-0.006, -0.006, 0.0], [0.036, 0.006, 0.010]]
    bead(domain={"lower": room[0], "upper": room[1]})
    for end, sign in ((0, 1), (1, -1)):
        for axis in range(3):
            if (end, axis) == (0, 2):
                continue
            small = [list(corner) for corner in room]
            small[end][axis] += sign * 1e-4
            what = r"nozzle \(standoff and layers\)" if axis == 2 else r"toolpath \(with the nozzle's radius\)"
            refused(f"the {what} spans {'xyz'[axis]} = ", bead, domain={"lower": small[0], "upper": small[1]})


def test_bodies_lie_inside_and_are_a_spacing_thick():
    at = {"kind": "box", "size": [0.02] * 3}
    for axis in range(3):
        for inside, outside in ((-0.0099, -0.0101), (0.2099, 0.2101)):
            center = [0.1] * 3
            center[axis] = inside
            scenario(bodies=[{**at, "center": center}])
            center[axis] = outside
            refused(r"bodies\.0 lies outside the domain", bodies=[{**at, "center": center}])
    scenario(bodies=[{"kind": "box", "center": [0.1] * 3, "size": [0.1, 0.1, 0.0101]}])
    refused("thinner than one particle", bodies=[{"kind": "box", "center": [0.1] * 3, "size": [0.1, 0.0099, 0.1]}])
    late = {"kind": "box", "center": [0.1] * 3, "size": [0.04] * 3}
    scenario(bodies=[{**late, "start": 0.7499}], duration=1.0, tick=0.25, output_interval=0.5)
    refused(
        "not before the last tick", bodies=[{**late, "start": 0.7501}], duration=1.0, tick=0.25, output_interval=0.5
    )


def test_a_periodic_axis_needs_six_spacings():
    walls = {"y_lower": "periodic", "y_upper": "periodic"}
    body = {"kind": "box", "center": [0.1, 0.03, 0.1], "size": [0.04] * 3}
    scenario(bodies=[body], domain={"lower": [0, 0, 0], "upper": [0.2, 0.0601, 0.2], "walls": walls})
    refused("y has 5.99", bodies=[body], domain={"lower": [0, 0, 0], "upper": [0.2, 0.0599, 0.2], "walls": walls})
    scenario(bodies=[body], domain={"lower": [0, 0, 0], "upper": [0.2, 0.0599, 0.2]})


USUAL = [
    ("material.density", {"density": 1.0}, "density", 10, 2e4),
    ("material.youngs_modulus", {"density": 1000.0}, "youngs_modulus", 10, 1e12),
    ("material.viscosity", {"density": 1000.0}, "viscosity", 1e-6, 1e6),
    ("material.yield_stress", {"density": 1000.0, "youngs_modulus": 1e6}, "yield_stress", 1e-2, 1e8),
]


@pytest.mark.parametrize(("name", "table", "key", "low", "high"), USUAL, ids=[row[0] for row in USUAL])
def test_unusual_material_is_warned_about(name, table, key, low, high):
    def warned(value):
        # warnings ask the material alone; check_numerics may refuse what SPH or MPM cannot run
        return [w for w in scenario(material={**table, key: value}).warnings() if w.startswith(f"{name} =")]

    for value in (low, high):
        assert not warned(value)
    for value in (0.99 * low, 1.01 * high):
        (words,) = warned(value)
        assert f"outside the usual {low:g} .. {high:g}" in words
    if key in ("viscosity", "yield_stress"):
        assert not warned(0.0)


def test_unusual_sizes_and_speeds_are_warned_about():
    def warned(made):
        return {w.partition(" = ")[0] for w in made.warnings()}

    def sized(factor):
        """A bead 0.1 mm to 0.5 m wide, and so on: the same scenario in other units."""
        s = bead()
        return s.model_copy(
            update={
                "spacing": s.spacing * factor,
                "nozzle": s.nozzle.model_copy(update={"diameter": s.nozzle.diameter * factor}),
            }
        )

    assert "spacing" not in warned(sized(5e-3)) and "spacing" in warned(sized(4.9e-3))
    assert "spacing" not in warned(sized(100.0)) and "spacing" in warned(sized(101.0))
    assert "nozzle.diameter" in warned(sized(0.0083)) and "nozzle.diameter" not in warned(sized(0.0084))
    assert "nozzle.diameter" in warned(sized(42.0)) and "nozzle.diameter" not in warned(sized(41.0))

    def paced(exit_speed=0.1, speed=0.1, gravity=-9.81):
        s = bead()
        return warned(
            s.model_copy(
                update={
                    "nozzle": s.nozzle.model_copy(update={"exit_speed": exit_speed}),
                    "gravity": (0.0, 0.0, gravity),
                    "toolpath": s.toolpath.model_copy(update={"speed": speed}),
                }
            )
        )

    for key in ("exit_speed", "speed"):
        name = {"exit_speed": "nozzle speed", "speed": "toolpath.speed"}[key]
        assert [name in paced(**{key: v}) for v in (0.99e-5, 1.01e-5, 50.0, 50.5)] == [True, False, False, True]
    assert ["gravity" in paced(gravity=-g) for g in (0.0, 0.099, 0.101, 99.0, 101.0)] == [
        False,
        True,
        False,
        False,
        True,
    ]


def test_a_sound_below_three_times_the_speed_is_warned_about():
    def warned(ratio):
        return [
            w
            for w in boxed(bodies=[{**BOX, "velocity": [1.0, 0, 0]}], sound_speed_ratio=ratio).warnings()
            if "wave" in w
        ]

    assert not warned(3.001) and len(warned(2.999)) == 1
