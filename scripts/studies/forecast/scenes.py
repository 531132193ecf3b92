"""The scenes by which the forecast of costs is fitted and judged (run.py)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

FIT, JUDGE = "fit", "judge"
"""Whether the numbers of forecast/effort.py are fitted to a scene, or only judged by it."""
REDUCED, FULL = "reduced", "full"
"""Whether a scene is of the set that is run in minutes, or of that which takes an hour."""
VISCOUS = ("rheology.model=single", "rheology.modulus_ratio=250", "rheology.relaxation_time=400 us")
QUASISTATIC = ("solver.scheme=quasistatic",)
INSTANTANEOUS = (*QUASISTATIC, "solver.modulus=instantaneous")
ELASTIC = ("rheology.model=elastic",)
STICKY = ("adhesion.law=cosine", "adhesion.range_factor=0.156")
"""A sphere that sticks."""


@dataclass(frozen=True)
class Case:
    """A shipped scene with its overrides. part: FIT or JUDGE; size: REDUCED or FULL."""

    scene: str
    changes: tuple[str, ...]
    part: str
    size: str = REDUCED

    @property
    def label(self) -> str:
        """All that tells it from others, on one line."""
        return f"{self.scene}: {', '.join(self.changes)}"


def elements(count: int) -> tuple[str, ...]:
    """A geometric ladder: the paper's with five elements, and broader ones."""
    ratio, shortest = {5: (6.0, "40 us"), 20: (2.0, "10 us"), 40: (1.5, "10 us")}[count]
    return (
        "rheology.model=geometric", f"rheology.elements={count}", f"rheology.time_ratio={ratio:g}",
        "rheology.exponent=0.8", f"rheology.relaxation_time={shortest}", "rheology.modulus_ratio=250",
    )  # fmt: skip


def speed(value: float) -> str:
    """A speed in um/s as an override."""
    return f"drive.speed={value:g} um/s"


def preload(value: float) -> str:
    """A preload in mN as an override."""
    return f"drive.preload={value:g} mN"


def accuracy(value: float) -> str:
    """An accuracy as an override."""
    return f"solver.accuracy={value:g}"


def _of(scene: str, part: str, size: str, rows: list[tuple]) -> Iterator[Case]:
    """Cases of one kind: each row is the grid and what else is changed, texts or tuples of texts."""
    for n, *changes in rows:
        flat = [text for change in changes for text in ((change,) if isinstance(change, str) else change)]
        yield Case(scene, (f"grid.n={n}", *flat), part, size)


def _corrugated(scene: str, low: float, high: float) -> Iterator[Case]:
    """Viscoelastic tack tests of a corrugated punch; low, high: preloads beside its own [mN]."""
    yield from _of(scene, FIT, REDUCED, [
        *((n, speed(v)) for n in (128, 256) for v in (0.5, 5, 25)), (512, speed(1)), (512, speed(25)), (1024, speed(25)),
        (256, preload(low)), (256, preload(high)), (128, speed(1000)), (128, speed(1e5)),
        (256, accuracy(0.03)), (256, accuracy(0.003)), (128, accuracy(0.001)), (128, speed(25), accuracy(0.001)),
        (256, elements(5)), (128, elements(40)), (256, speed(25), elements(40)), (256, "substrate.boundary=free"),
    ])  # fmt: skip
    yield from _of(scene, JUDGE, REDUCED, [
        (192, speed(2)), (256, speed(10)), (384, speed(5)), (512, speed(5), preload(low)), (256, speed(2), preload(high)),
        (256, speed(5), accuracy(0.03)), (256, speed(10), accuracy(0.003)), (192, speed(2), accuracy(0.001)),
        (256, elements(20)), (256, speed(5), elements(5)), (128, speed(25), elements(20)),
        (256, speed(25), "substrate.boundary=free"), (128, speed(1e4)), (192, speed(100)),
    ])  # fmt: skip
    # From 1000 points a side on with a coarser grid.
    yield from _of(scene, FIT, REDUCED, [
        (512, speed(0.5)), (512, speed(5)), (1024, speed(0.5)), (1024, speed(1)), (1024, speed(5)), (1024, speed(1000)),
        (1024, accuracy(0.03)), (1024, preload(low)), (1024, speed(25), elements(5)), (1536, speed(10)), (2048, speed(25)),
    ])  # fmt: skip
    yield from _of(scene, JUDGE, REDUCED, [
        (1024, speed(2)), (1024, speed(10), elements(5)), (1024, speed(25), preload(high)), (1280, speed(5)), (512, accuracy(0.001)),
        (2048, speed(10)), (2048, speed(1)),
    ])  # fmt: skip
    yield from _of(scene, JUDGE, FULL, [(2048, speed(5), elements(20)), (1024, accuracy(0.003))])


