"""Maps of the contact: on the way back from the triangular pattern, on the way in with the hexagonal one."""

from __future__ import annotations

from typing import Any

import numpy as np

from pgfmd.analysis.bulges import bulges
from pgfmd.plots.maps import robust_limit

from .cell import fractions
from .drawing import (
    NAN,
    NEAR_LEVEL,
    Claim,
    Drawing,
    area_below,
    closed_at,
    count_of,
    draw_gaps,
    in_contact,
    joins,
    near,
    new_figure,
    percent,
    settings_of,
    shades_of,
    share_below,
    thin,
    times_of,
)
from .pool import Run, Runs

TRI_COLUMNS = (1.0, 1.125, 1.25)
LAST = "distance from the axis of the last third of saddles, over all"
NEARLY = 0.98
"""Share of the largest tension: the force has a flat minimum, over which saddle after saddle lets go."""
HEX_COLUMNS = (0.1, 0.2, 0.4, 0.6, 0.8, 1.0)


def draw_maps(rows: list[tuple[str, Run, list[int], str]]) -> Any:
    """A figure of maps: for each row its name, run, snapshots, and "gap" or "traction"."""
    from cmcrameri import cm

    columns = max(len(frames) for _, _, frames, _ in rows)
    figure = new_figure(1.25 * columns + 1.0, 1.5 * len(rows) + 0.5)
    axes = figure.subplots(len(rows), columns, squeeze=False)
    for line, (name, run, frames, what) in zip(axes, rows, strict=True):
        arrays = {frame: thin(run.results.frame("traction", frame)) for frame in frames if what == "traction"}
        limit, _ = robust_limit(arrays.values()) if arrays else (0.0, False)
        image = None
        for axis, frame in zip(line, frames, strict=False):
            if what == "gap":
                draw_gaps(axis, run, frame)
            else:
                values = arrays[frame]
                image = axis.imshow(1e-3 * values, origin="lower", cmap=cm.vik, vmin=-1e-3 * limit, vmax=1e-3 * limit)
            force = 1e3 * float(run.results.fields["force"][frame])
            axis.set_title(f"{fractions(run)[frame]:.4g} t_pl\n{force:.3g} mN".replace("-", "−"), fontsize=7)
        for axis in line:
            axis.set_axis_off()
        line[0].text(-0.08, 0.5, name, transform=line[0].transAxes, rotation=90, va="center", ha="right", fontsize=7.5)
        if image is not None:
            figure.colorbar(image, ax=line, shrink=0.8, pad=0.01, label="traction (kPa)")
    return figure


def nearest(run: Run, wanted: tuple[float, ...]) -> list[int]:
    """The snapshots nearest to these fractions of t_pl, each once."""
    return list(dict.fromkeys(int(np.argmin(np.abs(fractions(run) - value))) for value in wanted))


def around_bulge(run: Run) -> tuple[int, int]:
    """The snapshots before and after the one interval between snapshots in which most saddles let go."""
    times, labels = times_of(run.results), run.results.labels
    order = [k for k in np.argsort(times) if fractions(run)[k] > 1.2 and labels[k] != "largest tension"]
    saddles = [in_contact(run.results, times[k])["saddle"][0] for k in order]
    lost = -np.diff(saddles)
    at = int(np.argmax(lost)) if len(lost) else 0
    return int(order[at]), int(order[min(at + 1, len(order) - 1)])


def tension(run: Run) -> int:
    """The snapshot of the largest tension."""
    return run.results.labels.index("largest tension")


def tri(runs: Runs) -> Drawing:
    """Contact on the way back from 40 mN with two parametrisations and with curvature, and its stress: FIG tri1ums."""
    rows, claims, names = [], [], ("alternative", "default", "curved")
    for name in names:
        run = runs.one("contact", name)
        if run is None or "largest tension" not in run.results.labels:
            continue
        frames = list(dict.fromkeys([*nearest(run, TRI_COLUMNS), *around_bulge(run), tension(run)]))
        rows.append((f"{name}\n{_short(run)}", run, frames, "gap"))
        claims += _tri_claims(name, run)
    if not rows:
        raise LookupError("no run of the study contact has pulled off")
    rows.append(_stress(rows[-1]))
    note = "; ".join(f"{name}: {settings_of(run)}" for name in names if (run := runs.one("contact", name)))
    caption = (
        f"Retraction from 40 mN at 1 µm/s. {note}. {shades_of(runs)} "
        "Columns: 1, 1.125 and 1.25 t_pl, before and after most saddles let go, largest tension."
    )
    return Drawing(draw_maps(rows), caption, claims)


