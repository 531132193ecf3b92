"""Maps of the contact: on the way back from the triangular pattern, on the way in with the hexagonal one."""

from __future__ import annotations

from typing import Any

import numpy as np

from paper.cell import fractions
from paper.drawing import (
    NAN,
    Claim,
    Drawing,
    closed_at,
    in_contact,
    joins,
    near,
    new_figure,
    percent,
    settings_of,
    times_of,
)
from paper.pool import Run, Runs
from pgfmd.analysis.bulges import bulges
from pgfmd.plots.maps import CONTACT_LEVEL, GREYS, MOST_PIXELS, NEAR_LEVEL, robust_limit

TRI_COLUMNS = (1.0, 1.125, 1.25)
LAST = "distance from the axis of the last third of saddles, over all"
HEX_COLUMNS = (0.1, 0.2, 0.4, 0.6, 0.8, 1.0)


def draw_maps(rows: list[tuple[str, Run, list[int], str]]) -> Any:
    """A figure of maps: for each row its name, run, snapshots, and "gap" or "traction"."""
    from cmcrameri import cm
    from matplotlib.colors import BoundaryNorm, ListedColormap

    columns = max(len(frames) for _, _, frames, _ in rows)
    figure = new_figure(1.25 * columns + 1.0, 1.5 * len(rows) + 0.5)
    axes = figure.subplots(len(rows), columns, squeeze=False)
    # Contact, near, open: the paper's greys; nothing outside of the punch.
    greys = {"cmap": ListedColormap(GREYS), "norm": BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3)}
    for line, (name, run, frames, what) in zip(axes, rows, strict=True):
        arrays = {frame: _thin(run.results.frame(what, frame)) for frame in frames}
        limit, _ = robust_limit(arrays.values()) if what == "traction" else (0.0, False)
        image = None
        for axis, (frame, values) in zip(line, arrays.items(), strict=False):
            if what == "gap":
                values = np.where(np.isnan(values), np.nan, 1.0 * (values >= CONTACT_LEVEL) + (values >= NEAR_LEVEL))
                axis.imshow(np.ma.masked_invalid(values), origin="lower", interpolation="nearest", **greys)
            else:
                image = axis.imshow(1e-3 * values, origin="lower", cmap=cm.vik, vmin=-1e-3 * limit, vmax=1e-3 * limit)
            force = 1e3 * float(run.results.fields["force"][frame])
            axis.set_title(f"{fractions(run)[frame]:.4g} t_pl\n{force:.3g} mN".replace("-", "−"), fontsize=7)
        for axis in line:
            axis.set_axis_off()
        line[0].text(-0.08, 0.5, name, transform=line[0].transAxes, rotation=90, va="center", ha="right", fontsize=7.5)
        if image is not None:
            figure.colorbar(image, ax=line, shrink=0.8, pad=0.01, label="traction (kPa)")
    return figure


