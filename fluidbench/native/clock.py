"""What the time is, on the device: where the nozzle is and what it has fed, tick by tick.

The host writes the rows of many ticks ahead; kernels read the present one. So a tick is the same launches every time,
which a graph can hold, and the host need not wait for the device, nor the device for the host.
"""

from functools import cached_property

import numpy as np
import warp as wp

from ..scenario import Scenario
from ..scenario.stream import Stream
from .crew import Crew

wp.set_module_options({"enable_backward": False})
ROWS = 1024  # ticks that are written ahead


@wp.struct
class Hours:
    """Rows of ticks; `row` is the present one, the next one says where things will be at its end."""

    row: wp.array(dtype=int)
    time: wp.array(dtype=float)  # [s]
    exit: wp.array(dtype=wp.vec3)  # where matter is let go [m]
    drift: wp.array(dtype=wp.vec3)  # its mean velocity until the next row [m/s]
    extruded: wp.array(dtype=float)  # time spent extruding [s]
    feeding: wp.array(dtype=float)  # share of the time until the next row in which it extrudes [-]
    entered: wp.array(dtype=int)  # particles of the stream in the nozzle or beyond
    tick: float  # from row to row [s]


@wp.kernel
def on(hours: Hours):
    """On to the next row."""
    hours.row[0] = hours.row[0] + 1


class Clock:
    """The rows of a scenario on a device."""

    def __init__(self, scenario: Scenario, crew: Crew) -> None:
        self.scenario, self.crew = scenario, crew
        self.first, self.tick = -1, scenario.schedule[0]  # tick number of the first row, its length [s]
        self._row = 0  # of the device, once all that was enqueued is done
        self._entered = self._released = np.zeros(1, int)  # particles, rows
        hours = self.hours = Hours()
        hours.tick = self.tick
        with wp.ScopedDevice(crew.device):
            hours.row = wp.zeros(1, dtype=int)
            hours.time, hours.extruded = wp.zeros(ROWS + 1, dtype=float), wp.zeros(ROWS + 1, dtype=float)
            hours.exit, hours.drift = wp.zeros(ROWS + 1, dtype=wp.vec3), wp.zeros(ROWS + 1, dtype=wp.vec3)
            hours.entered, hours.feeding = wp.zeros(ROWS + 1, dtype=int), wp.zeros(ROWS + 1, dtype=float)

    @cached_property
    def stream(self) -> Stream | None:
        return Stream(self.scenario) if self.scenario.nozzle is not None else None

    @property
    def bore(self) -> tuple[float, float]:
        """Radius of what feeds the stream, and how far it reaches down from where matter is let go [m]; nothing without
        a stream."""
        if self.stream is None:
            return 0.0, 0.0
        return 0.5 * self.stream.nozzle.diameter, self.stream.nozzle.rise

    @property
    def mean_speed(self) -> float:
        """Of the stream, while it extrudes [m/s]."""
        assert self.stream is not None
        return self.stream.nozzle.speed

    def speed_at(self, radius: np.ndarray) -> np.ndarray:
        """Of the stream at radii [m] from its axis, while it extrudes [m/s]."""
        assert self.stream is not None
        return self.stream.nozzle.speed * self.stream.pace_at(radius)

    @property
    def last_birth(self) -> float:
        """Later than anything is born [s]."""
        births = [] if self.stream is None else self.stream.birth_time
        return 2.0 * max(self.scenario.duration, float(np.max(births, initial=0.0)))

    def show(self, ticks: int) -> None:
        """Make the row after so many ticks the present one."""
        if self.first < 0 or not self.first <= ticks < self.first + ROWS:
            self.first, self.hours.tick = ticks, self.tick
            self._write(self.tick * np.arange(ticks, ticks + ROWS + 1, dtype=float))
        self._turn_to(ticks - self.first)

    def set(self, now: float, tick: float) -> None:
        """The same for a time [s] that need not be a whole number of ticks [s]."""
        self.first, self.hours.tick = -1, tick
        self._write(np.array([now, now + tick]))
        self._turn_to(0)

    @property
    def entered(self) -> int:
        """Particles of the stream that are in the nozzle now, or beyond."""
        return int(self._entered[self._row])

    @property
    def released(self) -> int:
        """Rows of the stream that were let go."""
        return int(self._released[self._row])

    def strike(self) -> None:
        """Enqueue: on to the next row."""
        self.crew.launch(on, 1, [self.hours])

    def struck(self) -> None:
        """A recorded `strike` was replayed."""
        self._row += 1

    def _turn_to(self, row: int) -> None:
        if row != self._row:
            self.hours.row.fill_(row)
            self._row = row

    def _write(self, times: np.ndarray) -> None:
        track = self.scenario.track
        columns = {"time": times}
        if track is not None and self.stream is not None:
            exits = self.stream.outlet(times)
            extruded, step = track.extruded(times), np.diff(times)
            columns |= {
                "exit": exits,
                "drift": np.diff(exits, axis=0, append=exits[-1:]),
                "extruded": extruded,
                "feeding": np.diff(extruded, append=extruded[-1:]),
            }
            columns["drift"][:-1] /= step[:, None]
            columns["feeding"][:-1] /= step
            columns["entered"] = self._entered = self.stream.entered(times) * self.stream.points
            self._released = self.stream.released(times)
        for name, values in columns.items():
            array: wp.array = getattr(self.hours, name)
            kind = np.int32 if array.dtype is wp.int32 else np.float32
            n = len(values)
            wp.copy(array, wp.array(np.asarray(values, kind), dtype=array.dtype, device="cpu"), 0, 0, n)
