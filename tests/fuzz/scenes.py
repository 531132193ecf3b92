"""Plausible scenes: physically consistent, over many decades of scales, every pattern, substrate, rheology and scheme.

A scene is made in natural units, a length (the punch's radius), a modulus (E*) and a time, and everything in it is a
ratio of these. Keys that this module does not know get values that their declarations allow, now and then.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

from pgfmd.scene.model import ADHESION, PATTERNS, RHEOLOGIES
from pgfmd.units import parse_quantity

from .declarations import KEYS
from .draw import Draw, Mapping, Natural, as_toml, legal, written
from .files import COMPLIANCE, LAW, MAPS, WHOLE
from .mutations import mutate
from .programmes import use_steps

SIZES = (4, 5, 7, 8, 9, 11, 12, 13, 16, 17, 20, 24, 31, 32)
POISSON_RATIOS = (0.0, 0.5, -0.5, 0.3, 0.495, 0.4999999, -0.999)
"""Poisson's ratios that are asked for more than others."""


@dataclass(frozen=True)
class Made:
    """A scene: what it holds, the units it was made in, and what it follows from."""

    seed: int
    index: int
    kind: str
    scene: Mapping
    natural: Natural

    @property
    def text(self) -> str:
        return as_toml(self.scene)

    @property
    def name(self) -> str:
        return f"{self.kind}-{self.seed}-{self.index}"


def make(seed: int, index: int, kind: str) -> Made:
    """Scene number `index` of a seed. kind: "check", mostly mutated; "run", a few; "relate", plausible ones alone."""
    draw = Draw(seed, index, kind)
    scene, natural = plausible(draw)
    if kind == "check":
        # By numbers of their own, so that the other scenes stay what they are.
        own = Draw(seed, index, "programme")
        if own.chance(0.25):
            use_steps(own, scene, natural)
        mutate(draw, scene, natural, draw.choice([0, 1, 1, 1, 2, 3, 6]))
    elif kind == "run" and draw.chance(0.2):
        mutate(draw, scene, natural, 1)
    elif kind == "run" and draw.chance(0.1):
        # Far from what the range of adhesion asks for.
        preload = float(scene["drive"]["preload"].split()[0])
        scene["drive"]["preload"] = written(preload * draw.log(1e-6, 1e2), "force")
    if kind != "check":
        _keep_small(scene)
    return Made(seed, index, kind, scene, natural)


def _keep_small(scene: Mapping) -> None:
    """Whatever was mutated, a run has a small grid and writes into the folder it is given."""
    grid, output = scene.get("grid"), scene.get("output")
    if isinstance(grid, dict) and isinstance(grid.get("n"), int) and grid["n"] > 48:
        grid["n"] = 16
    if isinstance(output, dict):
        output.pop("directory", None)


def plausible(draw: Draw) -> tuple[Mapping, Natural]:
    """A scene that should run, and the units it was made in."""
    usual = draw.chance(0.4)
    natural = Natural(375e-6, 2.65e6, 4e-4) if usual else Natural(
        draw.log(1e-9, 1e3), draw.log(1e-3, 1e12), draw.log(1e-9, 1e6)
    )  # fmt: skip
    length, n = draw.choice([4.0, 4.0, 4.0, 2.0, 2.5, 3.0, 8.0]), draw.choice(SIZES)
    free = draw.chance(0.2)
    length = max(length, 4.0) if free else length
    n = max(n, math.ceil(length * (1 + 1e-9)) + 1)
    scene: Mapping = {"grid": {"n": n, "length": natural.quantity(length, "length")}}
    scene["solver"] = _solver(draw)
    scheme = scene["solver"]["scheme"]
    free &= scheme != "gfmd"
    scene["punch"] = _punch(draw, natural, length, n, free)
    scene["substrate"] = _substrate(draw, natural, free)
    if scene["substrate"].get("compliance_file"):
        natural = Natural(natural.length, 2.65e6, natural.time)
        scene["substrate"]["youngs_modulus"] = natural.quantity(0.75, "modulus")
    scene["rheology"] = _rheology(draw, natural, single=scene["solver"].get("precision") == "single")
    _say_reference(scene)
    reach = (length / n) * draw.choice([0.05, 0.05, draw.log(1e-2, 1.0)])
    scene["adhesion"] = _adhesion(draw, natural, length / n, reach)
    scene["drive"] = _drive(draw, natural, reach, scheme)
    scene["output"] = _output(draw)
    if scheme == "gfmd":
        _explicit(draw, scene, natural, reach)
    elif scene["solver"]["scheme"] == "quasistatic" and draw.chance(0.4):
        _machine(draw, scene, natural)
    _extra_keys(draw, scene, natural)
    return scene, natural


