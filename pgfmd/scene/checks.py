"""The rules of a scene that involve several keys.

Each rule is a generator of Problems for a `PartialScene`, which has all values that could be read. A rule that uses a
missing or wrong value ends there, because that value has already been reported. So all problems of a scene are reported
together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from types import SimpleNamespace

from pgfmd.errors import Problem
from pgfmd.maps.raw import unit_of
from pgfmd.physics.adhesion.registry import LAWS
from pgfmd.physics.random_surface import MOST_WAVES, automatic_period
from pgfmd.schemes import registry
from pgfmd.units import format_quantity

from .fields import expectation, extra_of
from .model import ADHESION, LARGEST_MODULUS_RATIO, PATTERNS, RHEOLOGIES, SECTIONS, Keys
from .partial_scene import MISSING, PartialScene, Unread, example
from .path_checks import paths_can_be_used
from .programme_checks import PROGRAMME_RULES, followed_files_can_be_read
from .solver_section import INSTEAD_OF_OMEGA_AND_DT, GfmdKeys

ROUNDING = 1.0 + 1e-9
LONGEST_TIME = 1e15
SINGLE_ROUNDING = 6e-8
"""Rounding error of single precision. The traction f = (w - w_hist)/J has this error times E(inf)/E(0)."""
SINGLE_SHARE = 0.02
"""Largest allowed error of the traction in single precision, as a fraction of the accuracy."""
FINEST_SINGLE = 1e-3
"""Finest accuracy in single precision."""
_MIXED = 'set solver.precision = "mixed"'


def _keys_of_choice(partial: PartialScene, section: str, selector: str, table: dict[str, Keys]) -> Iterator[Problem]:
    """Requires the keys that a choice (such as the pattern "flat") needs, and refuses unused ones."""
    choice = partial[f"{section}.{selector}"]
    required, optional = table[choice]
    for name, model_field in SECTIONS[section].model_fields.items():
        dotted = f"{section}.{name}"
        if name in required and not partial.given(dotted):
            extra = extra_of(model_field)
            expected = f"{expectation(extra)}, for the {selector} '{choice}'" if extra else f"a value for '{choice}'"
            yield Problem(dotted, MISSING, expected, f"add {example(section, name)} to [{section}]")
        elif partial.given(dotted) and name != selector and name not in required | optional:
            users = [other for other, keys in table.items() if name in keys[0] | keys[1]]
            cure = f"delete it, or choose {selector} = " + " or ".join(f'"{user}"' for user in users)
            yield partial.problem(dotted, f"no such key for the {selector} '{choice}'", cure)


def punch_keys(partial: PartialScene) -> Iterator[Problem]:
    yield from _keys_of_choice(partial, "punch", "pattern", PATTERNS)


def rheology_keys(partial: PartialScene) -> Iterator[Problem]:
    yield from _keys_of_choice(partial, "rheology", "model", RHEOLOGIES)


def adhesion_keys(partial: PartialScene) -> Iterator[Problem]:
    yield from _keys_of_choice(partial, "adhesion", "law", ADHESION)


def law_can_be_read(partial: PartialScene) -> Iterator[Problem]:
    """The file of a law; whether it is there is another rule's."""
    law, path = LAWS[partial["adhesion.law"]], partial.path("adhesion.file")
    if "file" in law.required and path is not None and path.is_file():
        try:
            law.own_values(SimpleNamespace(file=str(path)))
        except (OSError, ValueError) as error:
            yield partial.problem("adhesion.file", "a law of adhesion", str(error))


def punch_fits_the_cell(partial: PartialScene) -> Iterator[Problem]:
    radius, length = partial["punch.radius"], partial["grid.length"]
    if radius is not None and 2 * radius > length * ROUNDING:
        most = format_quantity(length / 2, "length")
        yield partial.problem(
            "punch.radius",
            f"at most half the cell, {most}",
            f"reduce it, or raise grid.length to {2 * radius:g} m or more",
        )