def _flat() -> Iterator[Case]:
    yield from _of("flat-punch", FIT, REDUCED, [
        *((n, speed(v)) for n in (128, 512) for v in (0.5, 10)), (256, speed(25)), (256, speed(1000)), (256, preload(20)),
        (256, accuracy(0.03)), (256, accuracy(0.001)), (256, elements(5)), (128, elements(40)),
        (256, "substrate.boundary=periodic"), (128, "rheology.modulus_ratio=4"),
    ])  # fmt: skip
    yield from _of("flat-punch", JUDGE, REDUCED, [
        (256, speed(2)), (512, speed(25)), (1024, speed(10)), (256, speed(5), accuracy(0.003)), (256, preload(2)),
        (256, elements(20)), (128, speed(1e4)), (192, speed(1), "substrate.boundary=periodic"),
    ])  # fmt: skip
    yield from _of("flat-punch", FIT, REDUCED, [
        (1024, speed(0.5)), (1024, speed(25)), (2048, speed(10)), (1024, elements(5)), (1024, accuracy(0.003)),
    ])  # fmt: skip
    yield from _of("flat-punch", JUDGE, REDUCED, [(1024, speed(1)), (1024, speed(5)), (2048, speed(25))])


def _sphere() -> Iterator[Case]:
    yield from _of("hertz", FIT, REDUCED, [
        (128,), (256, preload(20)), (512,), (1024,), (256, accuracy(0.03)), (256, accuracy(0.001)),
        (256, VISCOUS), (256, VISCOUS, speed(25)), (128, VISCOUS, elements(5)), (128, VISCOUS, speed(1e4)),
        (256, VISCOUS, STICKY, speed(10)), (128, VISCOUS, STICKY, speed(1)),
    ])  # fmt: skip
    yield from _of("hertz", JUDGE, REDUCED, [
        (256,), (192, preload(1)), (512, accuracy(0.003)), (256, VISCOUS, speed(5)), (256, VISCOUS, accuracy(0.001)),
        (128, elements(20)), (256, "substrate.boundary=periodic"), (256, VISCOUS, STICKY, speed(2)),
        (512, VISCOUS, STICKY, speed(25)), (256, elements(5), STICKY, speed(5)),
    ])  # fmt: skip
    yield from _of("hertz", JUDGE, FULL, [(2048,)])


