"""Runs the studies behind the figures of docs/evidence/paper.md, draws the figures, and writes their numbers into the page.

    python -m scripts.studies.paper.run --size quick                    everything on small grids, into out/paper-quick
    python -m scripts.studies.paper.run tri hex --ranks 2               two figures at the reduced size
    python -m scripts.studies.paper.run --size paper contact --jobs 2   the paper's grids: hours
    python -m scripts.studies.paper.run --list --size paper             the figures and their runs
    python -m scripts.studies.paper.run --draw-only                     figures and page from what is there

Results are in out/paper-<size>/<study>/<case>; a run that several figures need is made once. What is finished is left
as it is, what was stopped goes on. Figures, numbers.csv and the page are those of docs, but at the size `quick`. A
picture whose runs are not all there any more stays; of its numbers, those that count contact are made again from the
runs that are there.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from matplotlib import rc_context

from pgfmd.commands.study import say
from pgfmd.errors import PgfmdError, SceneError
from pgfmd.files.storage import RUN_FILE, SCENE_FILE
from pgfmd.forecast.effort import effort_of
from pgfmd.physics.drive import DETACHED
from pgfmd.plots.drawing import STYLE
from pgfmd.scene import load_scene
from pgfmd.studies.campaign import Campaign, Unfinished, Wishes

from ..pages import ROOT, fill
from . import page
from .drawing import settings_of
from .pool import SIZES, Entry, Pool, Run
from .registry import FIGURES, STUDIES


def arguments(texts: list[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("figures", nargs="*", metavar="FIGURE", help="names of figures; all if none is given")
    parser.add_argument("--size", choices=SIZES, default="reduced", help="size of the grids")
    parser.add_argument("--ranks", type=int, default=1, help="MPI ranks of a run")
    parser.add_argument("--jobs", type=int, default=1, help="runs side by side")
    parser.add_argument("--only", action="append", default=[], metavar="RUN", help="only STUDY/CASE; * is anything")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="extra", help="for every run")
    parser.add_argument("--out", type=Path, help="folder of the results; out/paper-<size> unless said otherwise")
    parser.add_argument("--list", action="store_true", help="show the figures and the runs of each")
    parser.add_argument("--draw-only", action="store_true", help="start no run")
    parser.add_argument("--retry", action="store_true", help="go on with failed runs, too")
    parser.add_argument("--fresh", action="store_true", help="begin changed and damaged runs anew")
    found = parser.parse_args(texts)
    unknown = [name for name in found.figures if name not in FIGURES]
    if unknown:
        parser.error(f"no figure {', '.join(unknown)}; choose from {', '.join(FIGURES)}")
    if found.extra and not found.out:
        parser.error("--set needs an --out of its own")
    found.figures = found.figures or list(FIGURES)
    found.out = found.out or ROOT / "out" / f"paper-{found.size}"
    return found


def show(pool: Pool, names: list[str]) -> None:
    """Prints each figure, what it draws, and its runs."""
    for name in names:
        figure = FIGURES[name]
        of = f"FIG {figure.of}: " if figure.of else ""
        print(f"{name}: {of}{figure.draw.__doc__.splitlines()[0]}")
        for entry in pool.chosen(figure.studies):
            own = [user for user in entry.users if user.partition("/")[0] in figure.studies]
            run = Run("", "", entry.case().scene, Path())
            shared = "" if entry.owner in own else f"  (is {entry.owner})"
            print(f"    {own[0]}{shared}: {run.preload:g} mN, {run.speed:g} um/s, {settings_of(run)}")


def complete_of(campaign: Campaign) -> set[str]:
    """The names of the runs that are complete and of the scenes of their cases, whichever version has made them."""
    found = set()
    for case in campaign.cases:
        folder = campaign.folder(case)
        try:
            record = json.loads((folder / RUN_FILE).read_text(encoding="utf-8"))
            scene = load_scene(folder / SCENE_FILE)
        except (OSError, ValueError, SceneError):
            # Not begun, still under way, or written by a version that had other keys.
            continue
        told = {"title": "", "output": case.scene.output}
        same = scene.model_copy(update=told).to_toml() == case.scene.model_copy(update=told).to_toml()
        if same and record.get("finished") == DETACHED:
            found.add(case.name)
    return found


def told_of(missing: list[Entry], total: int) -> str:
    """About runs that are not there: which of how many they are, and what they are expected to cost."""
    if not missing:
        return ""
    efforts = [effort_of(entry.case().scene) for entry in missing]
    pairs, hours = sum(each.pairs for each in efforts), sum(each.seconds for each in efforts) / 3600
    time = f"{hours:.1g} h" if hours >= 0.1 else f"{max(60 * hours, 1):.0f} min"
    names = ", ".join(f"`{entry.owner}`" for entry in missing)
    if len(missing) > 4:
        names = f"{len(missing)} of {total} runs"
    spread = max(each.spread for each in efforts)
    return f"{names}; expected: {pairs:.1g} transform pairs, {time} on one rank, within a factor of {spread:.2g}"


def draw(name: str, pool: Pool, out: Path, finished: set[str], folder: Path) -> bool:
    """Draws a figure from the finished runs into the folder; tells why not where there are too few.

    Where runs of an earlier drawing are not there any more, its picture and its numbers stay, but those of contact that
    the runs that are there have counted.
    """
    figure = FIGURES[name]
    runs = pool.runs(figure.studies, out, finished)
    chosen = pool.chosen(figure.studies)
    known = set(page.read_runs(folder).get(f"{name}-{pool.size}", ()))
    lost = known - {f"{run.study}/{run.name}" for run in runs}
    # Those of an earlier drawing are not missed: what they gave is kept.
    there = [entry for entry in chosen if entry.owner in finished or known & set(entry.users)]
    missing = told_of([entry for entry in chosen if entry not in there], len(chosen))
    drawing = None
    try:
        if figure.studies and not runs:
            raise LookupError("none of its runs is finished")
        with rc_context(STYLE):
            drawing = figure.draw(runs)
            path = folder / f"{name}-{pool.size}.png"
            if not lost:
                # The reduced metadata leave the file the same from run to run.
                drawing.figure.savefig(path, dpi=120, metadata={"Software": None})
    except LookupError as error:
        say(f"{name}: not drawn: {error}" if not lost else f"{name}: left as it is: {error}")
    finally:
        for run in runs:
            if "results" in run.__dict__:
                run.results.close()
    if lost:
        page.recount(folder, pool.size, name, drawing, FIGURES, missing)
    else:
        page.keep(folder, pool.size, name, drawing, FIGURES, missing, {f"{run.study}/{run.name}" for run in runs})
    if not drawing:
        return False
    if lost:
        say(f"{name}: left as it is but for the count of contact, since {len(lost)} of its runs are not there any more")
    else:
        say(f"{path}" + (f", without {missing}" if missing else ""))
    for claim in drawing.claims:
        told = f"   paper: {claim.told}" if claim.told else ""
        say(f"    {claim.what}, {claim.settings}: {claim.ours:.4g} {claim.unit}{told}")
    return True


def main(texts: list[str] | None = None) -> int:
    """Runs and draws; returns the exit code."""
    wanted = arguments(texts)
    pool = Pool(STUDIES, wanted.size, wanted.extra)
    if wanted.list:
        show(pool, wanted.figures)
        return 0
    studies = tuple(study for name in wanted.figures for study in FIGURES[name].studies)
    cases = [entry.case(wanted.ranks) for entry in pool.chosen(studies)]
    campaign = Campaign(cases, wanted.out, Wishes(wanted.retry, wanted.fresh), say)
    code = 0
    if cases and not wanted.draw_only:
        try:
            campaign.only(wanted.only).run(wanted.ranks, wanted.jobs)
        except Unfinished as error:
            say(str(error))
            code = error.exit_code
    finished = complete_of(campaign)
    # What an extra key has changed is nothing for the documentation either.
    in_docs = wanted.size in page.SHOWN and not wanted.extra
    folder = page.FOLDER if in_docs else wanted.out / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    for name in wanted.figures:
        draw(name, pool, wanted.out, finished, folder)
    if in_docs:
        fill(page.PAGE, "figure", lambda name: page.block(name, folder))
        fill(page.PAGE, "count", lambda name: page.counts_block(folder, FIGURES))
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except PgfmdError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