def _stress(row: tuple[str, Run, list[int], str]) -> tuple[str, Run, list[int], str]:
    name, run, frames, _ = row
    return name.partition("\n")[0] + "\nstress", run, frames, "traction"


def _short(run: Run) -> str:
    return settings_of(run).partition(", ")[2].replace(", ", "\n")


def _tri_claims(name: str, run: Run) -> list[Claim]:
    results, loop, count = run.results, run.loop, count_of(run)
    times = times_of(results)
    start, later = nearest(run, TRI_COLUMNS[:2])
    end = tension(run)
    sites, pulled = in_contact(results, times[start]), in_contact(results, times[end])
    saddles = joins(results, "saddle")
    # The mean distance of all points of a disc is 2/3 a.
    distance = np.hypot(saddles["x [m]"], saddles["y [m]"]) / run.scene.punch.radius
    mean = float(distance.mean()) if distance.size else NAN
    grown = float(np.divide(*np.interp(times[[later, start]], loop.time, loop.area)))
    bulge = next((-1e6 * each.displacement for each in bulges(loop) if each.force > 0), NAN)
    at = 1e6 * loop.indentation[int(np.argmin(loop.force))]
    held = 0.01 * share_below(run, end, "saddle", 0.0) * pulled["saddle"][1]
    return [
        Claim("summits in contact at the preload", name, percent(sites["summit"]), "%", "all", 99.9, 100, count,
              share_below(run, start, "summit", 0.0)),
        Claim("saddles in contact at the preload", name, percent(sites["saddle"]), "%", "those near the rim", 1, 60,
              count, share_below(run, start, "saddle", 0.0)),
        Claim("their mean distance from the axis", name, mean, "a", "close to the rim", 0.75, 1.0, count),
        Claim("contact area at 1.125 t_pl over that at 1", name, grown, "", "grows slightly", 1.0, 1.3, count,
              area_below(run, later, 0.0) / area_below(run, start, 0.0)),
        Claim("area closer than 500 nm at 1.125 t_pl over that at 1", name,
              area_below(run, later, NEAR_LEVEL) / area_below(run, start, NEAR_LEVEL), "", "grows slightly", 1.0, 1.3),
        Claim("saddles in contact at the largest tension", name, pulled["saddle"][0], "", "0", 0, 0, count, held),
        Claim("summits in contact at the largest tension", name, percent(pulled["summit"]), "%", "all", 99.9, 100,
              count, share_below(run, end, "summit", 0.0)),
        Claim("indentation at the largest tension", name, at, "µm", "near −1", -1.5, -0.5),
        Claim("indentation at the bulge under pressure", name, bulge, "µm", "5 to 6", 5, 6),
    ]  # fmt: skip


def hexagonal(runs: Runs) -> Drawing:
    """Contact on the way in, viscoelastic and quasi-static, with the stress of the latter: FIG hex1ums."""
    rows, claims = [], []
    for name in ("viscous", "quasistatic", "curved-viscous", "curved-quasistatic"):
        run = runs.one("approach", name)
        if run is None or "largest tension" not in run.results.labels:
            continue
        frames = [*nearest(run, HEX_COLUMNS), tension(run)]
        rows.append((f"{name}\n{_short(run)}", run, frames, "gap"))
        claims += _hex_claims(name, run)
    if not rows:
        raise LookupError("no run of the study approach has pulled off")
    rows.append(_stress(rows[-1]))
    caption = (
        "Approach at 1 µm/s, columns at fractions of t_pl, the last one at the largest tension of the retraction. "
        "Preload "
        + ", ".join(f"{name} {run.preload:g} mN" for name, run, _, what in _named(rows) if what == "gap")
        + ("; curved: a macroscopic curvature of 40 mm. " if runs.of("approach", "curved") else ". ")
        + shades_of(runs)
    )
    return Drawing(draw_maps(rows), caption, claims)


def _named(rows: list) -> list:
    return [(name.partition("\n")[0], run, frames, what) for name, run, frames, what in rows]