def _without_time() -> Iterator[Case]:
    """Scenes whose surface jumps."""
    for scene, low in (("tri-tack", 5), ("hex-tack", 2)):
        yield from _of(scene, FIT, REDUCED, [
            (64, preload(low), QUASISTATIC, accuracy(0.03)), (128, preload(low), QUASISTATIC, accuracy(0.03)),
            (64, preload(low), QUASISTATIC), (64, QUASISTATIC, accuracy(0.1)), (128, QUASISTATIC, accuracy(0.1)),
            (64, preload(low), INSTANTANEOUS), (128, INSTANTANEOUS, accuracy(0.03)),
            (64, preload(low), ELASTIC, accuracy(0.03)), (128, preload(low), ELASTIC, accuracy(0.1)),
            (64, preload(low), ELASTIC),
        ])  # fmt: skip
        yield from _of(scene, JUDGE, REDUCED, [
            (96, preload(2 * low), QUASISTATIC, accuracy(0.03)), (96, preload(low), QUASISTATIC, accuracy(0.02)),
            (64, INSTANTANEOUS, accuracy(0.03)), (96, preload(2 * low), ELASTIC, accuracy(0.03)),
            (96, preload(low), QUASISTATIC, accuracy(0.05), "substrate.boundary=free"),
        ])  # fmt: skip
        yield from _of(scene, FIT, REDUCED, [(256, preload(low), QUASISTATIC, accuracy(0.03))])
        yield from _of(scene, JUDGE, FULL, [
            (128, QUASISTATIC, accuracy(0.03)), (128, preload(low), QUASISTATIC), (256, preload(low), QUASISTATIC, accuracy(0.1)),
            (256, INSTANTANEOUS, accuracy(0.03)), (128, preload(low), ELASTIC, accuracy(0.03)),
        ])  # fmt: skip
    yield from _of("flat-punch", FIT, REDUCED, [
        (64, QUASISTATIC, accuracy(0.03)), (128, QUASISTATIC, accuracy(0.1)), (64, INSTANTANEOUS, accuracy(0.03)),
        (64, ELASTIC, accuracy(0.03)), (128, ELASTIC, accuracy(0.1)),
    ])  # fmt: skip
    yield from _of("flat-punch", JUDGE, REDUCED, [
        (96, QUASISTATIC, accuracy(0.03)), (96, ELASTIC, accuracy(0.03)), (64, QUASISTATIC),
    ])  # fmt: skip
    yield from _of("hertz", FIT, REDUCED, [
        (256, QUASISTATIC), *((n, STICKY, QUASISTATIC, accuracy(a)) for n, a in ((64, 0.01), (128, 0.03), (64, 0.1), (128, 0.1))),
        (64, STICKY, ELASTIC), (128, STICKY, ELASTIC, accuracy(0.1)), (64, STICKY, ELASTIC, accuracy(0.03)),
    ])  # fmt: skip
    yield from _of("hertz", JUDGE, REDUCED, [
        (128, QUASISTATIC, accuracy(0.001)), (96, STICKY, QUASISTATIC), (96, STICKY, QUASISTATIC, accuracy(0.05), preload(1)),
        (96, STICKY, ELASTIC), (96, STICKY, ELASTIC, accuracy(0.05)),
    ])  # fmt: skip
    # As stiff at once as the other scenes are.
    at_once = ("rheology.model=single", "rheology.modulus_ratio=250", "rheology.relaxation_time=1 ms")
    yield from _of(
        "hertz",
        FIT,
        REDUCED,
        [(n, STICKY, at_once, INSTANTANEOUS, accuracy(a)) for n, a in ((64, 0.01), (128, 0.03), (256, 0.1))],
    )
    yield from _of(
        "hertz",
        JUDGE,
        REDUCED,
        [(96, STICKY, at_once, INSTANTANEOUS, accuracy(0.02)), (192, STICKY, at_once, INSTANTANEOUS)],
    )
    for scene in ("tri-tack", "hex-tack", "flat-punch"):
        yield from _of(scene, FIT, REDUCED, [(96, INSTANTANEOUS), (256, INSTANTANEOUS, accuracy(0.1))])
        yield from _of(scene, JUDGE, REDUCED, [(192, INSTANTANEOUS, accuracy(0.03)), (128, preload(10), INSTANTANEOUS)])


def _explicit() -> Iterator[Case]:
    """The paper's scheme, at speeds at which it ends."""
    gfmd = "solver.scheme=gfmd"
    yield from _of(
        "tri-tack",
        JUDGE,
        REDUCED,
        [(128, gfmd, speed(500)), (64, gfmd, speed(200), preload(10)), (128, gfmd, speed(1000), elements(5))],
    )
    yield from _of("hex-tack", JUDGE, REDUCED, [(128, gfmd, speed(500)), (64, gfmd, speed(100), preload(2))])
    yield from _of("flat-punch", JUDGE, REDUCED, [(128, gfmd, speed(500), "substrate.boundary=periodic")])


CASES = (
    *_corrugated("tri-tack", 10, 80),
    *_corrugated("hex-tack", 2, 30),
    *_flat(),
    *_sphere(),
    *_without_time(),
    *_explicit(),
)
