"""Warp as a guest: what it says of itself belongs in no result."""


def quiet_warp() -> None:
    """Keep Warp from announcing itself, its modules and missing GPUs; `fluidbench doctor` tells of those."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR


class CountedLaunches:
    """Counts kernel launches while it is entered; adds up over several entries."""

    def __init__(self) -> None:
        self.count = 0

    def __enter__(self) -> "CountedLaunches":
        import warp as wp

        self._launch = wp.launch

        def launch(*args, **kwargs):
            self.count += 1
            return self._launch(*args, **kwargs)

        wp.launch = launch
        return self

    def __exit__(self, *_: object) -> None:
        import warp as wp

        wp.launch = self._launch
