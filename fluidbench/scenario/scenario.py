"""What to simulate: the validated description of one scenario, in SI units with z up.

A scenario says nothing of any method except in `numerics`, where each method's own section may override its defaults.
It is read from TOML (`load`), or built in Python from the same classes.
"""

import math
from functools import cached_property, partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, cast

import numpy as np
from pydantic import Field, field_validator, model_validator

from ..errors import quoted
from .body import CORNERS, Body
from .collider import Collider
from .domain import Domain
from .extent import check_size, check_time
from .material import Material
from .measured import Measured
from .model import Matrix, Model, Positive, Vector
from .nozzle import COLUMN, Nozzle
from .outline import Outline
from .places import check_bodies, check_collider, check_nozzle
from .plausible import warnings
from .slicer import completed
from .toolpath import Toolpath
from .track import Track

if TYPE_CHECKING:
    from .layout import Layout

LONGEST_NAME = 80
AGES = 65  # ages at which bounds look at a material that changes
TENSE = 1e-4  # lack of density that a tension is worth: what carries less carries none, for nobody would see


class Scenario(Model):
    """One experiment, the same for every method; SI units, z up, see docs/scenario.md for every key.

    Raises ValueError for what makes no experiment; `load` and `define` say it as a UserError, with key and cure.
    """

    judged_later: ClassVar = ("pool",)
    name: str = Field("unnamed", description="short name, used for folders")
    title: str = Field("", description="one line for people")
    domain: Domain
    material: Material
    gravity: Vector = Field((0.0, 0.0, -9.81), description="gravitational acceleration [m/s^2]")
    body_force: Vector = Field((0.0, 0.0, 0.0), description="further force per unit mass [m/s^2]")
    body_force_gradient: Matrix | None = Field(None, description="its change over space, symmetric [1/s^2]")
    body_force_center: Vector = Field((0.0, 0.0, 0.0), description="where the gradient adds nothing [m]")
    nozzle: Nozzle | None = None
    toolpath: Toolpath | None = None
    collider: Collider | None = Field(None, description="a rigid body carried along the toolpath")
    bodies: tuple[Body, ...] = ()
    duration: Positive = Field(description="simulated time, or its limit [s]")
    until: Literal["duration", "rest"] = Field(
        "duration", description="rest: a run ends once nothing moves any more (docs/physics.md, measures)"
    )
    output_interval: Positive | None = Field(None, description="time between outputs [s]; default duration / 20")
    tick: Positive | None = Field(None, description="time between emission events and re-planned substeps [s]")
    spacing: Positive = Field(description="particle spacing d [m]; a particle stands for d^3")
    sound_speed_ratio: Positive = Field(10.0, description="artificial c of a liquid over its reference speed [-]")
    jitter: Annotated[float, Field(ge=0, le=0.5)] = Field(0.0, description="random shift of bodies' particles / d [-]")
    pool: Annotated[int, Field(ge=1)] | None = Field(None, description="particles to preallocate; default an estimate")
    seed: Annotated[int, Field(ge=0)] = Field(0, description="the only source of randomness")
    reference: Literal["martin_moyce_front", "viscoplastic_slump"] | None = Field(
        None, description="a published answer to compare with (scenarios/reference)"
    )
    measured: tuple[Measured, ...] = Field((), description="what was measured on a real print, to compare with")
    numerics: dict[str, dict[str, Any]] = Field({}, description="per method: overrides of its own numerical settings")

    @model_validator(mode="before")
    @classmethod
    def _reads_gcode(cls, table: Any) -> Any:
        return completed(table)

    @field_validator("name")
    @classmethod
    def _names_a_folder(cls, name: str) -> str:
        plain = name.isprintable() and not set(name) & set('/\\:*?"<>|') and name == name.strip(" .")
        if not (plain and 0 < len(name) <= LONGEST_NAME and len(name.encode()) <= 2 * LONGEST_NAME):
            raise ValueError(
                f'names a folder: 1 to {LONGEST_NAME} printable characters without / \\ : * ? " < > | and without a '
                f"blank or a dot at either end (got {quoted(name)})"
            )
        return name

    @field_validator("title")
    @classmethod
    def _is_a_line(cls, title: str) -> str:
        if not title.isprintable() or len(title) > 300:
            raise ValueError(f"is one line of at most 300 printable characters (got {quoted(title)})")
        return title

    @model_validator(mode="after")
    def _consistent(self) -> "Scenario":
        for check in (
            self._check_source,
            partial(check_size, self),
            self._check_fields,
            partial(check_time, self),
            partial(check_nozzle, self),
            partial(check_bodies, self),
            self._check_periodic,
            self._check_force,
            partial(check_collider, self),
        ):
            check()
        return self

    def _check_source(self) -> None:
        if (self.nozzle is None) != (self.toolpath is None):
            raise ValueError("nozzle and toolpath belong together: give both or neither")
        if self.nozzle is None and not self.bodies:
            raise ValueError("nothing to simulate: give bodies, or a nozzle with a toolpath")

    def _check_fields(self) -> None:
        """What expressions and arrays come to at the very particles; before anything is derived of them."""
        for i, body in enumerate(self.bodies):
            if body.where is not None or body.velocity_field is not None or body.positions is not None:
                found = self._laid(body)
                if not len(found.position):
                    where = " where it is to be" * (body.where is not None)
                    raise ValueError(f"bodies.{i}: no place of it is inside the domain{where}")
                if not np.isfinite(found.velocity).all():
                    raise ValueError(f"bodies.{i}.velocity_field: it is no number somewhere in the body")

    def _laid(self, body: Body) -> "Layout":
        """The body as particles."""
        from .layout import lay_out

        return lay_out(body, self)

    def _check_periodic(self) -> None:
        for axis, periodic in enumerate(self.domain.walls.periodic()):
            length = self.domain.upper[axis] - self.domain.lower[axis]
            if periodic and length < 6 * self.spacing:
                raise ValueError(
                    f"a periodic axis needs at least 6 spacings; {'xyz'[axis]} has {length / self.spacing:.3g}"
                )

    def _check_force(self) -> None:
        if self.body_force_gradient is not None and not np.allclose(self.gradient, self.gradient.T):
            raise ValueError("body_force_gradient must be symmetric: only then has the force a potential")

    def replace(self, **changes: Any) -> Self:
        """The same with some values changed, in SI units or with a unit, validated like a file; raises UserError with
        one line a mistake, each with the key and the cure, as `load` does."""
        from .library import validate

        return cast(Self, validate(self._table() | changes, self.name))

    @cached_property
    def track(self) -> Track | None:
        """The toolpath in time."""
        if self.nozzle is None or self.toolpath is None:
            return None
        return Track.of(self.toolpath, self.domain.lower[2], self.nozzle.standoff)

    @property
    def acceleration(self) -> np.ndarray:
        """Gravity plus body force where its gradient adds nothing, shape (3,) [m/s^2]."""
        return np.asarray(self.gravity) + np.asarray(self.body_force)

    @property
    def gradient(self) -> np.ndarray:
        """Gradient of the body force, shape (3, 3) [1/s^2]."""
        return np.zeros((3, 3)) if self.body_force_gradient is None else np.asarray(self.body_force_gradient)

    def potential_at(self, points: np.ndarray) -> np.ndarray:
        """Minus the potential energy per unit mass at points of shape (n, 3) [J/kg]."""
        arm = points - np.asarray(self.body_force_center)
        uniform = (points * self.acceleration).sum(axis=1)
        return uniform + 0.5 * np.einsum("ni,ij,nj->n", arm, self.gradient, arm)

    @cached_property
    def peak_acceleration(self) -> float:
        """The largest acceleration where material starts [m/s^2]."""
        points = [np.asarray(self.body_force_center)[None, :]]
        points += [np.asarray(body.center) + CORNERS * body.extent for body in self.bodies]
        points += [] if self.track is None else [self.track.position]
        arm = np.concatenate(points) - np.asarray(self.body_force_center)
        return float(np.linalg.norm(self.acceleration + arm @ self.gradient.T, axis=1).max())

    @property
    def events_end(self) -> float:
        """When the last matter has been added, and expands [s]; from then on it is left to itself."""
        added = [0.0 if self.track is None else self.track.end, *(body.start for body in self.bodies)]
        return max(added) + (0.0 if self.material.expansion is None else self.material.expansion.last_event)

    @cached_property
    def reference_speed(self) -> float:
        """The fastest speed that the scenario itself implies [m/s]: initial, extruded, expanding, or sqrt(g H). H is
        the height of what is there; of what leaves the nozzle the gap below it, or its height above the floor where
        nothing that is laid would stand."""
        speeds, gap = [1e-3], 0.0
        if self.track is not None and self.nozzle is not None:
            speeds += [self.feeding_speed, float(self.track.speed_in.max())]
            stands = self.material.youngs_modulus is not None and self.material.relaxation_time is None
            gap = self.nozzle.standoff if stands else math.inf
        for body in self.bodies:
            speeds.append(self._top_speed(body))
            speeds.append(math.sqrt(np.abs(self.gradient).max()) * float(np.linalg.norm(body.extent)))
        if (expansion := self.material.expansion) is not None:
            sizes = [float(np.linalg.norm(body.extent)) for body in self.bodies]
            sizes += [self.nozzle.diameter / 2] if self.nozzle is not None else []
            speeds.append(expansion.speed(max(sizes)))
        return max(*speeds, self.falling_speed(gap))

    def falling_speed(self, gap: float = math.inf) -> float:
        """sqrt(g H) [m/s], of H the height above the floor of bodies and of the nozzle, of this at most a gap [m]."""
        floor = self.domain.lower[2]
        heights = [float(body.center[2] + body.extent[2]) - floor for body in self.bodies]
        if self.track is not None:
            heights.append(min(float(self.track.position[:, 2].max()) - floor, gap))
        return math.sqrt(float(np.linalg.norm(self.acceleration)) * max(*heights, 0.0))

    @property
    def feeding_speed(self) -> float:
        """With which matter leaves the nozzle, seen from the floor [m/s]; 0 without one."""
        if self.nozzle is None or self.track is None:
            return 0.0
        fed = self.track.flow_in > 0
        return float(np.hypot(self.nozzle.speed * self.track.flow_in, self.track.speed_in)[fed].max())

    @property
    def emits(self) -> bool:
        """Whether matter is fed in while time goes by."""
        return self.nozzle is not None

    @property
    def narrowest(self) -> float:
        """The narrowest side of what is put in: of a body, or across the nozzle [m]."""
        sizes = [2.0 * float(min(body.extent)) for body in self.bodies]
        return min(sizes + ([] if self.nozzle is None else [self.nozzle.diameter]))

    @property
    def wall_thickness(self) -> float:
        """Of what matter is pressed through, between bore and outside [m]; infinite where there is none."""
        if self.fed_from is None or self.nozzle is None:
            return math.inf
        return self.nozzle.face - 0.5 * self.nozzle.diameter

    def _top_speed(self, body: Body) -> float:
        """The fastest initial speed [m/s]: of the body's particles where these are given, or their speeds are by
        expressions, which may vary faster than any grid would show; at the corners of its box otherwise."""
        if body.positions is None and body.velocity_field is None:
            return body.top_speed
        return float(np.linalg.norm(self._laid(body).velocity, axis=1).max())

    @property
    def liquid_sound_speed(self) -> float:
        """Artificial sound speed of a liquid [m/s]: `sound_speed_ratio` times the reference speed (Monaghan 1994), or
        times sqrt(feeding pressure / density) where that is more: the larger of the scales of Morris et al. 1997."""
        fed = math.sqrt(self.feeding_pressure / self.material.density)
        return self.sound_speed_ratio * max(self.reference_speed, fed)

    @cached_property
    def feeding_pressure(self) -> float:
        """eta U / D [Pa], of matter that a nozzle of diameter D feeds at U: the scale of the viscous stress that pushes
        and pulls it; of a body `Nozzle.resistance` times that. A liquid that resists compression with less changes its
        density by as much, one that carries less tension is torn apart by its own viscosity. (Motion that nobody feeds
        runs out of energy before.)"""
        if self.nozzle is None:
            return 0.0
        return self.nozzle.resistance * self.material.viscosity * self.feeding_speed / self.nozzle.diameter

    @property
    def outline(self) -> Outline | None:
        """Of the rigid body that matter is pressed through, if there is one."""
        return None if self.nozzle is None else self.nozzle.outline

    @property
    def sticks(self) -> bool:
        """Whether there is one and matter sticks to it."""
        return self.outline is not None and not self.outline.slips

    @property
    def fed_from(self) -> float | None:
        """Height from which matter comes into the bore of a body, at most [m]; None without one."""
        if self.nozzle is None or self.track is None or self.outline is None:
            return None
        above = self.nozzle.rise + (COLUMN + 1) * self.spacing
        return float(self.track.position[:, 2].max()) + above

    @property
    def viscous_tension(self) -> float:
        """With which a liquid's own viscosity pulls it apart [Pa]: that of what is fed, or eta U / L of the reference
        speed across the narrowest body, which is no more than what drives it, rho U^2."""
        m, speed = self.material, self.reference_speed
        free = 0.0 if not self.bodies else m.viscosity * speed / self.narrowest
        return max(self.feeding_pressure, min(free, m.density * speed**2))

    def tension(self, material: Material) -> float:
        """At which a material of this scenario cavitates [Pa]: unless told, a liquid at that of its own viscosity, what
        has shear stiffness never."""
        if material.tension_limit is not None:
            return material.tension_limit
        return self.viscous_tension if material.youngs_modulus is None else math.inf

    @property
    def is_tensile(self) -> bool:
        """Whether any of its matter carries a tension worth mentioning."""
        sound = self.liquid_sound_speed
        return any(m.elastic or self.tension(m) > TENSE * m.bulk(sound) for m in self.aged[1])

    @property
    def wave_speed(self) -> float:
        """Longitudinal wave speed of the fresh material [m/s]."""
        return self.material.wave_speed(self.liquid_sound_speed)

    @cached_property
    def aged(self) -> tuple[np.ndarray, list[Material]]:
        """(ages (n,) [s], the material at each): fresh alone where nothing changes."""
        if not self.material.changes:
            return np.zeros(1), [self.material]
        ages = np.linspace(0.0, self.duration, AGES)
        return ages, self.material.by_age(ages.tolist())

    @property
    def top_wave_speed(self) -> float:
        """Longitudinal wave speed of the stiffest and lightest material of the whole run [m/s]."""
        return max(m.wave_speed(self.liquid_sound_speed) for m in self.aged[1])

    def made_of(self, material: Material) -> "Scenario":
        """The same scenario as if all its material were this; what is fed in is as viscous as before."""
        made = self.model_copy(update={"material": material})
        vars(made)["feeding_pressure"] = self.feeding_pressure
        if self.track is not None:
            vars(made)["track"] = self.track  # no matter of the material, and dear to lay out
        return made

    @cached_property
    def schedule(self) -> tuple[float, int, int]:
        """(tick [s], ticks in all, ticks between outputs).

        A tick is the common clock of all methods: emission happens at its edges, so every method is fed the same
        stream. By default matter moves at most a quarter of a spacing in it.
        """
        interval = min(self.output_interval or self.duration / 20.0, self.duration)
        wanted = min(self.tick or 0.25 * self.spacing / self.reference_speed, interval)
        per_output = max(1, math.ceil(interval / wanted - 1e-9))
        tick = interval / per_output
        return tick, max(1, round(self.duration / tick)), per_output

    def warnings(self) -> list[str]:
        """Values whose order of magnitude suggests a wrong unit, and what makes visible compression."""
        return warnings(self)