def free_punch_has_room(partial: PartialScene) -> Iterator[Problem]:
    if partial["substrate.boundary"] != "free":
        return
    radius, length = partial["punch.radius"], partial["grid.length"]
    if radius is None and "radius" not in PATTERNS[partial["punch.pattern"]][0]:
        yield partial.problem(
            "punch.radius",
            "a radius, because the boundary is free",
            f'add {example("punch", "radius")} to [punch], or set substrate.boundary = "periodic"',
        )
    elif radius is not None and length / 2 * ROUNDING < 2 * radius <= length * ROUNDING:
        yield partial.problem(
            "punch.radius",
            f"at most a quarter of the cell, {format_quantity(length / 4, 'length')}, because the boundary is free",
            f"raise grid.length to {4 * radius:g} m or more",
        )


def curvature_has_an_axis(partial: PartialScene) -> Iterator[Problem]:
    bounded = partial["punch.radius"] is not None or "radius" in PATTERNS[partial["punch.pattern"]][0]
    if math.isfinite(partial["punch.curvature_radius"]) and not bounded:
        yield partial.problem(
            "punch.curvature_radius",
            "no curvature for a profile that fills the whole cell",
            "delete it, or give punch.radius",
        )


def punch_covers_grid_points(partial: PartialScene) -> Iterator[Problem]:
    radius, n, length = partial["punch.radius"], partial["grid.n"], partial["grid.length"]
    if radius is not None and radius < length / n:
        yield partial.problem(
            "grid.n", f"a spacing length/n below the punch's radius, {radius:g} m", _raise_n(length / radius)
        )


def _raise_n(least: float) -> str:
    return f"raise grid.n to {math.ceil(least / ROUNDING)} or more"


def wavelength_is_resolved(partial: PartialScene) -> Iterator[Problem]:
    wavelength, n, length = partial["punch.wavelength"], partial["grid.n"], partial["grid.length"]
    if wavelength is not None and wavelength * ROUNDING < 2 * length / n:
        yield partial.problem(
            "punch.wavelength",
            f"at least two grid points, {format_quantity(2 * length / n, 'length')}",
            _raise_n(2 * length / wavelength),
        )


def sinusoid_is_periodic(partial: PartialScene) -> Iterator[Problem]:
    if partial["punch.pattern"] != "sinusoid" or partial["punch.radius"] is not None:
        return
    length, wavelength = partial["grid.length"], partial["punch.wavelength"]
    if wavelength is None:
        return
    waves = length / wavelength
    if round(waves) < 1 or abs(waves - round(waves)) > 1e-6 * waves:
        near = format_quantity(length / max(round(waves), 1), "length")
        yield partial.problem(
            "punch.wavelength",
            "a whole number of wavelengths in grid.length, because the sinusoid fills the cell",
            f'write "{near}", or give punch.radius',
        )


def rough_face_has_one_size(partial: PartialScene) -> Iterator[Problem]:
    if partial["punch.pattern"] != "rough":
        return
    names = ("rms_height", "rms_slope")
    given = [partial.given(f"punch.{name}") for name in names]
    if all(given):
        yield partial.problem(
            "punch.rms_slope", "either rms_height or rms_slope, as one follows from the other", "delete one"
        )
    elif not any(given):
        cure = f"add {example('punch', 'rms_height')}, or rms_slope = 0.1, to [punch]"
        yield Problem("punch.rms_height", MISSING, "rms_height or rms_slope, for the pattern 'rough'", cure)


def rough_waves_fit(partial: PartialScene) -> Iterator[Problem]:
    """Wavelengths of a random face in their order, within its period and on the grid."""
    if partial["punch.pattern"] != "rough":
        return
    longest, shortest, length, n = (
        partial[key] for key in ("punch.longest", "punch.shortest", "grid.length", "grid.n")
    )
    if None in (longest, shortest):
        return
    roll_off = longest if partial["punch.roll_off"] is None else partial["punch.roll_off"]
    if shortest > longest:
        most = format_quantity(longest, "length")
        yield partial.problem("punch.shortest", f"at most the longest wavelength, {most}", "swap the two, or reduce it")
    elif not shortest <= roll_off <= longest:
        cure = "choose it between the two, or delete it for no roll-off"
        yield partial.problem("punch.roll_off", "a wavelength from punch.shortest to punch.longest", cure)
    if shortest * ROUNDING < 2 * length / n:
        least = format_quantity(2 * length / n, "length")
        yield partial.problem("punch.shortest", f"at least two grid points, {least}", _raise_n(2 * length / shortest))
    radius = partial["punch.radius"]
    period = partial["punch.period"] or automatic_period(radius, longest, length)
    if longest > period * ROUNDING:
        most = f"at most the period of the face, {format_quantity(period, 'length')}"
        yield partial.problem(
            "punch.longest", most, "reduce it" if radius is None else "reduce it, or raise punch.period"
        )
    limit = period / MOST_WAVES
    if shortest * ROUNDING < limit:
        cure = "raise it; shorter waves of so large a face would need too much memory"
        expected = f"at least 1/{MOST_WAVES} of the period of the face, {format_quantity(limit, 'length')}"
        yield partial.problem("punch.shortest", expected, cure)


