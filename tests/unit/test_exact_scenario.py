"""Speeds, schedule, walls and limits of a scenario by hand; what is refused just beyond each limit."""

import math

import numpy as np
import pytest

from fluidbench.native.scene import Scene
from fluidbench.scenario import Domain, Nozzle, Walls

from ..conftest import G, bead, scenario

BOX = {"kind": "box", "center": [0.1, 0.1, 0.1], "size": [0.04, 0.06, 0.08]}


def boxed(**more):
    """A box of half diagonal sqrt(0.02^2 + 0.03^2 + 0.04^2) without gravity."""
    return scenario(**{"bodies": [BOX], "gravity": [0, 0, 0], **more})


HALF = math.sqrt(0.02**2 + 0.03**2 + 0.04**2)


def test_the_reference_speed_is_the_fastest_that_the_scenario_implies():
    assert boxed().reference_speed == 1e-3
    assert boxed(bodies=[{**BOX, "velocity": [3.0, 4.0, 0.0]}]).reference_speed == pytest.approx(5.0)
    assert boxed(gravity=[0, 0, -2.0]).reference_speed == pytest.approx(math.sqrt(2.0 * 0.14))
    assert boxed(gravity=[3.0, 0, 0], body_force=[0, 4.0, 0]).reference_speed == pytest.approx(math.sqrt(5.0 * 0.14))
    deep = {"lower": [0, 0, -1.0], "upper": [0.2] * 3}
    assert boxed(gravity=[0, 0, -2.0], domain=deep).reference_speed == pytest.approx(math.sqrt(2.0 * 1.14))
    pull = [[-9.0, 0, 0], [0, 4.0, 0], [0, 0, 1.0]]
    assert boxed(body_force_gradient=pull).reference_speed == pytest.approx(3.0 * HALF)
    two = [{**BOX, "center": [0.1, 0.1, 0.15]}, BOX]
    assert boxed(bodies=two, gravity=[0, 0, -2.0]).reference_speed == pytest.approx(math.sqrt(2.0 * 0.19))


def test_the_reference_speed_of_a_print_and_of_foam():
    assert bead(gravity=[0, 0, 0]).reference_speed == pytest.approx(math.hypot(0.1, 0.1))
    path = {"kind": "line", "start": [0, 0], "end": [0.03, 0], "speed": 0.1, "layers": 2, "layer_height": 0.005}
    tall = bead(
        toolpath=path,
        gravity=[0, 0, -20.0],
        domain={"lower": [-0.02, -0.02, -0.1], "upper": [0.05, 0.02, 0.025]},
        nozzle={"diameter": 0.012, "exit_speed": 0.1, "standoff": 0.110},
    )
    assert tall.reference_speed == pytest.approx(math.sqrt(20.0 * 0.110))  # a paste stands: only the gap is fallen
    assert tall.falling_speed() == pytest.approx(math.sqrt(20.0 * 0.115))  # what falls off a tower may be that fast
    runny = tall.replace(material={"density": 1000.0, "viscosity": 1.0})
    assert runny.reference_speed == pytest.approx(math.sqrt(20.0 * 0.115))  # from the highest nozzle to the floor
    foam = {"density": 1.0, "expansion": {"ratio": 61.0, "time": 0.5}}
    assert boxed(material=foam).reference_speed == pytest.approx(HALF * 60 / 1.5)
    rise = bead(
        gravity=[0, 0, 0], material={"density": 1000.0, "expansion": {"ratio": 301.0, "time": 0.5}}, duration=0.001
    )
    assert rise.reference_speed == pytest.approx(0.006 * 300 / 1.5)


def test_speeds_of_sound():
    still = boxed(sound_speed_ratio=20.0)
    assert still.liquid_sound_speed == pytest.approx(0.02) == pytest.approx(still.wave_speed) == still.top_wave_speed
    solid = boxed(
        material={
            "density": 4.0,
            "youngs_modulus": 6.0,
            "poisson_ratio": 0.25,
            "cure": {"youngs_modulus": 54.0, "time": 0.005, "kind": "linear"},
        }
    )
    k, shear = 6.0 / 1.5, 6.0 / 2.5
    assert solid.wave_speed == pytest.approx(math.sqrt((k + 4 * shear / 3) / 4.0))
    assert solid.top_wave_speed == pytest.approx(3.0 * solid.wave_speed)
    ages, materials = solid.aged
    assert len(ages) == len(materials) == 65 and (ages[0], ages[-1]) == (0.0, 0.01)
    assert materials[16].youngs_modulus == pytest.approx(6.0 + 48.0 * 0.5) and boxed().aged[1] == [boxed().material]
    made = solid.made_of(materials[-1])
    assert made.material is materials[-1] and made.wave_speed == pytest.approx(3.0 * solid.wave_speed)
    assert bead().made_of(bead().material).track is not None


