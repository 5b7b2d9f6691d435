"""Where a method's passes run: in Warp, or in Taichi on the same memory.

A solver says which pass it wants and with what; kernel files of both languages export the same names with the same
arguments. Taichi is imported only where it is asked for.
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import warp as wp

from fluidbench.errors import UserError
from fluidbench.method.features import Feature
from fluidbench.native.crew import Crew
from fluidbench.native.scene import Scene

LACKING = {"taichi": frozenset({Feature.TIP})}  # what the passes of a language do not do


class Backend(Protocol):
    """Launches kernels; a kernel's arguments are the inputs, then the outputs."""

    name: str

    def launch(self, kernel: Any, size: int, inputs: Sequence[Any], outputs: Sequence[Any] = ()) -> None: ...

    def repeat(self, going: wp.array, body: Callable[[], None]) -> None:
        """Launch what `body` launches again and again, as long as going[0] is not 0, which it has to see to."""
        ...

    def prepare(self, solver: Any) -> None:
        """Compile all kernels of a solver (`solver.kernels`), and those of its viscous solve where it has one."""
        ...

    def wait(self) -> None:
        """Until everything launched on this memory is done, by whomever."""
        ...


class Warp:
    """Warp's launches, which a graph may capture, shared out by the scene's crew."""

    name = "warp"

    def __init__(self, crew: Crew) -> None:
        self.device, self.launch, self.load = crew.device, crew.launch, crew.load

    def repeat(self, going: wp.array, body: Callable[[], None]) -> None:
        wp.capture_while(going, body)  # inside a graph, too

    def prepare(self, solver: Any) -> None:
        parts = [part for part in (solver, solver.viscosity) if part is not None]
        for name in {kernel.module.name for part in parts for kernel in vars(part.kernels).values()}:
            self.load(name)

    def wait(self) -> None:
        wp.synchronize_device(self.device)


def backend_of(name: str, scene: Scene, threads: int) -> Backend:
    """The backend of this name on a scene's device; raises UserError where it is not installed."""
    if name == "warp":
        return Warp(scene.crew)
    try:
        from .taichi_bridge import Taichi
    except ImportError as error:
        raise UserError(
            f"the backend taichi cannot be loaded ({error}): pip install taichi (its wheels end at Python 3.13)"
        ) from None
    return Taichi(scene.device, threads)