def rough_period_fits(partial: PartialScene) -> Iterator[Problem]:
    """A period of a random face that leaves no step at the border of the cell, nor repeats the face below the punch."""
    period, radius, length = partial["punch.period"], partial["punch.radius"], partial["grid.length"]
    if period is None or partial["punch.pattern"] != "rough":
        return
    if radius is not None and period * ROUNDING < 2 * radius:
        diameter = format_quantity(2 * radius, "length")
        yield partial.problem(
            "punch.period", f"at least the diameter, {diameter}, below which it would repeat", "delete it"
        )
    periods = length / period
    if radius is None and abs(periods - max(round(periods), 1)) > 1e-9 * periods:
        expected = "a whole number of periods in grid.length, because the face fills the cell"
        yield partial.problem("punch.period", expected, "delete it for one period, or give punch.radius")


def map_has_a_unit_of_length(partial: PartialScene) -> Iterator[Problem]:
    unit = partial["punch.file_unit"]
    if unit is None:
        return
    try:
        unit_of(unit)
    except ValueError as error:
        yield partial.problem(
            "punch.file_unit", 'a unit of length, such as "um", or a multiple of one, "0.25 nm"', str(error)
        )


def substrate_is_of_one_kind(partial: PartialScene) -> Iterator[Problem]:
    film = math.isfinite(partial["substrate.thickness"])
    own = partial["substrate.compliance_file"] is not None
    free = partial["substrate.boundary"] == "free"
    if partial.given("substrate.base") and not film:
        cure = "delete it, or give a thickness"
        yield partial.problem("substrate.base", "no base under an infinitely thick substrate", cure)
    if partial["substrate.prestrain"] != (1.0, 1.0) and (film or free):
        why = "a film" if film else "a free boundary"
        cure = "delete it: prestrain needs a periodic half-space"
        yield partial.problem("substrate.prestrain", f"[1, 1] with {why}", cure)
    if not own:
        return
    if film:
        cure = "delete it: the file holds the film's effect"
        yield partial.problem("substrate.thickness", '"inf" with a compliance file', cure)
    if partial["substrate.prestrain"] != (1.0, 1.0):
        yield partial.problem("substrate.prestrain", "[1, 1] with a compliance file", "delete one of the two")
    if free:
        yield partial.problem("substrate.boundary", '"periodic" with a compliance file', "delete one of the two")


def refer_to_relaxed(partial: PartialScene) -> list[Problem]:
    """Turns shares of the instantaneous modulus, and that modulus, into weights of the relaxed one, and the relaxed one:
    E(0) = E(infinity) (1 - sum g), kappa_n = g_n/(1 - sum g). Returns what is impossible."""
    try:
        if partial["rheology.model"] != "prony" or partial["rheology.reference"] != "instantaneous":
            return []
        shares, modulus = partial["rheology.kappa"], partial["substrate.youngs_modulus"]
        if shares is None:
            return []
        if partial["substrate.compliance_file"] is not None:
            cure = "delete it: the file holds the static compliance, so kappa are shares of the relaxed modulus"
            return [partial.problem("rheology.reference", '"relaxed" with a compliance file', cure)]
    except Unread:
        return []
    rest = 1.0 - math.fsum(shares)
    if not rest >= 1.0 / LARGEST_MODULUS_RATIO:
        total = math.fsum(shares)
        cure = (
            'leave out reference, or set it to "relaxed", if these are E_n/E(0)'
            if total > 1.0
            else "look at the shares"
        )
        expected = f"shares of the instantaneous modulus with a sum below 1, what relaxes at last; it is {total:.6g}"
        return [partial.problem("rheology.kappa", expected, cure)]
    partial.values["rheology"] |= {"kappa": tuple(share / rest for share in shares), "reference": "relaxed"}
    partial.values["substrate"]["youngs_modulus"] = modulus * rest
    return []


