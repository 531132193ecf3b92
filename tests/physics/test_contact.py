"""What counts as contact: points that the law holds, under tension as well, against closed forms of contacts that pull."""

import math

import numpy as np
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.output.recorder import Recorder
from pgfmd.reference import jkr
from pgfmd.scene import load_scene, scene_from_mapping
from tests.physics.runs import CONTACT_MODULUS, SINUSOID, WORK_OF_ADHESION


def gap_and_way(simulation):
    """The largest gap [m], and whether the punch is on its way out. Points are counted by their gaps."""
    state = simulation.state
    gap = state.position + simulation.scheme.height - state.surface_displacement
    levels = simulation.scheme.law.contact_gap, 0.0, 5e-7
    counts = [state.contact_points, state.overlap_points, state.near_points]
    assert counts == [np.count_nonzero(gap < level) for level in levels]
    return gap.max(), simulation.retracting


def areas(scene, *overrides):
    """The simulation at its end, and columns force, contact, overlap, near area and largest gap, (rows,) each, with
    which rows are on the way out."""
    read = scene_from_mapping if isinstance(scene, dict) else load_scene
    simulation, found = assemble(read(scene, overrides), MPI.COMM_SELF), Recorder(gap_and_way)
    simulation.observers.append(found)
    simulation.run()
    largest, back = zip(*found.measured, strict=True)
    return (
        simulation,
        *found.rows("force", "contact_area", "overlap_area", "near_area").T,
        np.array(largest),
        np.array(back),
    )


def test_the_radius_of_a_sticky_sphere_tends_to_that_of_jkr_and_that_of_overlap_does_not():
    """Way back at loads of zero and above. The range falls by sqrt(2) from one grid to the next, to a Tabor number of
    0.9: the error of the contact radius at first order or nearly so. Pressure alone is found further and further
    inside, where JKR's changes sign."""
    errors = []
    for n in (48, 96, 192):
        _, force, contact, overlap, _, _, back = areas(
            "hertz", f"grid.n={n}", "adhesion.law=cosine", "adhesion.range_factor=0.04", "drive.preload=0.2 mN",
            "solver.scheme=quasistatic",
        )  # fmt: skip
        pressed = back & (force >= 0.0) & (contact > 0.0)
        closed = jkr.contact_radius_at_force(force[pressed], 10e-3, CONTACT_MODULUS, WORK_OF_ADHESION)
        errors.append([np.mean(np.sqrt(area[pressed] / math.pi) / closed - 1.0) for area in (contact, overlap)])
    held, pressing = np.array(errors).T
    assert np.all(held > 0.0) and held[-1] < 0.08
    assert np.all(held[:-1] / held[1:] > 2 ** (0.7 / 2)) and held[0] / held[-1] > 2.0
    assert np.all(np.diff(pressing) < 0.0) and pressing[-1] < -0.14


def test_a_flat_punch_under_tension_is_in_contact_until_it_lets_go():
    """It pulls everywhere: nothing overlaps. Only the rim, as wide as the range makes it, opens before."""
    rims = []
    for n in (32, 64, 128):
        simulation, force, contact, overlap, _, _, back = areas("flat-punch", "rheology.model=elastic", f"grid.n={n}")
        whole = simulation.points.total * simulation.points.grid.cell_area
        pulled = back & (force < 0.0) & (contact > 0.0)
        assert pulled.sum() > 3 and not overlap[pulled].any()
        gently = pulled & (force > 0.5 * force.min())
        assert gently.any() and np.allclose(contact[gently], whole, rtol=1e-12)
        rims.append(1.0 - contact[np.argmin(force)] / whole)
    assert rims[0] > rims[1] > rims[2] and rims[2] < 0.05


def test_full_contact_of_a_wave_that_half_pulls():
    """At no load, half of the wave pulls as much as the other half presses."""
    adhesion = {"law": "cosine", "work_of_adhesion": "50 mJ/m^2", "range_factor": 0.156}
    drive = {"speed": "1 um/s", "preload": "0.5 mN"}
    scene = SINUSOID | {"adhesion": adhesion, "drive": drive, "grid": {"n": 32, "length": "100 um"}}
    simulation, force, contact, overlap, _, largest, back = areas(scene)
    cell, full = 1e-8, contact == contact.max()
    assert contact.max() == simulation.points.total * simulation.points.grid.cell_area
    assert np.all(largest[full] < simulation.scheme.law.contact_gap)
    assert np.all(largest[~full] >= simulation.scheme.law.contact_gap)
    light = np.argmin(np.abs(np.where(back & full, force, math.inf)))
    assert abs(force[light]) < 0.05 * 0.5e-3 and abs(overlap[light] / cell - 0.5) < 0.1
    assert overlap[full].min() < 0.2 * cell