def test_peak_acceleration_is_where_material_starts():
    assert boxed().peak_acceleration == 0.0
    assert scenario(body_force=[3.0, 0, 0]).peak_acceleration == pytest.approx(math.hypot(G, 3.0))
    pull = [[-10.0, 0, 0], [0, 0, 0], [0, 0, 20.0]]
    far = boxed(body_force_gradient=pull, body_force_center=[0.05, 0.1, 0.1])
    assert far.peak_acceleration == pytest.approx(math.hypot(10 * 0.07, 20 * 0.04))  # the corner at x = 0.12, z = 0.14
    laid = bead(gravity=[0, 0, 0], body_force_gradient=[[-10.0, 0, 0], [0, 0, 0], [0, 0, 0]])
    assert laid.peak_acceleration == pytest.approx(0.3)  # the end of the path, at x = 30 mm


def test_the_potential_by_hand():
    """x g + (x - c) D (x - c) / 2 with g = (1, 0, -10), D = diag(2, 4, 0), c = (1, 0, 0) at (2, 3, 5)."""
    s = boxed(
        gravity=[0, 0, -10.0],
        body_force=[1.0, 0, 0],
        body_force_gradient=[[2.0, 0, 0], [0, 4.0, 0], [0, 0, 0]],
        body_force_center=[1.0, 0, 0],
    )
    assert s.potential_at(np.array([[2.0, 3.0, 5.0]])).tolist() == pytest.approx([2.0 - 50.0 + 0.5 * (2.0 + 36.0)])
    assert s.acceleration.tolist() == [1.0, 0.0, -10.0]


@pytest.mark.parametrize(
    ("table", "schedule"),
    [
        ({"duration": 2.0, "tick": 0.5, "output_interval": 1.0}, (0.5, 4, 2)),
        ({"duration": 2.0, "tick": 0.4, "output_interval": 1.0}, (1 / 3, 6, 3)),
        ({"duration": 2.0, "tick": 0.1}, (0.1, 20, 1)),  # an output every twentieth
        ({"duration": 2.0, "tick": 5.0, "output_interval": 9.0}, (2.0, 1, 1)),
        ({"duration": 2.0, "tick": 0.5, "output_interval": 0.25}, (0.25, 8, 1)),
        ({"duration": 0.3, "tick": 0.1, "output_interval": 0.3}, (0.1, 3, 3)),  # 0.3 / 0.1 is a little below 3
        ({"duration": 0.6, "tick": 0.2, "output_interval": 0.6}, (0.2, 3, 3)),  # and 0.6 / 0.2 is a little below, too
        ({"duration": 2.6, "tick": 1.0, "output_interval": 1.0}, (1.0, 3, 1)),
        ({"duration": 2.4, "tick": 1.0, "output_interval": 1.0}, (1.0, 2, 1)),
        ({"duration": 2.0, "output_interval": 2.0}, (1.0, 2, 2)),  # a quarter of 10 mm at 2.5 mm/s
    ],
)
def test_ticks_divide_the_outputs(table, schedule):
    made = boxed(bodies=[{**BOX, "velocity": [2.5e-3, 0, 0]}], **table).schedule
    assert made == (pytest.approx(schedule[0]), *schedule[1:])


def test_rounding_makes_no_tick():
    assert 2.1 / 0.7 > 3.0 and boxed(duration=2.1, tick=0.7, output_interval=2.1).schedule == (
        pytest.approx(0.7),
        3,
        3,
    )


def test_walls_are_six_in_order_and_periodic_in_pairs():
    walls = Walls(x_lower="stick", z_lower={"friction": 0.5}, y_lower="periodic", y_upper="periodic")
    assert [w if isinstance(w, str) else w.friction for w in walls.faces()] == [
        "stick",
        "slip",
        "periodic",
        "periodic",
        0.5,
        "slip",
    ]
    assert walls.periodic() == (False, True, False)
    for axis in "xyz":
        own = {f"{axis}_lower": "periodic", f"{axis}_upper": "periodic"}
        assert Walls(**own).periodic() == tuple(a == axis for a in "xyz")
        for face in own:
            with pytest.raises(ValueError, match=f"{axis}_lower and {axis}_upper must both be periodic"):
                Walls(**{face: "periodic"})


