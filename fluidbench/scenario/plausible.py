"""Whether a scenario's numbers are of a usual size: what is not may be in another unit."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .scenario import Scenario


def warnings(scenario: "Scenario") -> list[str]:
    """Values whose order of magnitude suggests a wrong unit, and what makes visible compression, a line each."""
    m, out = scenario.material, []
    plausible = (
        ("material.density", m.density, 10, 2e4, "kg/m^3"),
        ("material.youngs_modulus", m.youngs_modulus, 10, 1e12, "Pa"),
        ("material.viscosity", m.viscosity or None, 1e-6, 1e6, "Pa s"),
        ("material.yield_stress", m.yield_stress or None, 1e-2, 1e8, "Pa"),
        ("spacing", scenario.spacing, 1e-5, 0.2, "m"),
        ("nozzle.diameter", scenario.nozzle and scenario.nozzle.diameter, 1e-4, 0.5, "m"),
        ("nozzle speed", scenario.nozzle and scenario.nozzle.speed, 1e-5, 50, "m/s"),
        ("toolpath.speed", scenario.toolpath and (scenario.toolpath.speed or None), 1e-5, 50, "m/s"),
        ("gravity", float(np.linalg.norm(scenario.gravity)) or None, 0.1, 100, "m/s^2"),
    )
    for key, value, low, high, unit in plausible:
        if value is not None and not low <= value <= high:
            out.append(f"{key} = {value:g} {unit} is outside the usual {low:g} .. {high:g}; is it in {unit}?")
    if scenario.wave_speed < 3 * scenario.reference_speed:
        out.append(
            f"the material's wave speed ({scenario.wave_speed:.3g} m/s) is below 3 times the scenario's speed "
            f"({scenario.reference_speed:.3g} m/s): expect visible compression"
        )
    if m.bulk(scenario.liquid_sound_speed) < 10 * scenario.feeding_pressure:
        out.append(
            f"viscosity times speed over the nozzle's diameter ({scenario.feeding_pressure:.3g} Pa) is over a tenth of "
            f"the material's bulk modulus ({m.bulk(scenario.liquid_sound_speed):.3g} Pa): expect visible compression"
        )
    return out
