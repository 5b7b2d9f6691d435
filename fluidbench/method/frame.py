"""What a moment of a run looks like to whoever measures it.

A frame maps names to NumPy arrays, particles in order of creation:

    time        ()      [s]
    position    (n, 3)  [m]
    velocity    (n, 3)  [m/s]
    mass        (n,)    [kg]
    volume      (n,)    rest volume, mass over rest density [m^3]
    density     (n,)    present density [kg/m^3]
    pressure    (n,)    [Pa]; absent where the method has none
    spin        (n, 3)  angular momentum about a particle's own centre [kg m^2/s]
    stress      (n,)    elastic shear stress sqrt(J2) [Pa]; absent where the method has none
    phase       (n,)    level of cure
    held        (n,)    FREE, CARRIED or CLAMPED
    birth_time  (n,)    when it left the nozzle, 0 for a body [s]
    origin      (n,)    number in the order of creation: the particle's identity
"""

from typing import TypeAlias

import numpy as np

Frame: TypeAlias = dict[str, np.ndarray]
FREE, CARRIED, CLAMPED = 0, 1, 2  # moves; is carried along by the feed, without strain; keeps its velocity
