"""A scheme that pgfmd does not have: what one has to write to add it. A spring and a dashpot, stepped explicitly."""

from pgfmd.schemes.entry import SchemeEntry

ENTRY = SchemeEntry(
    name="kelvin-voigt",
    meaning="a spring beside a dashpot, by explicit steps of first order",
    explicit=True,
    jumps=False,
    precisions=("double",),
    only_double="the scheme kelvin-voigt has no other",
    periodic_only="the scheme kelvin-voigt knows the longest stable step of a cell alone",
    unread={"solver.order": "it is of order 1", "solver.coarse_grid": "it solves nothing"},
    build="tests.unit.kelvin_voigt.plugin:build",
    memory="tests.unit.kelvin_voigt.plugin:memory",
    effort="tests.unit.kelvin_voigt.plugin:effort",
    steps_left="tests.unit.kelvin_voigt.plugin:steps_left",
    numerics="tests.unit.kelvin_voigt.plugin:numerics",
    warm_up="tests.unit.kelvin_voigt.plugin:warm_up",
)
