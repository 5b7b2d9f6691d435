"""Warp as a guest: what it says of itself belongs in no result."""


def quiet_warp() -> None:
    """Keep Warp from announcing itself, its modules and missing GPUs; `fluidbench doctor` tells of those."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
