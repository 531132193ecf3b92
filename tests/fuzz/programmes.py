"""Programmes of steps in the place of the short form of [drive]."""

from __future__ import annotations

from typing import Any

from pgfmd.scene.programme_section import ALSO, STEPS

from .draw import Draw, Mapping, Natural

SHORT_FORM = ("speed", "preload", "retract_speed", "dwell", "control", "turn_time")


def use_steps(draw: Draw, scene: Mapping, natural: Natural) -> None:
    """Replaces the tack test of a scene by some steps of about its speed and preload, mostly in an order that makes sense."""
    drive = scene["drive"]
    speed, preload = (
        float(drive[name].split()[0]) / natural.unit(of) for name, of in (("speed", "speed"), ("preload", "force"))
    )
    controls_load = drive.get("control") == "load"
    for name in SHORT_FORM:
        drive.pop(name, None)
    steps = [{"do": "approach", "speed": natural.quantity(speed, "speed"), "until": natural.quantity(preload, "force")}]
    kinds = [kind for kind in STEPS if kind != "follow" and (controls_load or kind != "ramp")]
    steps += [
        _step(draw, draw.choice(kinds), speed, preload, natural, controls_load)
        for _ in range(draw.choice([0, 1, 2, 4]))
    ]
    steps.append({"do": "retract", "speed": natural.quantity(speed, "speed")})
    if draw.chance(0.1):
        # A key too many, or one too few.
        step = draw.choice(steps)
        step.update({"amplitude": "1 V"}) if draw.chance(0.5) else step.pop(draw.choice(list(step)))
    drive["step"] = steps
    if draw.chance(0.4):
        drive["repeat"] = {"times": draw.choice([1, 2, 3, 1000]), "first": draw.choice([1, 1, 2])}


def _step(draw: Draw, kind: str, speed: float, preload: float, natural: Natural, controls_load: bool) -> dict[str, Any]:
    """A step of this kind with the keys that it needs, and one end."""
    travel, time = 0.1 * preload, 0.1 * preload / speed
    values: dict[str, Any] = {
        "speed": natural.quantity(speed, "speed"),
        "rate": natural.quantity(draw.choice([-1, 1]) * preload * speed, "force rate"),
        "of": draw.choice(["displacement", "load"] if controls_load else ["displacement"]),
        "amplitude": natural.quantity(1e-2 * travel, "length"),
        "frequency": natural.quantity(1 / time, "frequency"),
        "cycles": draw.choice([1, 2.5]),
    }
    required, optional = STEPS[kind]
    step = {"do": kind} | {name: values[name] for name in sorted(required)}
    if kind == "hold":
        step["of"] = values["of"]
    if "until" in optional:
        end = draw.choice(["until", "to", *ALSO, "duration"] if "to" in optional else [*ALSO, "duration"])
        ends = {
            "until": draw.choice([natural.quantity(draw.choice([-0.1, 0.5]) * preload, "force"), natural.quantity(travel, "length")]),
            "to": natural.quantity(draw.choice([-1, 1]) * travel, "length"),
        }  # fmt: skip
        step[end] = ends.get(end, natural.quantity(time, "time"))
    return step
