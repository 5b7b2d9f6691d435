"""Pictures of a finished run in three dimensions, by PyVista (the extra `viz`): a still, a turntable, a film over its
snapshots, and a time series for ParaView."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError, quoted, suggestion
from ..files import write_atomically
from ..method.frame import CARRIED
from ..runs.record import FINAL_FRAME, Run, recall
from ..runs.store import RECORD
from ..scenario import Scenario

COLOURS = {
    "layer": "",
    "phase": "level of cure",
    "speed": "speed [m/s]",
    "stress": "elastic shear stress [Pa]",
    "density": "density [kg/m^3]",
    "height": "height [mm]",
}
"""What particles may be coloured by, and what their scale is called."""
WINDOW, TURNS, FPS = (1280, 960), 90, 20
PICTURES = 20_000  # of a film: a quarter of an hour
RULERS = (1.0, 2.0, 5.0)  # times a power of ten: lengths that a scale bar may have
BAR = {
    "color": "black",
    "n_labels": 3,
    "fmt": "%.3g",
    "title_font_size": 22,
    "label_font_size": 18,
    "position_x": 0.3,
    "width": 0.4,
    "height": 0.09,
}
LAYERS = ("#3473b7", "#f29e40")  # alternating, as in the paper's pictures


def load(folder: Path) -> tuple[Scenario, list[dict[str, np.ndarray]]]:
    """Scenario and snapshots of a run's folder: those kept on the way (`--frames`), or the last one alone.

    Raises UserError where there is no finished run.
    """
    shown = quoted(str(folder))[1:-1]
    try:
        there = (folder / RECORD).exists()
    except (OSError, ValueError) as error:
        raise UserError(f"{shown}: no run here ({getattr(error, 'strerror', None) or error})") from None
    if not there:
        raise UserError(f"{shown}: no run here (no {RECORD}); give a folder such as fluidbench-out/NAME/runs/...")
    record, why = recall(folder)
    if record is None:
        raise UserError(f"{shown}: {why}; the same command that made the run makes it again")
    if record.input is None or FINAL_FRAME not in record.files:
        raise UserError(f"{shown}: the run has no particles to show ({record.verdict}: {record.reason})")
    run = Run(record, folder)
    frames = []
    for frame in run.frames or [run.frame()]:
        free = frame["held"] != CARRIED
        frames.append({key: value if value.ndim == 0 else value[free] for key, value in frame.items()})
    return run.scenario, frames


def values_of(frame: dict[str, np.ndarray], scenario: Scenario, colour: str) -> np.ndarray:
    """What a particle is coloured by, shape (n,), in the unit that COLOURS names."""
    if colour not in COLOURS:
        raise UserError(
            f"no colour {quoted(colour)}{suggestion(colour, list(COLOURS))}; there are {', '.join(COLOURS)}"
        )
    if colour == "speed":
        return np.linalg.norm(frame["velocity"], axis=1)
    if colour == "height":
        return 1e3 * frame["position"][:, 2]
    if colour == "layer":
        track = scenario.track
        births = frame["birth_time"].astype(float)
        return np.zeros(len(births)) if track is None else track.layer_at(births - 1e-9) % 2.0
    if colour not in frame:
        raise UserError(f"this run has no {colour} by particle: its material or its method has none")
    return frame[colour].astype(float)


def _pyvista() -> Any:
    try:
        import pyvista
    except ImportError:
        raise UserError("rendering needs PyVista: pip install 'fluidbench[viz]'") from None
    return pyvista


def _cloud(pv: Any, frame: dict[str, np.ndarray], scenario: Scenario, colour: str) -> Any:
    """Particles as spheres of their volume."""
    points = pv.PolyData(frame["position"].astype(np.float32))
    points["value"] = values_of(frame, scenario, colour)
    points["diameter"] = 1.1 * np.cbrt(frame["volume"])
    ball = pv.Sphere(radius=0.5, theta_resolution=8, phi_resolution=8)
    return points.glyph(geom=ball, scale="diameter", orient=False)


class Stage:
    """A plotter with floor, light and camera set for a scenario; off screen."""

    def __init__(self, scenario: Scenario, frames: Iterable[dict[str, np.ndarray]], colour: str) -> None:
        self.pv, self.scenario, self.colour = _pyvista(), scenario, colour
        self.plotter = self.pv.Plotter(off_screen=True, window_size=WINDOW)
        filled = [frame["position"] for frame in frames if len(frame["position"])]
        if not filled:
            raise UserError("the run holds no particles outside the nozzle yet")
        low, high = np.min([p.min(axis=0) for p in filled], axis=0), np.max([p.max(axis=0) for p in filled], axis=0)
        self.center, self.size = 0.5 * (low + high), float(np.linalg.norm(high - low))
        values = np.concatenate([values_of(frame, scenario, colour) for frame in frames if len(frame["position"])])
        self.limits = (0.0, 1.0) if colour == "layer" else (float(values.min()), float(values.max()) + 1e-12)
        floor = (self.center[0], self.center[1], scenario.domain.lower[2])
        self.plotter.add_mesh(
            self.pv.Plane(center=floor, i_size=2 * self.size, j_size=2 * self.size), color="#dedede", lighting=False
        )
        self.plotter.set_background("white")
        self._lay_ruler(low, high)
        self.look(0.0)

    def _lay_ruler(self, low: np.ndarray, high: np.ndarray) -> None:
        """A scale bar on the floor before the matter, a third of it or less, with its length."""
        length = ruler(float(high[0] - low[0]) / 3.0)
        start = np.array([low[0], low[1] - 0.12 * self.size, self.scenario.domain.lower[2] + 2e-3 * self.size])
        end = start + np.array([length, 0.0, 0.0])
        self.plotter.add_mesh(self.pv.Line(start, end), color="black", line_width=4)
        label = f"{1e3 * length:g} mm" if length < 1.0 else f"{length:g} m"
        style = {"font_size": 22, "text_color": "black", "shape": None, "show_points": False, "always_visible": True}
        self.plotter.add_point_labels([0.5 * (start + end)], [label], **style)

    def look(self, turn: float) -> None:
        """Put the camera at an angle about the vertical [rad]."""
        arm = 1.35 * self.size * np.array([np.cos(turn - 1.1), np.sin(turn - 1.1), 0.55])
        self.plotter.camera_position = [tuple(self.center + arm), tuple(self.center), (0.0, 0.0, 1.0)]

    def show(self, frame: dict[str, np.ndarray]) -> None:
        """Replace what is on the stage."""
        self.plotter.remove_actor("matter", render=False)
        self.plotter.add_text(f"t = {float(frame['time']):.2f} s", name="clock", color="black", font_size=12)
        if not len(frame["position"]):
            return
        style: dict[str, Any] = (
            {"cmap": list(LAYERS), "show_scalar_bar": False}
            if self.colour == "layer"
            else {"cmap": "viridis", "scalar_bar_args": {"title": f"{COLOURS[self.colour]}\n", **BAR}}
        )
        cloud = _cloud(self.pv, frame, self.scenario, self.colour)
        self.plotter.add_mesh(cloud, scalars="value", clim=self.limits, name="matter", smooth_shading=True, **style)

    def still(self, path: Path) -> Path:
        self.plotter.screenshot(str(path))
        return path


def ruler(longest: float) -> float:
    """The longest of 1, 2, 5 times a power of ten that is no longer than this [m]."""
    step = 10.0 ** np.floor(np.log10(longest))
    return float(max(r * step for r in RULERS if r * step <= longest * (1.0 + 1e-9)))


def shown_at(times: np.ndarray, pace: float) -> np.ndarray:
    """The snapshot that each picture of a film shows, FPS a second: the last one taken by then, where `pace` simulated
    seconds pass in one of the film."""
    span = float(times[-1] - times[0])
    if span * FPS / pace > PICTURES:
        raise UserError(f"pace = {pace:g}: {span * FPS / pace:.3g} pictures; a film has {PICTURES} at most")
    clock = times[0] + pace * np.arange(int(np.ceil(span * FPS / pace - 1e-9)) + 1) / FPS
    return np.searchsorted(times, np.minimum(clock, times[-1]) + 1e-9 * span, side="right") - 1


def render(folder: Path, colour: str, turntable: bool, film: bool, pace: float = 1.0) -> list[Path]:
    """Draw a run into its folder: render.png, and where asked turntable.mp4 and film.mp4, in real time or at `pace`
    times that; returns the files."""
    scenario, frames = load(folder)
    if film and len(frames) < 2:
        raise UserError(f"{folder}: a film needs snapshots; run it with --frames")
    stage = Stage(scenario, frames, colour)
    stage.show(frames[-1])
    made = [stage.still(folder / "render.png")]
    if turntable:
        steps = (lambda i=i: stage.look(2 * np.pi * i / TURNS) for i in range(TURNS))
        made.append(_movie(stage, folder / "turntable.mp4", steps))
        stage.look(0.0)
    if film:
        chosen = shown_at(np.array([float(frame["time"]) for frame in frames]), pace)
        made.append(_movie(stage, folder / "film.mp4", (lambda i=i: stage.show(frames[i]) for i in chosen)))
    stage.plotter.close()
    return made


def _movie(stage: Stage, path: Path, steps: Iterable[Any]) -> Path:
    """An MP4 with one picture after each step."""
    try:
        import imageio.v2 as imageio
    except ImportError:
        raise UserError("films need imageio: pip install 'fluidbench[viz]'") from None
    part = path.with_suffix(".part.mp4")
    with imageio.get_writer(part, fps=FPS, macro_block_size=16) as writer:
        for step in steps:
            step()
            writer.append_data(stage.plotter.screenshot(None, return_img=True))
    part.replace(path)
    return path


def export(folder: Path) -> Path:
    """Every snapshot as .vtp with all particle fields, and series.pvd, which ParaView opens as a time series."""
    pv = _pyvista()
    scenario, frames = load(folder)
    target = folder / "paraview"
    target.mkdir(exist_ok=True)
    lines = []
    for i, frame in enumerate(frame for frame in frames if len(frame["position"])):
        points = pv.PolyData(frame["position"].astype(np.float32))
        for key, value in frame.items():
            if value.ndim and key != "position":
                points[key] = value
        points["layer"] = values_of(frame, scenario, "layer")
        points.save(target / f"particles_{i:04d}.vtp")
        lines.append(f'<DataSet timestep="{float(frame["time"]):.9g}" file="particles_{i:04d}.vtp"/>')
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"><Collection>'
    tail = "</Collection></VTKFile>"
    write_atomically(target / "series.pvd", "\n".join([head, *lines, tail, ""]))
    return target / "series.pvd"