def prony_series_is_sound(partial: PartialScene) -> Iterator[Problem]:
    if partial["rheology.model"] != "prony":
        return
    kappa = partial["rheology.kappa"]
    if kappa is not None and 1.0 + sum(kappa) > LARGEST_MODULUS_RATIO * ROUNDING:
        expected = f"weights with 1 + sum <= {LARGEST_MODULUS_RATIO:g}"
        yield partial.problem("rheology.kappa", expected, "reduce the weights")
    tau = partial["rheology.tau"]
    if kappa is not None and tau is not None and len(kappa) != len(tau):
        yield partial.problem(
            "rheology.tau", f"{len(kappa)} times, one for every weight in kappa", f"it has {len(tau)}"
        )


def geometric_times_are_finite(partial: PartialScene) -> Iterator[Problem]:
    if partial["rheology.model"] != "geometric":
        return
    names = ("relaxation_time", "time_ratio", "elements")
    shortest, ratio, elements = (partial[f"rheology.{name}"] for name in names)
    if None in (shortest, ratio, elements):
        return
    if math.log10(shortest) + (elements - 1) * math.log10(ratio) > math.log10(LONGEST_TIME):
        yield partial.problem(
            "rheology.elements",
            f"a longest time relaxation_time * time_ratio^(elements-1) of at most {LONGEST_TIME:g} s",
            "use fewer elements or a smaller time_ratio",
        )


def inertia_is_given(partial: PartialScene) -> Iterator[Problem]:
    if registry.named(partial["solver.scheme"]).section != "solver.gfmd":
        return
    keys = ("omega", "dt")
    given = [partial.given(f"solver.gfmd.{name}") for name in keys]
    model = partial["rheology.model"]
    elastic = model == "elastic" or (model == "prony" and not any(partial["rheology.kappa"] or (1.0,)))
    for name, here in zip(keys, given, strict=True):
        if not here and (any(given) or elastic):
            why = "an elastic substrate, which has no relaxation time" if elastic else "the other one given alone"
            cure = 'add both, such as omega = "15700 rad/s" and dt = "20 us", to [solver.gfmd]'
            yield partial.problem(f"solver.gfmd.{name}", f"both omega and dt, because of {why}", cure)
    for name in INSTEAD_OF_OMEGA_AND_DT:
        # Resolved scenes of old runs contain these keys with their defaults.
        if all(given) and partial[f"solver.gfmd.{name}"] != GfmdKeys.model_fields[name].default:
            yield partial.problem(
                f"solver.gfmd.{name}",
                "no such key in addition to omega and dt, which determine the inertia",
                "delete it",
            )


def scheme_has_the_boundary(partial: PartialScene) -> Iterator[Problem]:
    why = registry.named(partial["solver.scheme"]).periodic_only
    if why and partial["substrate.boundary"] == "free":
        cure = f'set substrate.boundary = "periodic", or solver.scheme = "{registry.DEFAULT}"'
        yield partial.problem("substrate.boundary", f"a periodic cell, because {why}", cure)


def scheme_has_the_precision(partial: PartialScene) -> Iterator[Problem]:
    scheme = registry.named(partial["solver.scheme"])
    if partial["solver.precision"] not in ("auto", *scheme.precisions):
        words = " or ".join(f"'{precision}'" for precision in scheme.precisions)
        yield partial.problem("solver.precision", f"{words} with the scheme {scheme.name}", "delete it")