def _thin(values: np.ndarray) -> np.ndarray:
    stride = -(-4 * values.shape[0] // MOST_PIXELS)
    return values[::stride, ::stride]


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
    """Contact on the way back from 40 mN with two parametrisations, and the stress of the default one: FIG tri1ums."""
    rows, claims = [], []
    for name in ("alternative", "default"):
        run = runs.one("contact", name)
        if run is None or "largest tension" not in run.results.labels:
            continue
        frames = list(dict.fromkeys([*nearest(run, TRI_COLUMNS), *around_bulge(run), tension(run)]))
        rows.append((f"{name}\n{_short(run)}", run, frames, "gap"))
        claims += _tri_claims(name, run)
    if not rows:
        raise LookupError("no run of the study contact has pulled off")
    rows.append(_stress(rows[-1]))
    note = "; ".join(f"{name}: {settings_of(runs.one('contact', name))}"
                     for name in ("alternative", "default") if runs.one("contact", name))  # fmt: skip
    caption = (
        f"Retraction from 40 mN at 1 µm/s. {note}. Dark: contact; medium: gap below 500 nm; light: open. "
        "Columns: 1, 1.125 and 1.25 t_pl, before and after most saddles let go, largest tension."
    )
    return Drawing(draw_maps(rows), caption, claims)


def _stress(row: tuple[str, Run, list[int], str]) -> tuple[str, Run, list[int], str]:
    name, run, frames, _ = row
    return name.partition("\n")[0] + "\nstress", run, frames, "traction"


def _short(run: Run) -> str:
    return settings_of(run).partition(", ")[2].replace(", ", "\n")


def _tri_claims(name: str, run: Run) -> list[Claim]:
    results, loop = run.results, run.loop
    times = times_of(results)
    start, later = nearest(run, TRI_COLUMNS[:2])
    sites = in_contact(results, times[start])
    saddles = joins(results, "saddle")
    radius = run.scene.punch.radius
    # The mean distance of all points of a disc is 2/3 a.
    distance = np.hypot(saddles["x [m]"], saddles["y [m]"])
    grown = _area(loop, times[later]) / _area(loop, times[start])
    pulled = in_contact(results, times[tension(run)])
    bulge = next((-1e6 * each.displacement for each in bulges(loop) if each.force > 0), NAN)
    at = 1e6 * loop.indentation[int(np.argmin(loop.force))]
    return [
        Claim("summits in contact at the preload", name, percent(sites["summit"]), "%", "all", 99.9, 100),
        Claim("saddles in contact at the preload", name, percent(sites["saddle"]), "%",
              "those near the rim", 1, 60),
        Claim("their mean distance from the axis", name, float(distance.mean()) / radius if distance.size else NAN, "a",
              "close to the rim", 0.75, 1.0),
        Claim("contact area at 1.125 t_pl over that at 1", name, grown, "", "grows slightly", 1.0, 1.3),
        Claim("area closer than 500 nm at 1.125 t_pl over that at 1", name,
              _near_area(run, later) / _near_area(run, start), "", "grows slightly", 1.0, 1.3),
        Claim("saddles in contact at the largest tension", name, pulled["saddle"][0], "", "0", 0, 0),
        Claim("summits in contact at the largest tension", name, percent(pulled["summit"]), "%",
              "all", 99.9, 100),
        Claim("indentation at the largest tension", name, at, "µm", "near −1", -1.5, -0.5),
        Claim("indentation at the bulge under pressure", name, bulge, "µm", "5 to 6", 5, 6),
    ]  # fmt: skip


def _near_area(run: Run, snapshot: int) -> float:
    return float(np.sum(run.results.frame("gap", snapshot) < NEAR_LEVEL))


def _area(loop: Any, time: float) -> float:
    return float(np.interp(time, loop.time, loop.area))


def hexagonal(runs: Runs) -> Drawing:
    """Contact on the way in, viscoelastic and quasi-static, with the stress of the latter: FIG hex1ums."""
    rows, claims = [], []
    for name in ("viscous", "quasistatic"):
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
        + ". Greys as above."
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


def jump_way(run: Run) -> float:
    """Way [um] from the first jump to the one after it, still on the way in, that releases most: that of the saddles.
    A saddle under tension has no negative gap and is no join."""
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


def _hex_claims(name: str, run: Run) -> list[Claim]:
    results = run.results
    frames = nearest(run, HEX_COLUMNS)
    early, pulled = (in_contact(results, times_of(results)[k]) for k in (frames[0], tension(run)))
    least, median = saddle_delays(run)
    seen = next((1e3 * float(results.fields["force"][k]) for k in frames if near(run, k, "saddle") > 99.9), NAN)
    # The paper's force is that of its viscous loops, its way that of the quasi-static one.
    told, about = (("0.7", 0.6, 0.8), ()) if run.quasistatic else ((), ("about 4", 3.5, 4.5))
    jump = [Claim("way from the jump of the summits to that of the saddles", name, jump_way(run), "µm", *told)]
    return [
        Claim("summits in contact in the first frame", name, percent(early["summit"]), "%", "all", 99.9, 100),
        *(jump if run.quasistatic else ()),
        Claim("way from summits to negative gap at the saddle between, least", name, least, "µm", *told),
        Claim("way from summits to negative gap at the saddle between, median", name, median, "µm", *told),
        Claim("force of the first map with all saddles closer than 500 nm", name, seen, "mN", *about),
        Claim("force at contact in all saddles", name, closed_at(results, "saddle"), "mN", *about),
        Claim(LAST, name, rim_last(run), "", "the rim comes last", 1.05, 2.0),
        Claim("saddles in contact at the largest tension", name, percent(pulled["saddle"]), "%",
              "most", 50, 100),
        Claim("saddles closer than 500 nm at the largest tension", name, near(run, tension(run), "saddle"), "%",
              "most", 50, 100),
    ]  # fmt: skip


def full(runs: Runs) -> Drawing:
    """Contact, overlap and near area of the triangular pattern on the way to 80 mN."""
    raise LookupError("under way")