def _punch(draw: Draw, natural: Natural, length: float, n: int, free: bool) -> dict:
    """A face: relief of about a hundredth of the radius."""

    def unit(ratio: float) -> str:
        return natural.quantity(ratio, "length")

    pattern = draw.choice(tuple(PATTERNS))
    required, optional = PATTERNS[pattern]
    relief = draw.choice([0.0107, draw.log(1e-4, 0.1)])
    wave = max(draw.choice([0.4, 1.0, 2.0, 5.0]), 2.1 * length / n)
    filled = not free and "radius" not in required and draw.chance(0.5)
    punch = {"pattern": pattern}
    if not filled:
        punch["radius"] = unit(1.0)
    if "amplitude" in required:
        whole = length / min(draw.choice([1, 2, 3]), n // 2)
        punch |= {"wavelength": unit(whole if filled and pattern == "sinusoid" else wave), "amplitude": unit(relief)}
    if "exponent" in required:
        punch["exponent"] = draw.choice([1.0001, 1.5, 2.0, 4.0, 20.0])
    if "file" in required:
        punch["file"] = draw.choice(MAPS)
        if punch["file"] != "level.npz" or draw.chance(0.5):
            punch["file_size"] = [unit(length), unit(length)]
        punch["file_peaks"] = draw.choice(["up", "down"])
        punch["file_unit"] = unit(0.1 * relief) if punch["file"] == WHOLE else "m"
        if draw.chance(0.2):
            punch["file_detrend"] = draw.choice(["tilt", "curvature"])
        if draw.chance(0.3):
            punch["file_relief"] = unit(relief * draw.log(1e-2, 1))
    if "hurst" in required:
        punch |= _waves(draw, natural, length, n, relief)
    if "curvature_radius" in required or ("curvature_radius" in optional and not filled and draw.chance(0.2)):
        punch["curvature_radius"] = unit(draw.log(1, 1e4))
    if draw.chance(0.15):
        punch["layer_step"] = unit(relief * draw.choice([0.1, 1, 3]))
    if "height_jitter" in optional and draw.chance(0.25):
        punch |= {"height_jitter": unit(relief * draw.choice([0.1, 1])), "seed": draw.choice([0, 1, 2**63 - 1])}
    return punch


def _waves(draw: Draw, natural: Natural, length: float, n: int, relief: float) -> dict:
    """A random face: its spectrum from two grid points on up to the cell."""
    shortest = min(draw.choice([2.1, 4.0, 8.0]) * length / n, length)
    longest = shortest * (length / shortest) ** draw.choice([1.0, 1.0, 0.5])
    punch = {
        "hurst": draw.choice([0.8, 1.0, 0.5, 0.1]),
        "longest": natural.quantity(longest, "length"),
        "shortest": natural.quantity(shortest, "length"),
        "seed": draw.choice([0, 1, 2**63 - 1]),
    }
    if draw.chance(0.5):
        punch["rms_height"] = natural.quantity(0.3 * relief, "length")
    else:
        punch["rms_slope"] = draw.choice([0.01, 0.1])
    if draw.chance(0.3):
        punch["roll_off"] = natural.quantity(math.sqrt(longest * shortest), "length")
    return punch


def _substrate(draw: Draw, natural: Natural, free: bool) -> dict:
    ratio = draw.choice([*POISSON_RATIOS, draw.uniform(-0.99, 0.5)])
    substrate = {"youngs_modulus": natural.quantity(1 - ratio**2, "modulus"), "poisson_ratio": ratio}
    if free:
        substrate["boundary"] = "free"
    if draw.chance(0.25):
        substrate["thickness"] = natural.quantity(draw.log(1e-1, 1e3), "length")
        if draw.chance(0.7):
            substrate["base"] = draw.choice(["bonded", "sliding"])
    elif not free and draw.chance(0.15):
        substrate["prestrain"] = [draw.choice([1.0, 0.5, 3.0, 0.1]), draw.choice([1.0, 2.0])]
    elif not free and draw.chance(0.1):
        substrate |= {"compliance_file": COMPLIANCE, "poisson_ratio": 0.5}
    return substrate


def _rheology(draw: Draw, natural: Natural, single: bool) -> dict:
    """single: precision allows no large ratio of moduli."""
    model = draw.choice(tuple(RHEOLOGIES))
    rheology, most = {"model": model}, 50.0 if single else 1e6
    if model in ("single", "geometric"):
        ratio = min(most, draw.choice([250.0, 1.0001, 2.0, 1e3, draw.log(1.01, 1e6)]))
        rheology |= {"modulus_ratio": ratio, "relaxation_time": natural.quantity(1, "time")}
    if model == "geometric":
        rheology |= {
            "elements": draw.choice([1, 2, 5, 12]),
            "time_ratio": draw.choice([1.5, 3.0, 10.0]),
            "exponent": draw.choice([0.0, 0.5, 1.0, 2.0]),
        }
    if model == "prony":
        count = draw.choice([1, 2, 3, 6])
        share = most / count
        rheology["kappa"] = [min(share, draw.choice([0.0, 1.0, 30.0, draw.log(1e-3, 1e4)])) for _ in range(count)]
        if not any(rheology["kappa"]):
            rheology["kappa"][0] = 1.0
        rheology["tau"] = [natural.quantity(draw.log(1e-1, 1e3), "time") for _ in range(count)]
    return rheology


def _say_reference(scene: Mapping) -> None:
    """Of some series the modulus of which the weights are shares; the same elastomer, by a generator of its own."""
    rheology, substrate = scene["rheology"], scene["substrate"]
    if rheology["model"] != "prony":
        return
    draw, total = Draw("reference", *rheology["tau"]), 1.0 + sum(rheology["kappa"])
    if draw.chance(0.3):
        rheology["reference"] = "relaxed"
    elif draw.chance(0.5) and total < 1e5 and "compliance_file" not in substrate:
        static = parse_quantity(substrate["youngs_modulus"], "modulus")
        rheology |= {"reference": "instantaneous", "kappa": [weight / total for weight in rheology["kappa"]]}
        substrate["youngs_modulus"] = written(static * total, "modulus")


def _adhesion(draw: Draw, natural: Natural, spacing: float, reach: float) -> dict:
    """A work of adhesion by which the automatic range is `reach`, both in natural units."""
    gamma = reach**2 * (2 / math.pi**2) * 0.156 * 2 * math.pi / spacing
    adhesion = {"work_of_adhesion": natural.quantity(gamma, "energy per area")}
    if draw.chance(0.25):
        adhesion["range"] = natural.quantity(reach * draw.log(0.5, 10), "length")
    elif draw.chance(0.2):
        adhesion["range_factor"] = draw.choice([0.05, 0.5])
    elif draw.chance(0.1):
        adhesion["q_ref"] = natural.quantity(math.pi / spacing, "wavenumber")
    if draw.chance(0.15):
        adhesion["law"] = "repulsive"
    elif not hash_of(adhesion) % 6:
        # By numbers of its own, so that scenes of other laws stay what they were.
        own = Draw("law", *adhesion.values())
        adhesion["law"] = own.choice([name for name in ADHESION if "file" not in ADHESION[name][0]])
        if own.chance(0.3):
            # A law of a file is as strong and as wide as the scene asks for.
            adhesion = {"range": "auto", **adhesion, "law": "table", "file": LAW}
        optional = ADHESION[adhesion["law"]][1]
        if "smoothing" in optional and own.chance(0.5):
            adhesion["smoothing"] = own.choice([0.05, 0.4, 0.8])
        if "overlap_stiffness" in optional and own.chance(0.3):
            stiffest = 0.156 * 2 * math.pi / spacing
            adhesion["overlap_stiffness"] = natural.quantity(stiffest * own.log(0.3, 10), "stiffness per area")
    return adhesion


def hash_of(table: dict) -> int:
    """A number that follows from a table, on every machine."""
    return zlib.crc32(repr(table).encode())


def _drive(draw: Draw, natural: Natural, reach: float, scheme: str) -> dict:
    """A programme that presses by a few ranges of adhesion, at a rate that meets the relaxation or does not."""
    # Explicit steps are a twentieth of the relaxation time, or shorter.
    speed = reach * (draw.log(1e-3, 1e3) if scheme != "gfmd" else draw.log(0.1, 3))
    drive = {
        "speed": natural.quantity(speed, "speed"),
        "preload": natural.quantity(2 * reach * draw.log(0.1, 10), "force"),
    }
    passing = reach / speed
    if draw.chance(0.3):
        drive["retract_speed"] = natural.quantity(speed * draw.log(0.1, 10), "speed")
    if draw.chance(0.25):
        drive["dwell"] = natural.quantity(draw.choice([1.0, passing * draw.log(1e-2, 1e2)]), "time")
    if draw.chance(0.15):
        drive["turn_time"] = natural.quantity(passing * draw.log(1e-3, 1), "time")
    if draw.chance(0.2):
        lowest = 1.0 if scheme == "gfmd" else -0.5
        drive["clearance"] = natural.quantity(reach * max(lowest, draw.choice([-0.5, 0.0, 0.3, 1.0, 5.0])), "length")
    return drive


def _solver(draw: Draw) -> dict:
    scheme = draw.choice(["inertialess", "inertialess", "quasistatic", "quasistatic", "gfmd"])
    solver: dict = {"scheme": scheme, "max_steps": 4_000 if scheme == "gfmd" else 2_000}
    if scheme == "inertialess" and draw.chance(0.25):
        solver["order"] = 1
    if scheme == "quasistatic" and draw.chance(0.25):
        solver["modulus"] = "instantaneous"
    if scheme != "gfmd":
        solver["precision"] = draw.choice(["double", "double", "mixed", "single"])
        solver["accuracy"] = draw.choice([0.01, 0.03, 0.1, 0.3] + [1e-3] * (solver["precision"] != "single"))
    if draw.chance(0.1):
        solver["max_steps"] = draw.choice([1, 2, 7])
    return solver


def _machine(draw: Draw, scene: Mapping, natural: Natural) -> None:
    """A spring, or load control."""
    soft = scene["solver"]["precision"] == "single"
    scene["solver"]["precision"] = "double" if soft else scene["solver"]["precision"]
    if draw.chance(0.6):
        scene["drive"]["machine_stiffness"] = natural.quantity(2 * draw.log(1e-3, 1e3), "stiffness")
    else:
        scene["drive"]["control"], scene["solver"]["precision"] = "load", "double"


def _explicit(draw: Draw, scene: Mapping, natural: Natural, reach: float) -> None:
    """Steps of the scheme gfmd: its own rule, or a frequency and a step that are given."""
    speed = float(scene["drive"]["speed"].split()[0]) / natural.unit("speed")
    if scene["rheology"]["model"] == "elastic" or draw.chance(0.2):
        step = reach / speed * 0.01
        scene["solver.gfmd"] = {
            "omega": natural.quantity(0.3 / step, "angular frequency"),
            "dt": natural.quantity(step, "time"),
        }
    elif draw.chance(0.3):
        scene["solver.gfmd"] = {
            "omega_tau": draw.choice([6.28, 3.0]),
            "steps_per_tau": draw.choice([20.0, 100.0]),
            "fast_pull": draw.choice([0.01, 0.1]),
        }


def _output(draw: Draw) -> dict:
    output: dict = {}
    if draw.chance(0.4):
        output["snapshots"] = [draw.choice(["0.5 t_pl", "1.0 t_pl", "1.5 t_pl", "0 s", "3 t_pl"])
                               for _ in range(draw.choice([1, 2, 3]))]  # fmt: skip
    if draw.chance(0.25):
        output["every"] = draw.choice([2, 7, 1000])
    for name in ("surface", "energy", "patches"):
        if draw.chance(0.2):
            output[name] = draw.chance(0.5)
    return output


TITLES = ("", "a title", 'with "quotes" and \\', "Größe µm ∞")
KNOWN = {
    "punch": "pattern radius wavelength amplitude exponent file file_size file_unit file_peaks file_detrend file_missing "
    "file_missing_value file_relief curvature_radius layer_step height_jitter seed hurst rms_height rms_slope longest shortest "
    "roll_off period",
    "substrate": "youngs_modulus poisson_ratio boundary thickness base prestrain compliance_file",
    "rheology": "model modulus_ratio relaxation_time elements time_ratio exponent kappa tau reference",
    "adhesion": "law work_of_adhesion range range_factor q_ref smoothing overlap_stiffness file",
    "drive": "speed preload retract_speed dwell control machine_stiffness turn_time clearance",
    "grid": "n length",
    "solver": "scheme modulus accuracy order precision max_steps",
    "solver.gfmd": "omega_tau steps_per_tau fast_pull omega dt",
    "output": "directory snapshots every surface energy patches",
}
"""By section, the keys that are given here, or left out, with thought for the others."""


def _extra_keys(draw: Draw, scene: Mapping, natural: Natural) -> None:
    """A title, and keys that pgfmd has learnt since this module was written."""
    if draw.chance(0.2):
        scene["title"] = draw.choice(TITLES)
    for key in KEYS.values():
        if key.name not in KNOWN.get(key.section, "").split() and (key.required or draw.chance(0.15)):
            scene.setdefault(key.section, {})[key.name] = legal(draw, key, natural)
