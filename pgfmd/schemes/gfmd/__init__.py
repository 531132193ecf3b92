"""The paper's explicit scheme: every mode of the surface is a mass on springs and dashpots."""

from pgfmd.schemes.entry import SchemeEntry

ENTRY = SchemeEntry(
    name="gfmd",
    meaning="the paper's explicit scheme",
    explicit=True,
    whole_plane=True,
    inertia=True,
    jumps=False,
    section="solver.gfmd",
    precisions=("double",),
    only_double="the scheme gfmd has no other",
    periodic_only="the scheme gfmd steps its modes",
    whole_only="the scheme gfmd steps the modes of the whole cell",
    # Explicit steps can't be coarse.
    ahead="inertialess",
    unread={"solver.accuracy": "its steps are those of [solver.gfmd]", "solver.order": "it is of order 2"},
    build="pgfmd.schemes.gfmd.plugin:build",
    memory="pgfmd.schemes.gfmd.plugin:memory",
    effort="pgfmd.schemes.gfmd.plugin:effort",
    steps_left="pgfmd.schemes.gfmd.plugin:steps_left",
    numerics="pgfmd.schemes.gfmd.plugin:numerics",
    warm_up="pgfmd.schemes.gfmd.plugin:warm_up",
    problems="pgfmd.schemes.gfmd.plugin:problems",
    lines="pgfmd.schemes.gfmd.plugin:lines",
    remarks="pgfmd.schemes.gfmd.plugin:remarks",
)
