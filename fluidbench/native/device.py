"""Warp as a guest: what it says of itself belongs in no result."""

from typing import ClassVar


def quiet_warp() -> None:
    """Keep Warp from announcing itself, its modules and missing GPUs; `fluidbench doctor` tells of those."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR


def note_launch() -> None:
    """Count a launch that is not Warp's."""
    for counter in CountedLaunches.entered:
        counter.count += 1


class CountedLaunches:
    """Counts kernel launches while it is entered; adds up over several entries."""

    entered: ClassVar[list["CountedLaunches"]] = []

    def __init__(self) -> None:
        self.count = 0

    def __enter__(self) -> "CountedLaunches":
        import warp as wp

        self._launch = wp.launch

        def launch(*args, **kwargs):
            self.count += 1
            return self._launch(*args, **kwargs)

        wp.launch = launch
        self.entered.append(self)
        return self

    def __exit__(self, *_: object) -> None:
        import warp as wp

        wp.launch = self._launch
        self.entered.remove(self)
