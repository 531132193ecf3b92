"""The massless limit of the paper's model, by implicit steps of second order with an adaptive length."""

from pgfmd.schemes.entry import SchemeEntry

ENTRY = SchemeEntry(
    name="inertialess",
    meaning="the massless limit by implicit steps",
    coarse_grid=True,
    build="pgfmd.schemes.inertialess.plugin:build",
    memory="pgfmd.schemes.inertialess.plugin:memory",
    warm_up="pgfmd.schemes.inertialess.plugin:warm_up",
)
