"""The models of a scene: every section, every key, its meaning and its default. SI floats throughout.

A `Scene` comes from `pgfmd.scene.load_scene`, which also makes the checks that look at several keys and resolves what
"auto" stands for. Keys that a scene does not use (such as `punch.wavelength` of a flat punch) are None.
"""

from __future__ import annotations

import json
import math
from typing import Any, Literal

from .fields import Section, key, number, quantity, written
from .output_section import Output
from .solver_section import INSTEAD_OF_OMEGA_AND_DT, GfmdKeys, Solver

Keys = tuple[frozenset[str], frozenset[str]]


def _keys(required: str = "", optional: str = "") -> Keys:
    return frozenset(required.split()), frozenset(optional.split())


PATTERNS: dict[str, Keys] = {
    "triangular": _keys("radius wavelength amplitude", "curvature_radius layer_step height_jitter seed"),
    "hexagonal": _keys("radius wavelength amplitude", "curvature_radius layer_step height_jitter seed"),
    "flat": _keys("radius", "curvature_radius layer_step"),
    "sphere": _keys("radius curvature_radius", "layer_step"),
    "power": _keys("radius curvature_radius exponent", "layer_step"),
    "sinusoid": _keys("wavelength amplitude", "radius curvature_radius layer_step height_jitter seed"),
    "file": _keys("file", "file_size file_relief radius curvature_radius layer_step"),
}
"""For every `punch.pattern` the keys of [punch] it needs and those it may have."""

RHEOLOGIES: dict[str, Keys] = {
    "elastic": _keys(),
    "single": _keys("modulus_ratio relaxation_time"),
    "geometric": _keys("modulus_ratio relaxation_time elements time_ratio exponent"),
    "prony": _keys("kappa tau"),
}
"""For every `rheology.model` the keys of [rheology] it needs and those it may have."""

LARGEST_MODULUS_RATIO = 1e6


class Punch(Section):
    """The rigid punch: its outline and the height profile z(x, y) of its lower face; lower z touches first."""

    pattern: Literal["triangular", "hexagonal", "flat", "sphere", "power", "sinusoid", "file"] = key(
        "shape of the lower face: `triangular` or `hexagonal` lattice of asperities, `flat`, `sphere` z = r^2/(2R), "
        "`power` z = R (r/R)^p / p, `sinusoid` z = z0 (1 + cos(2 pi x / wavelength)), or heights from a `file`"
    )
    radius: float | None = quantity(
        "length", "radius a of the punch's outline; without it a `sinusoid` or a `file` fills the whole cell", None
    )
    wavelength: float | None = quantity("length", "wavelength of the pattern", None)
    amplitude: float | None = quantity("length", "amplitude z0: half of the difference of largest and smallest z", None)
    curvature_radius: float = quantity(
        "length",
        "radius R of the sphere or power law; for every other pattern the macroscopic curvature, which adds r^2/(2R)",
        math.inf,
        infinite=True,
    )
    exponent: float | None = number("exponent p of `power`", None, above=1.0)
    layer_step: float = quantity("length", "height step of a layer-by-layer print, 0 for none", 0.0, at_least=0.0)
    height_jitter: float = quantity(
        "length",
        "standard deviation of random height differences between the asperities, 0 for none",
        0.0,
        at_least=0.0,
    )
    seed: int = key("seed of the random height differences", 0, ge=0, lt=2**63)
    file: str | None = key("file with the heights, relative to the scene's folder", None, min_length=1)
    file_size: tuple[float, float] | None = quantity(
        "length", "size of the height map along x and y, where the file itself does not say", None, count=2
    )
    file_relief: float | None = quantity(
        "length",
        "least height by which a summit or a valley of the map must stand out to count as a site; 5 % of the height "
        "range of the face unless said otherwise",
        None,
    )


class Substrate(Section):
    """The elastomer's static elasticity and how it is held."""

    youngs_modulus: float = quantity("modulus", "static Young's modulus E(0)")
    poisson_ratio: float = number("Poisson's ratio", above=-1.0, at_most=0.5)
    thickness: float = quantity("length", "thickness of the film", math.inf, infinite=True)
    base: Literal["bonded", "sliding"] | None = key(
        "how a film of finite thickness lies on its rigid base; `bonded` unless said otherwise", None
    )
    boundary: Literal["periodic", "free"] = key(
        "`periodic` cell, or `free`: a punch alone on an infinite plane", "periodic"
    )
    prestrain: tuple[float, float] = number(
        "stiffness factors of the prestrain along x and y", (1.0, 1.0), above=0.0, count=2
    )
    compliance_file: str | None = key(
        "file with your own compliance: two columns, q [1/m] and G0(q) [m/Pa]; relative to the scene's folder",
        None,
        min_length=1,
    )

    @property
    def contact_modulus(self) -> float:
        """E* = E/(1 - nu^2) [Pa] of the static elastomer."""
        return self.youngs_modulus / (1.0 - self.poisson_ratio**2)


class Rheology(Section):
    """The relaxation spectrum kappa(s) = 1 + sum kappa_n s tau_n / (1 + s tau_n); it multiplies the static modulus."""

    model: Literal["elastic", "single", "geometric", "prony"] = key(
        "`elastic`, a `single` Maxwell element, a `geometric` series of them, or your own `prony` series"
    )
    modulus_ratio: float | None = number("E(infinity)/E(0)", None, above=1.0, at_most=LARGEST_MODULUS_RATIO)
    relaxation_time: float | None = quantity("time", "relaxation time; of `geometric` the shortest", None)
    elements: int | None = key("number N of Maxwell elements", None, ge=1, le=200)
    time_ratio: float | None = number("ratio s of successive relaxation times: tau_{n+1} = tau_n / s", None, above=1.0)
    exponent: float | None = number(
        "exponent beta of the weights: kappa_{n+1} = s^beta kappa_n", None, at_least=0.0, at_most=2.0
    )
    kappa: tuple[float, ...] | None = number("weights kappa_n = k_n/k_0", None, at_least=0.0, count=0)
    tau: tuple[float, ...] | None = quantity("time", "relaxation times tau_n, as many as weights", None, count=0)


