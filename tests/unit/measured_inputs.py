"""Files as instruments write them, made of closed forms: a JKR loop, and the moduli of a known series."""

import numpy as np

from pgfmd.physics.rheology import PronySeries
from pgfmd.reference import jkr

ELASTIC = {"radius": 5e-3, "contact_modulus": 2.6e6, "work_of_adhesion": 0.05}
PULL_OFF, SEPARATION, HYSTERESIS = 1.1781e-3, 3.588e-9, 2.176e-9
"""Of the loop in closed form [N], [J], [J]."""
STATIC, KNOWN = 1.5e6, PronySeries([4.0, 10.0], [0.5, 0.01])
FREQUENCIES = np.geomspace(1e-3, 1e3, 25)


def jkr_loop(preload=10e-3, retraction_rows=92):
    """Time [s], indentation [m] and force [N] of a tack test of a sphere on an elastic half-space; (approach rows,)."""
    deepest = float(jkr.indentation(jkr.contact_radius_at_force(preload, **ELASTIC), **ELASTIC))
    last = jkr.displacement_controlled_pull_off(**ELASTIC).indentation
    way_in = np.concatenate([np.linspace(-6e-6, -1e-9, 14), np.linspace(1e-11, deepest, 70)])
    way_out = np.linspace(deepest, last * (1 - 1e-6), retraction_rows)
    beyond = np.linspace(last * (1 + 1e-4), -5.97e-6, 14)
    indentation = np.concatenate([way_in, way_out[1:], beyond])
    radii = jkr.contact_radius_at_indentation(indentation, **ELASTIC)
    force = np.nan_to_num(jkr.force(radii, **ELASTIC))
    rows = np.arange(indentation.size)
    force[(indentation < 0) & (rows < way_in.size)] = 0.0
    force[rows >= indentation.size - beyond.size] = 0.0
    time = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(indentation)))]) / 5e-5
    return time, indentation, force, way_in.size


def written(path, header, *columns, mark=",", coding="utf-8", decimal=".", after=""):
    """A table: header (lines of text), columns of numbers (%g), texts or None for an empty one."""
    lines = [header]
    for row in zip(*columns, strict=True):
        cells = [f"{value:.7g}" if isinstance(value, float) else str(value) for value in row]
        lines.append(mark.join(cell.replace(".", decimal) for cell in cells))
    path.write_bytes(("\n".join(lines) + "\n" + after).encode(coding))
    return path


def moduli(scale=1e-6, frequencies=FREQUENCIES):
    """Frequency [Hz], storage and loss modulus times scale, and tan delta, of the known elastomer."""
    omega = 2 * np.pi * frequencies
    storage, loss = STATIC * scale * KNOWN.storage(omega), STATIC * scale * KNOWN.loss(omega)
    return frequencies, storage, loss, loss / storage