def test_a_domain_contains_its_faces():
    box = Domain(lower=(0, 0, 0), upper=(1, 2, 3))
    points = [(0, 0, 0), (1, 2, 3), (1 + 1e-8, 1, 1), (0.5, -1e-8, 1), (0.5, 0.5, 3.0 + 1e-10), (0.5, 2.5, 1)]
    assert box.contains(points).tolist() == [True, True, False, False, True, False]
    assert box.contains(points, 0.1).tolist() == [True, True, True, True, True, False]
    for axis in range(3):
        with pytest.raises(ValueError, match=f"upper must exceed lower on the {'xyz'[axis]} axis"):
            Domain(lower=(0, 0, 0), upper=tuple(0.0 if i == axis else 1.0 for i in range(3)))


def test_a_nozzle_has_a_speed_or_a_rate():
    area = math.pi * 0.01**2 / 4
    by_speed, by_rate = (
        Nozzle(diameter=0.01, exit_speed=2.0, standoff=1.0),
        Nozzle(diameter=0.01, flow_rate=3.0, standoff=1.0),
    )
    assert (by_speed.area, by_speed.speed, by_speed.rate) == pytest.approx((area, 2.0, 2.0 * area))
    assert (by_rate.speed, by_rate.rate) == pytest.approx((3.0 / area, 3.0))
    for more in ({}, {"exit_speed": 1.0, "flow_rate": 1.0}):
        with pytest.raises(ValueError, match="exactly one of exit_speed and flow_rate"):
            Nozzle(diameter=0.01, standoff=1.0, **more)


def test_a_liquid_is_as_stiff_as_what_pushes_it():
    """12 mm at 0.1 m/s down and 0.1 along, 300 Pa s: 300 sqrt(0.02) / 0.012 = 3536 Pa, c = 10 sqrt(3536 / 1400) m/s;
    it carries that much tension. Thin ones are as stiff as gravity asks, and cavitate at as little as they are thin."""
    thick, thin = (bead(material={"density": 1400.0, "viscosity": eta}) for eta in (300.0, 1.0))
    pressure = 300.0 * math.sqrt(0.02) / 0.012
    assert thick.feeding_pressure == pytest.approx(pressure)
    assert thick.liquid_sound_speed == pytest.approx(10.0 * math.sqrt(pressure / 1400.0)) == thick.wave_speed
    assert thin.liquid_sound_speed == pytest.approx(10.0 * thin.reference_speed)
    assert Scene(thick).phases.numpy()["tension_limit"] == pytest.approx(pressure)
    told = bead(material={"density": 1400.0, "viscosity": 300.0, "tension_limit": 7.0})
    assert Scene(told).phases.numpy()["tension_limit"] == 7.0
    hardened = thick.made_of(thick.material.model_copy(update={"viscosity": 1e6}))
    assert hardened.feeding_pressure == thick.feeding_pressure and hardened.wave_speed == thick.wave_speed
    soft = bead(material={"density": 1400.0, "viscosity": 300.0, "bulk_modulus": 3e4})
    assert any("expect visible compression" in w for w in soft.warnings()) and not thick.warnings()


@pytest.mark.parametrize(("viscosity", "tension"), [(0.0, 0.0), (1.0, 1.0 * 1.0 / 0.5), (1e6, 1000.0 * 1.0)])
def test_a_liquid_carries_the_tension_of_its_own_viscosity(viscosity, tension):
    """A block 0.5 m across and 1 m high that falls at sqrt(g H) = 1 m/s: eta U / L, and no more than rho U^2."""
    block = {"kind": "box", "center": [1.0, 1.0, 0.5], "size": [0.5, 1.0, 1.0]}
    domain = {"lower": [0, 0, 0], "upper": [2, 2, 2]}
    table = {"domain": domain, "bodies": [block], "gravity": [0, 0, -1.0], "spacing": 0.1}
    s = scenario(**table, material={"density": 1000.0, "viscosity": viscosity})
    assert s.reference_speed == pytest.approx(1.0) and s.feeding_pressure == 0.0
    assert s.viscous_tension == pytest.approx(tension)
    assert Scene(s).phases.numpy()["tension_limit"] == pytest.approx(tension)