class Adhesion(Section):
    """The cohesive law between punch and elastomer."""

    law: Literal["cosine", "repulsive"] = key(
        "`cosine`: the paper's law; `repulsive`: its harmonic overlap alone", "cosine"
    )
    work_of_adhesion: float = quantity(
        "energy per area", "work of adhesion gamma; of `repulsive` it only sets the overlap's stiffness"
    )
    range: float | Literal["auto"] = quantity(
        "length", "range rho; `auto` solves gamma pi^2/(2 rho^2) = range_factor q_ref E*", "auto", words=("auto",)
    )
    range_factor: float = number("factor of the automatic range; 0.156 gives the paper's ranges", 0.156, above=0.0)
    q_ref: float | Literal["grid"] = quantity(
        "wavenumber", "reference wavenumber of the automatic range; `grid` is 2 pi n/L", "grid", words=("grid",)
    )


class Drive(Section):
    """The loading programme: approach at constant speed to the preload, turn, hold, retract."""

    speed: float = quantity("speed", "speed of the approach")
    preload: float = quantity("force", "compressive force at which the punch turns round")
    retract_speed: float | None = quantity(
        "speed", "speed of the retraction; that of the approach unless said otherwise", None
    )
    dwell: float = quantity("time", "time for which the displacement is held after the turn", 0.0, at_least=0.0)
    control: Literal["displacement", "load"] = key(
        "what the machine controls: `displacement`, or `load`, by a very soft spring; `quasistatic` only", "displacement"
    )
    machine_stiffness: float = quantity(
        "stiffness", "stiffness of the machine's spring between drive and punch; `quasistatic` only", math.inf,
        infinite=True,
    )  # fmt: skip
    turn_time: float | Literal["auto"] = quantity(
        "time",
        "time in which the velocity turns; `auto` moves the punch by at most 0.02 ranges beyond the preload and by "
        "at most 0.02 back: 0.08 range/speed at equal speeds, 0.04 range over the faster one where they are very "
        "different",
        "auto",
        words=("auto",),
    )
    clearance: float | Literal["auto"] = quantity(
        "length",
        "smallest gap at the start, negative to start pressed in; `auto` is the range, just out of reach",
        "auto",
        above=None,
        words=("auto",),
    )


class Grid(Section):
    """The square cell and its grid."""

    n: int = key("number of grid points along a side", ge=4, le=65536)
    length: float = quantity("length", "side L of the cell")


class Scene(Section):
    """A whole scene, resolved: every number in SI, nothing left automatic. Scenes are equal where they run alike: keys
    without a use don't count."""

    title: str = key("a line that names the scene in plots and reports", "")
    punch: Punch
    substrate: Substrate
    rheology: Rheology
    adhesion: Adhesion
    drive: Drive
    grid: Grid
    solver: Solver
    solver_gfmd: GfmdKeys
    output: Output

    def section(self, name: str) -> Section:
        """The section that a scene calls by this name, such as "solver.gfmd"."""
        return getattr(self, name.replace(".", "_"))

    def __eq__(self, other: object) -> bool:
        return self.to_toml() == other.to_toml() if isinstance(other, Scene) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def to_toml(self) -> str:
        """The complete scene as TOML in SI units; loading it gives an equal scene. Keys without a use are left out."""
        lines = [f"title = {_toml(self.title)}"] if self.title else []
        for name, model in SECTIONS.items():
            if unused_keys(self, name).issuperset(model.model_fields):
                continue
            lines += [""] * bool(lines) + [f"[{name}]"]
            section = self.section(name)
            for field_name, field in model.model_fields.items():
                value = getattr(section, field_name)
                if value is not None and field_name not in unused_keys(self, name):
                    lines.append(f"{field_name} = {_toml(written(value, field.json_schema_extra))}")
        return "\n".join(lines) + "\n"


SECTIONS: dict[str, type[Section]] = {
    "solver.gfmd" if name == "solver_gfmd" else name: field.annotation
    for name, field in Scene.model_fields.items()
    if field.annotation is not str
}
"""The sections by the names that a scene gives them, in the order of the resolved scene."""


def unused_keys(scene: Scene, section: str) -> frozenset[str]:
    """The keys of a section that this scene must not name, because its pattern or model has no use for them."""
    if section == "punch":
        required, optional = PATTERNS[scene.punch.pattern]
        return frozenset(Punch.model_fields) - required - optional - {"pattern"}
    if section == "rheology":
        required, optional = RHEOLOGIES[scene.rheology.model]
        return frozenset(Rheology.model_fields) - required - optional - {"model"}
    if section == "solver.gfmd":
        if scene.solver.scheme != "gfmd":
            return frozenset(GfmdKeys.model_fields)
        if scene.solver_gfmd.omega is not None and scene.solver_gfmd.dt is not None:
            return frozenset(INSTEAD_OF_OMEGA_AND_DT)
    return frozenset()


def _toml(value: Any) -> str:
    """A text, number, truth value or list as TOML writes it."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(_toml(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)
