"""Where rigid bodies that are carried along the path are, substep by substep, on the device."""

import warp as wp

from .clock import Hours
from .crew import Crew

wp.set_module_options({"enable_backward": False})


@wp.struct
class Pose:
    """Of the point that everything is carried by: where it was when the tick began, and how it moves."""

    start: wp.array(dtype=wp.vec3)  # [m]
    velocity: wp.array(dtype=wp.vec3)  # [m/s]
    elapsed: wp.array(dtype=float)  # since then [s]


@wp.func
def place_of(pose: Pose):
    """Where it is now [m]."""
    return pose.start[0] + pose.elapsed[0] * pose.velocity[0]


@wp.kernel
def begin(hours: Hours, pose: Pose):
    """A tick begins."""
    row = hours.row[0]
    pose.start[0] = hours.exit[row]
    pose.velocity[0] = hours.drift[row]
    pose.elapsed[0] = 0.0


@wp.kernel
def pass_time(dt: wp.array(dtype=float), pose: Pose):
    """A substep is over."""
    pose.elapsed[0] = pose.elapsed[0] + dt[0]


class Carriage:
    """Carries what is rigid along the path."""

    def __init__(self, crew: Crew, hours: Hours, dt: wp.array) -> None:
        self.crew, self.hours, self.dt = crew, hours, dt
        self.pose = Pose()
        with wp.ScopedDevice(crew.device):
            self.pose.start, self.pose.velocity = wp.zeros(1, dtype=wp.vec3), wp.zeros(1, dtype=wp.vec3)
            self.pose.elapsed = wp.zeros(1, dtype=float)

    def follow(self) -> None:
        """Enqueue: be where the clock says, moving to where it will be a tick later."""
        self.crew.launch(begin, 1, [self.hours, self.pose])

    def substep(self) -> None:
        """Enqueue: on by a substep; captured with the solver's own."""
        self.crew.launch(pass_time, 1, [self.dt, self.pose])
