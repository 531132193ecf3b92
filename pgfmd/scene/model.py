"""The models of a scene: every section, every key, its meaning and its default. SI floats throughout.

A `Scene` comes from `pgfmd.scene.load_scene`, which also applies the rules for several keys and resolves "auto". Keys
that a scene does not use (such as `punch.wavelength` of a flat punch) are None.
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import PrivateAttr

from pgfmd.physics.adhesion.registry import DEFAULT_LAW, LAWS, LawName, meanings
from pgfmd.schemes import registry
from pgfmd.units import handy_quantity

from .drive_section import Drive
from .fields import Section, extra_of, key, number, quantity, toml_of, toml_text, written
from .output_section import Output
from .solver_section import INSTEAD_OF_OMEGA_AND_DT, GfmdKeys, Solver

if TYPE_CHECKING:
    from pgfmd.commands.check import Report

    from .unresolved_scene import Given

Keywords = Mapping[str, Any] | None
"""Keys of a section by name, with SI numbers or texts with units."""
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
    "file": _keys(
        "file",
        "file_size file_unit file_peaks file_detrend file_missing file_missing_value file_relief radius curvature_radius "
        "layer_step",
    ),
    "rough": _keys(
        "hurst longest shortest", "rms_height rms_slope roll_off period seed radius curvature_radius layer_step"
    ),
}
"""For every `punch.pattern` the keys of [punch] it needs and those it may have."""

RHEOLOGIES: dict[str, Keys] = {
    "elastic": _keys(),
    "single": _keys("modulus_ratio relaxation_time"),
    "geometric": _keys("modulus_ratio relaxation_time elements time_ratio exponent"),
    "prony": _keys("kappa tau", "reference"),
}
"""For every `rheology.model` the keys of [rheology] it needs and those it may have."""

ADHESION: dict[str, Keys] = {name: (law.required, law.optional) for name, law in LAWS.items()}
"""For every `adhesion.law` the keys of [adhesion] it needs and those it may have."""

LARGEST_MODULUS_RATIO = 1e6


if TYPE_CHECKING:
    # A scene is resolved: whoever reads one finds numbers in the place of words; and keys that its pattern or model has no
    # use for are None, which nobody reads who has looked at these.
    Automatic = float
    OfGrid = float
    OfLaw = float
    IfUsed = float
    CountIfUsed = int
    NumbersIfUsed = tuple[float, ...]
else:
    Automatic = float | Literal["auto"]
    OfGrid = float | Literal["grid"]
    OfLaw = IfUsed = float | None
    CountIfUsed = int | None
    NumbersIfUsed = tuple[float, ...] | None


class Punch(Section):
    """The rigid punch: its outline and the height profile z(x, y) of its lower face; lower z touches first."""

    pattern: Literal["triangular", "hexagonal", "flat", "sphere", "power", "sinusoid", "file", "rough"] = key(
        "shape of the lower face: `triangular` or `hexagonal` lattice of asperities, `flat`, `sphere` z = r^2/(2R), "
        "`power` z = R (r/R)^p / p, `sinusoid` z = z0 (1 + cos(2 pi x / wavelength)), heights from a `file`, or a random "
        "self-affine face, `rough`"
    )
    radius: float | None = quantity(
        "length",
        "radius a of the punch's outline; without it a `sinusoid`, a `file` or a `rough` face fills the whole cell",
        None,
    )
    wavelength: IfUsed = quantity("length", "wavelength of the pattern", None)
    amplitude: IfUsed = quantity("length", "amplitude z0: half of the difference of largest and smallest z", None)
    curvature_radius: float = quantity(
        "length",
        "radius R of the sphere or power law; for every other pattern the macroscopic curvature, which adds r^2/(2R)",
        math.inf,
        infinite=True,
    )
    exponent: IfUsed = number("exponent p of `power`", None, above=1.0)
    layer_step: float = quantity("length", "height step of a layer-by-layer print, 0 for none", 0.0, at_least=0.0)
    height_jitter: float = quantity(
        "length",
        "standard deviation of random height differences between the asperities, 0 for none",
        0.0,
        at_least=0.0,
    )
    seed: int = key("seed of the random height differences, and of the phases of `rough`", 0, ge=0, lt=2**63)
    hurst: IfUsed = number(
        "Hurst exponent H of `rough`: the spectrum falls like q^(-2-2H)", None, above=0.0, at_most=1.0
    )
    rms_height: float | None = quantity(
        "length", "root mean square of the heights of `rough` over a period; give this or `rms_slope`", None
    )
    rms_slope: float | None = number(
        "root mean square of the slope |grad z| of `rough` over a period; give this or `rms_height`", None, above=0.0
    )
    longest: IfUsed = quantity("length", "longest wavelength of `rough`", None)
    shortest: IfUsed = quantity("length", "shortest wavelength of `rough`, at least two grid points", None)
    roll_off: IfUsed = quantity(
        "length", "wavelength of `rough` from which on longer waves are all alike strong; `longest`, for none", None
    )
    period: IfUsed = quantity(
        "length",
        "period of `rough` along x and y; where the punch fills the cell, the cell's side, else twice the larger of "
        "`longest` and the punch's diameter",
        None,
    )
    file: str | None = key("file with the heights, relative to the scene's folder", None, min_length=1)
    file_size: tuple[float, float] | None = quantity(
        "length",
        "size of the height map along x and y, half a pixel beyond the first and the last one; by default as the file says",
        None,
        count=2,
    )
    file_unit: str | None = key(
        'unit of the heights, such as "um"; by default as the file says, and metres where it says nothing',
        None,
        min_length=1,
    )
    file_peaks: Literal["up", "down"] | None = key(
        "`up`: the largest heights touch first, as instruments have them; `down`: the lowest ones do; by default as the file says",
        None,
    )
    file_detrend: Literal["none", "tilt", "curvature"] = key(
        "what is taken off the heights under the punch: nothing, a plane, or a surface of second order", "none"
    )
    file_missing: Literal["refuse", "fill"] = key(
        "what is done about pixels under the punch without a height: `refuse` them, or `fill` them from those around",
        "refuse",
    )
    file_missing_value: tuple[float, ...] | None = number(
        "numbers in the file that mean a missing pixel; by default those that stand far apart from all heights",
        None,
        count=0,
    )
    file_relief: float | None = quantity(
        "length",
        "least height by which a summit or a valley of the map must stand out to count as a site; by default 5 % of the "
        "height range of the face",
        None,
    )

    @property
    def outline(self) -> float:
        """The radius [m], of a punch that has one: any but those that may fill the cell."""
        assert self.radius is not None, "a punch that fills the cell has no radius"
        return self.radius


class Substrate(Section):
    """The elastomer's static elasticity and how it is held."""

    youngs_modulus: float = quantity(
        "modulus",
        "relaxed (static) Young's modulus E(0), that of very slow loading; the instantaneous one with "
        '`rheology.reference = "instantaneous"`',
    )
    poisson_ratio: float = number("Poisson's ratio", above=-1.0, at_most=0.5)
    thickness: float = quantity("length", "thickness of the film", math.inf, infinite=True)
    base: Literal["bonded", "sliding"] | None = key(
        "how a film of finite thickness lies on its rigid base; by default `bonded`", None
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
    """The relaxation spectrum kappa(s) = 1 + sum kappa_n s tau_n / (1 + s tau_n); it multiplies the relaxed (static) modulus."""

    model: Literal["elastic", "single", "geometric", "prony"] = key(
        "`elastic`, a `single` Maxwell element, a `geometric` series of them, or your own `prony` series"
    )
    modulus_ratio: IfUsed = number(
        "instantaneous over relaxed modulus, E(infinity)/E(0)", None, above=1.0, at_most=LARGEST_MODULUS_RATIO
    )
    relaxation_time: IfUsed = quantity("time", "relaxation time; of `geometric` the shortest", None)
    elements: CountIfUsed = key("number N of Maxwell elements", None, ge=1, le=200)
    time_ratio: IfUsed = number("ratio s of successive relaxation times: tau_{n+1} = tau_n / s", None, above=1.0)
    exponent: IfUsed = number(
        "exponent beta of the weights: kappa_{n+1} = s^beta kappa_n", None, at_least=0.0, at_most=2.0
    )
    kappa: NumbersIfUsed = number(
        'weights of the elements, E_n/E(0); shares of the instantaneous modulus with `reference = "instantaneous"`',
        None,
        at_least=0.0,
        count=0,
    )
    tau: NumbersIfUsed = quantity("time", "relaxation times tau_n, as many as weights", None, count=0)
    reference: Literal["relaxed", "instantaneous"] | None = key(
        "modulus of which `kappa` are shares, and which `substrate.youngs_modulus` is: the `relaxed` one of long times, as "
        "in papers and by default, or the `instantaneous` one, as in Prony tables of finite-element programs "
        "(g_i of Abaqus, alpha_i of Ansys); kept as the relaxed one in a resolved scene",
        None,
    )


class Adhesion(Section):
    """The cohesive law between punch and elastomer."""

    law: LawName = key(meanings(), DEFAULT_LAW)
    work_of_adhesion: OfLaw = quantity(
        "energy per area",
        "work of adhesion gamma; of `repulsive` it only sets the overlap's stiffness; of `table` the area under the traction "
        "of the file by default",
        None,
    )
    range: Automatic = quantity(
        "length",
        "range rho; `auto` makes the largest stiffness of the law range_factor q_ref E*: gamma pi^2/(2 rho^2) with `cosine`. "
        "Of `table` the reach of the file by default",
        "auto",
        words=("auto",),
    )
    range_factor: float = number("factor of the automatic range; 0.156 gives the paper's ranges", 0.156, above=0.0)
    q_ref: OfGrid = quantity(
        "wavenumber", "reference wavenumber of the automatic range; `grid` is 2 pi n/L", "grid", words=("grid",)
    )
    smoothing: float | None = number(
        "width of the smooth ends of the traction, in ranges; by default 0.2", None, above=0.0, at_most=0.8
    )
    overlap_stiffness: float | None = quantity(
        "stiffness per area", "stiffness of overlaps; by default the largest one of the law", None
    )
    file: str | None = key(
        "file with gaps and tractions, relative to the scene's folder; see [](../explanation/adhesion.md#your-own-law)",
        None,
        min_length=1,
    )

    @property
    def attractive(self) -> bool:
        """Whether the law attracts."""
        return LAWS[self.law].attractive


class Grid(Section):
    """The square cell and its grid."""

    n: int = key("number of grid points along a side", ge=4, le=65536)
    length: float = quantity("length", "side L of the cell")


class Scene(Section):
    """A complete scene, validated and resolved: all numbers in SI, all automatic values computed. It is immutable.

        scene = pgfmd.Scene("tri-tack", grid={"n": 48}, drive={"speed": "50 um/s", "preload": 2e-3})
        scene.replace(grid={"n": 32})

    source: the name of a shipped scene, a TOML file, nested tables, another scene, or nothing. Each section takes the
    keys to change: SI numbers, or texts with units; None resets a key to its default. Raises SceneError with all
    problems. Scenes are equal if they describe the same run: unused keys do not matter.
    """

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

    _given: Any = PrivateAttr(default=None)

    def __init__(
        self,
        source: str | Path | Mapping[str, Any] | Scene = MappingProxyType({}),
        /,
        *,
        title: str | None = None,
        punch: Keywords = None,
        substrate: Keywords = None,
        rheology: Keywords = None,
        adhesion: Keywords = None,
        drive: Keywords = None,
        grid: Keywords = None,
        solver: Keywords = None,
        output: Keywords = None,
    ):
        from .reading import scene_of
        from .unresolved_scene import Given, with_units

        if isinstance(source, Scene):
            given = source.given
        elif isinstance(source, Mapping):
            given = Given.of(with_units(source))
        else:
            given = Given.read(source)
        named = {
            "title": title, "punch": punch, "substrate": substrate, "rheology": rheology, "adhesion": adhesion,
            "drive": drive, "grid": grid, "solver": solver, "output": output,
        }  # fmt: skip
        changes = {name: value for name, value in named.items() if value is not None}
        found = scene_of(given.changed(with_units(changes)))
        # The state of a pydantic model. It is not validated again, because resolved values need not be valid input.
        for name in ("__dict__", "__pydantic_fields_set__", "__pydantic_extra__", "__pydantic_private__"):
            object.__setattr__(self, name, getattr(found, name))

    @property
    def given(self) -> Given:
        """The scene as given, before it was resolved (unresolved_scene.py); the complete scene if that is unknown."""
        from .unresolved_scene import Given, parse_toml

        return self._given or Given.of(parse_toml(self.to_toml()))

    def remembering(self, given: Given | None) -> Self:
        """The same scene with the record of how it was given."""
        self._given = given
        return self

    def replace(self, **changes: Any) -> Scene:
        """A new scene with changed keys, such as `replace(grid={"n": 1024}, title="finer")`; automatic values are
        updated.

        Takes the same arguments as the constructor. Raises SceneError with all problems.
        """
        return Scene(self, **changes)

    def check(self, ranks: int = 1) -> Report:
        """The report of `pgfmd check` for this number of ranks: scales, memory, cost, warnings."""
        from pgfmd import check

        return check(self, ranks)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Scene:
        """A copy with other resolved values, which are not validated; for internal use, see `replace`."""
        other = super().model_copy(update=update, deep=deep)
        return other.remembering(None if update else self._given)

    def __repr__(self) -> str:
        drive, solver = self.drive, self.solver
        speed, preload = handy_quantity(drive.speed, "speed"), handy_quantity(drive.preload, "force")
        title = f"{self.title!r}, " if self.title else ""
        return f"<Scene {title}{self.punch.pattern} punch, {speed} to {preload}, n = {self.grid.n}, {solver.scheme}>"

    def _repr_html_(self) -> str:
        """A table of all sections and used keys, for notebooks."""
        rows = [f"<caption>{html.escape(self.title)}</caption>"] if self.title else []
        for name, values in self.tables().items():
            rows.append(f'<tr><th colspan="2" style="text-align:left">{name}</th></tr>')
            rows += [
                f"<tr><td>{key}</td><td>{html.escape(toml_text(value))}</td></tr>" for key, value in values.items()
            ]
        return f"<table>{''.join(rows)}</table>"

    __str__ = __repr__

    def section(self, name: str) -> Section:
        """The section of this name, such as "solver.gfmd"."""
        section: Section = getattr(self, name.replace(".", "_"))
        return section

    def __eq__(self, other: object) -> bool:
        return self.to_toml() == other.to_toml() if isinstance(other, Scene) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def to_toml(self) -> str:
        """The complete scene as TOML in SI units; loading it gives an equal scene. Unused keys are left out."""
        return toml_of(self.title, self.tables())

    def tables(self) -> dict[str, dict[str, Any]]:
        """All sections with their used keys, quantities as texts with SI units."""
        found: dict[str, dict[str, Any]] = {}
        for name, model in SECTIONS.items():
            unused, section = unused_keys(self, name), self.section(name)
            if unused.issuperset(model.model_fields):
                continue
            found[name] = {
                key: written(getattr(section, key), extra_of(field))
                for key, field in model.model_fields.items()
                if key not in unused and getattr(section, key) is not None
            }
        return found


SECTIONS: dict[str, type[Section]] = {
    "solver.gfmd" if name == "solver_gfmd" else name: field.annotation
    for name, field in Scene.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, Section)
}
"""The sections by name, in the order of the resolved scene."""


def unused_keys(scene: Scene, section: str) -> frozenset[str]:
    """The keys of a section that this scene must not have, because its pattern or model does not use them."""
    if section == "punch":
        required, optional = PATTERNS[scene.punch.pattern]
        return frozenset(Punch.model_fields) - required - optional - {"pattern"}
    if section == "adhesion":
        required, optional = ADHESION[scene.adhesion.law]
        return frozenset(Adhesion.model_fields) - required - optional - {"law"}
    if section == "rheology":
        required, optional = RHEOLOGIES[scene.rheology.model]
        return frozenset(Rheology.model_fields) - required - optional - {"model"}
    if section == "drive":
        return scene.drive.unused
    if section in registry.sections() and section != registry.scheme_of(scene).section:
        return frozenset(SECTIONS[section].model_fields)
    if section == "solver.gfmd" and scene.solver_gfmd.omega is not None and scene.solver_gfmd.dt is not None:
        return frozenset(INSTEAD_OF_OMEGA_AND_DT)
    return frozenset()