def saddle_delays(run: Run) -> tuple[float, float]:
    """Least and median way [um] of the punch from when two summits next to a saddle touch to when the saddle does."""
    results = run.results
    summits, saddles = joins(results, "summit"), joins(results, "saddle")
    if len(summits["site"]) < 2 or not len(saddles["site"]):
        return NAN, NAN
    apart = np.hypot(saddles["x [m]"][:, None] - summits["x [m]"], saddles["y [m]"][:, None] - summits["y [m]"])
    two = np.argsort(apart, axis=1)[:, :2]
    both = summits["displacement [m]"][two].min(axis=1)
    ways = 1e6 * (both - saddles["displacement [m]"])
    return float(ways.min()), float(np.median(ways))


def jump_travel(run: Run) -> float:
    """Way [um] from the first jump to the one after it, still on the way in, that releases most: that of the saddles.
    A second way to `saddle_delays`, which does without a count of contact."""
    events, loop = run.results.events, run.loop
    time, place = np.asarray(events["time [s]"]), np.asarray(events["displacement [m]"])
    released = np.asarray(events["released [J]"])
    rows = np.flatnonzero((np.asarray(events["event"]).astype(str) == "jump") & (time <= loop.time[loop.preload_row]))
    if len(rows) < 2:
        return NAN
    return 1e6 * float(place[rows[0]] - place[rows[1:][np.argmax(released[rows[1:]])]])


def rim_last(run: Run) -> float:
    """Mean distance from the axis of the last third of the saddles to touch, over that of all that touch."""
    saddles = joins(run.results, "saddle")
    distance = np.hypot(saddles["x [m]"], saddles["y [m]"])[np.argsort(-saddles["displacement [m]"], kind="stable")]
    return float(distance[-max(len(distance) // 3, 1) :].mean() / distance.mean()) if distance.size else NAN


def _nearly_pulled(run: Run) -> float:
    """Time [s] at which the way back reaches nearly its largest tension."""
    loop, rows = run.loop, run.loop.branches["retraction"]
    return float(loop.time[rows][np.flatnonzero(loop.force[rows] <= NEARLY * loop.force[rows].min())[0]])


def _hex_claims(name: str, run: Run) -> list[Claim]:
    results, count = run.results, count_of(run)
    frames, end = nearest(run, HEX_COLUMNS), tension(run)
    early, pulled = (in_contact(results, times_of(results)[k]) for k in (frames[0], end))
    least, median = saddle_delays(run)
    seen = next((1e3 * float(results.fields["force"][k]) for k in frames if near(run, k, "saddle") > 99.9), NAN)
    # The paper's force is that of its viscous loops, its way that of the quasi-static one.
    told, about = (("0.7", 0.6, 0.8), ()) if run.quasistatic else ((), ("about 4", 3.5, 4.5))
    jump = [Claim("travel from the jump of the summits to that of the saddles", name, jump_travel(run), "µm", *told)]
    travel = "travel from summits to contact at the saddle between"
    return [
        Claim("summits in contact in the first frame", name, percent(early["summit"]), "%", "all", 99.9, 100, count,
              share_below(run, frames[0], "summit", 0.0)),
        # Under a curved punch most of the jumps are those of single summits.
        *(jump if name == "quasistatic" else ()),
        Claim(f"{travel}, least", name, least, "µm", *told, count=count),
        Claim(f"{travel}, median", name, median, "µm", *told, count=count),
        Claim("force at contact in all summits", name, closed_at(results, "summit"), "mN", count=count),
        Claim("force of the first map with all saddles closer than 500 nm", name, seen, "mN", *about),
        Claim("force at contact in all saddles", name, closed_at(results, "saddle"), "mN", *about, count=count),
        Claim(LAST, name, rim_last(run), "", "the rim comes last", 1.05, 2.0, count),
        Claim("saddles in contact at the largest tension", name, percent(pulled["saddle"]), "%", "most", 50, 100, count,
              share_below(run, end, "saddle", 0.0)),
        Claim(f"saddles in contact when {100 * NEARLY:g} % of the largest tension is reached", name,
              percent(in_contact(results, _nearly_pulled(run))["saddle"]), "%", count=count),
        Claim("saddles closer than 500 nm at the largest tension", name, near(run, end, "saddle"), "%",
              "most", 50, 100),
    ]  # fmt: skip
