"""The entries of the gallery: what each picture shows, and the commands that make it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """A picture of the gallery.

    title: its heading, which is its address as well.
    scene: the shipped scene that it begins with.
    commands: lines for a shell, done in order.
    made: the file that they leave, whose picture is shown.
    caption: what is to be seen, with n.
    text: files that a reader writes first, name and content.
    """

    title: str
    scene: str
    commands: tuple[str, ...]
    made: str
    caption: str
    text: tuple[tuple[str, str], ...] = ()


DEMO = "pgfmd run tri-tack --out demo"
TACK = 'pgfmd run tri-tack grid.n=128 "drive.preload=10 mN" "drive.speed=10 um/s" "output.snapshots=[\'every 12 ms\']" --out tack'
TWIN = 'pgfmd run tri-tack grid.n=128 "drive.preload=10 mN" solver.scheme=quasistatic --out twin'
HEX = "pgfmd run hex-tack \"output.snapshots=['0.25 t_pl', '0.5 t_pl', '0.75 t_pl', '1.3 t_pl']\" --out hex"
ROUGH = (
    "pgfmd run rough-film grid.n=256 \"output.snapshots=['0.5 t_pl', '1.2 t_pl', '1.7 t_pl', '2.4 t_pl']\" --out rough"
)
CYCLES = "pgfmd run cyclic-hold grid.n=128 --out cycles"
SPHERE = 'pgfmd run sphere-tack grid.n=48 "adhesion.work_of_adhesion=80 mJ/m^2" --out stronger'
SPEEDS = """scene = "sphere-tack"
title = "Sphere, four speeds of retraction"

[set]
grid.n = 64

[axes]
drive.retract_speed = ["2 um/s", "10 um/s", "50 um/s", "250 um/s"]
"""

ENTRIES = {
    "curve": Entry(
        "Force curve",
        "tri-tack",
        (DEMO, "pgfmd plot demo"),
        "demo/force-displacement.png",
        "The tack test of the demo: 40 mN are pressed, 1.3 mN hold. The second panel magnifies the tension. n = 256.",
    ),
    "contact": Entry(
        "Contact maps",
        "hex-tack",
        (HEX, "pgfmd plot hex"),
        "hex/contact-maps.png",
        "A honeycomb of summits goes into contact, the saddles between them close, and at the largest tension only the summits hold. "
        "n = 256.",
    ),
    "stress": Entry(
        "Stress maps",
        "rough-film",
        (ROUGH, "pgfmd plot rough"),
        "rough/stress-maps.png",
        "Normal traction under a rough punch on a thin film, pressed in and pulled off: compression is blue, tension red, and what has "
        "come off grey. n = 256.",
    ),
    "movie": Entry(
        "Frame of a movie",
        "tri-tack",
        (
            TACK,
            "pgfmd movie tack --field gap --out tack.mp4",
            'python -c \'import pgfmd; pgfmd.plot_frame("tack", snapshot=80).savefig("frame.png")\'',
        ),
        "frame.png",
        "The gap under the punch while it is pulled off, and where that is on the force curve; the [first page](index.md) has the whole "
        "movie. n = 128.",
    ),
    "twin": Entry(
        "Comparison of runs",
        "tri-tack",
        (TACK, TWIN, "pgfmd compare tack twin --out compare.png"),
        "compare.png",
        "The same punch at 10 µm/s and at vanishing speed: what the loop loses there, it loses by jumps alone. n = 128.",
    ),
    "energy": Entry(
        "Energy audit",
        "tri-tack",
        (DEMO, "pgfmd plot demo"),
        "demo/energy.png",
        "Where the work of the punch is at each moment, and the part that the audit can't account for. n = 256.",
    ),
    "sites": Entry(
        "Summits and saddles",
        "hex-tack",
        (HEX, "pgfmd plot hex"),
        "hex/sites.png",
        "At which force each summit and saddle of the punch joins the contact, and leaves it. n = 256.",
    ),
    "cycles": Entry(
        "Cycles",
        "cyclic-hold",
        (CYCLES, "pgfmd plot cycles"),
        "cycles/cycles.png",
        "A programme of five cycles with a held load: the numbers of each cycle. n = 128.",
    ),
    "study": Entry(
        "A study of speeds",
        "sphere-tack",
        ("pgfmd study speeds.toml --out speeds", "pgfmd plot speeds --x retract_speed --y pull-off --log xy"),
        "speeds/pull-off-retract_speed.png",
        "Pull-off force of a viscoelastic sphere against the speed of retraction, with error bars. One file and one command make the "
        "four runs. n = 64.",
        (("speeds.toml", SPEEDS),),
    ),
    "punch": Entry(
        "A rough punch",
        "rough-film",
        ("pgfmd show rough-film --out punch.png",),
        "punch.png",
        "The face of a punch before any run: heights, profiles through the first contact, histogram. n = 400.",
    ),
    "fit": Entry(
        "A fit",
        "sphere-tack",
        (SPHERE, "pgfmd fit sphere-tack stronger/curve.csv grid.n=48 --free adhesion.work_of_adhesion --out fit"),
        "fit/fit.png",
        "The work of adhesion from a force curve. The curve stands in for a measured one: it is that of a run with 80 mJ/m², which the "
        "fit has to find from 50 mJ/m². n = 48.",
    ),
    "rheology": Entry(
        "An elastomer",
        "cyclic-hold",
        ("pgfmd plot-rheology cyclic-hold --out rheology.png",),
        "rheology.png",
        "Storage and loss modulus of the elastomer of a scene, and how its surface yields to a force; dashed, what the auxiliary masses of "
        "the paper's scheme make of that. Nothing is run.",
    ),
}