def scheme_has_the_machine(partial: PartialScene) -> Iterator[Problem]:
    control, stiffness = partial["drive.control"], partial["drive.machine_stiffness"]
    scheme = registry.named(partial["solver.scheme"])
    if not scheme.has_machine and any(step.controls_load for step in partial["drive.step"]):
        who, cure = _only([entry.name for entry in registry.entries() if entry.has_machine])
        yield partial.problem("drive.step", f"steps of the displacement, as {who} controls a load", cure)
    if scheme.has_machine:
        if control == "load" and math.isfinite(stiffness):
            yield partial.problem("drive.machine_stiffness", "no such key under load control", "delete it")
    elif control == "load" or math.isfinite(stiffness):
        who, cure = _only([entry.name for entry in registry.entries() if entry.has_machine])
        if control == "load":
            yield partial.problem("drive.control", f"'displacement', as {who} controls a load", cure)
        if math.isfinite(stiffness):
            expected = f"no such key, as {who} has a machine with a spring"
            yield partial.problem("drive.machine_stiffness", expected, cure)
    if not scheme.has_modulus and partial["solver.modulus"] == "instantaneous":
        who, cure = _only([entry.name for entry in registry.entries() if entry.has_modulus])
        yield partial.problem("solver.modulus", f"'relaxed', as {who} has a modulus of its own", cure)


def _only(names: list[str]) -> tuple[str, str]:
    """Which schemes support a feature, and how to use one of them, or do without."""
    cure = "delete it, or set solver.scheme = " + " or ".join(f'"{name}"' for name in names)
    return f"only the scheme {' or '.join(names)}", cure


def single_precision_is_enough(partial: PartialScene) -> Iterator[Problem]:
    if partial["solver.precision"] != "single":
        return
    accuracy = partial["solver.accuracy"]
    if accuracy < FINEST_SINGLE:
        yield partial.problem("solver.accuracy", f"at least {FINEST_SINGLE:g} in single precision", _MIXED)
    if _modulus_ratio(partial) * SINGLE_ROUNDING > SINGLE_SHARE * accuracy:
        most = SINGLE_SHARE * accuracy / SINGLE_ROUNDING
        name = "rheology.kappa" if partial["rheology.model"] == "prony" else "rheology.modulus_ratio"
        yield partial.problem(
            name, f"E(infinity)/E(0) of at most {most:.3g} at this accuracy in single precision", _MIXED
        )


def springs_are_not_single(partial: PartialScene) -> Iterator[Problem]:
    precision = partial["solver.precision"]
    scheme = registry.named(partial["solver.scheme"])
    if not scheme.has_machine or precision in ("auto", "double"):
        return
    if partial["drive.control"] == "load" or any(step.controls_load for step in partial["drive.step"]):
        # The elongation of the soft spring is a thousand times the travel of the punch.
        yield partial.problem("solver.precision", "'double' under load control", "delete it")
    elif math.isfinite(partial["drive.machine_stiffness"]) and precision not in scheme.precisions_with_spring:
        yield partial.problem("solver.precision", "'double' or 'mixed' where the machine has a spring", _MIXED)


def _modulus_ratio(partial: PartialScene) -> float:
    model = partial["rheology.model"]
    if model == "elastic":
        return 1.0
    return 1.0 + sum(partial["rheology.kappa"] or ()) if model == "prony" else partial["rheology.modulus_ratio"] or 1.0


RULES: tuple[Callable[[PartialScene], Iterator[Problem]], ...] = (
    punch_keys,
    rheology_keys,
    adhesion_keys,
    law_can_be_read,
    punch_fits_the_cell,
    free_punch_has_room,
    curvature_has_an_axis,
    punch_covers_grid_points,
    wavelength_is_resolved,
    sinusoid_is_periodic,
    rough_face_has_one_size,
    rough_waves_fit,
    rough_period_fits,
    map_has_a_unit_of_length,
    substrate_is_of_one_kind,
    prony_series_is_sound,
    geometric_times_are_finite,
    inertia_is_given,
    scheme_has_the_boundary,
    scheme_has_the_precision,
    scheme_has_the_machine,
    *PROGRAMME_RULES,
    single_precision_is_enough,
    springs_are_not_single,
)


def check(partial: PartialScene, require_files: bool = True) -> list[Problem]:
    """All problems that the rules find in a scene; those about files only if `require_files`."""
    problems: list[Problem] = []
    for rule in (*RULES, paths_can_be_used, followed_files_can_be_read) if require_files else RULES:
        try:
            problems.extend(rule(partial))
        except Unread:
            continue
    return problems
