"""Compliance corrections: the fit, the signs, both ways of the correction; the effective Tabor number; the
hysteresis."""

import math

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.analysis.comparison import fitted_offset, overlay, rms_difference
from pgfmd.analysis.compliance import corrected_experiment, corrected_simulation, fit_cell_compliance
from pgfmd.analysis.hysteresis import audit_of, twin_of
from pgfmd.analysis.scene_differences import differences
from pgfmd.analysis.tabor import effective_tabor
from pgfmd.results import load
from pgfmd.results.curve import Loop, net_work
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
from tests.unit.analysis_loops import flat_punch_loop, loop_of, triangle, write_folder


def some_loop(stiffness=3e3, scatter=0.0):
    displacement, turn = triangle(10e-6, 1e-6)
    force = np.where(np.arange(401) < turn, -2e3 * displacement, -2.2e3 * displacement - 2e-3)
    force[turn - 1] = 20e-3
    noise = np.random.default_rng(5).normal(0, scatter, 401)
    return loop_of(displacement, force, turn, u_inf=force / stiffness + noise)


def test_the_fit_finds_the_stiffness_and_its_standard_error():
    exact = fit_cell_compliance(some_loop())
    assert exact.stiffness == pytest.approx(3e3, rel=1e-12) and exact.standard_error < 1e-6
    noisy = some_loop(scatter=1e-8)
    found = fit_cell_compliance(noisy)
    assert abs(found.stiffness - 3e3) < 4 * found.standard_error
    used = np.abs(noisy.force) > 1e-3 * noisy.force.max()
    assert found.rows == used.sum()
    # 1e-8 m of scatter over the forces that there are.
    assert found.standard_error == pytest.approx(1e-8 * 3e3**2 / np.linalg.norm(noisy.force[used]), rel=0.15)
    assert fit_cell_compliance(noisy, ("approach",)).rows < found.rows
    assert fit_cell_compliance(flat_punch_loop()) is None


def test_corrected_periodic_and_free_boundaries_agree(tmp_path):
    """The sign: a punch in a periodic cell is stiffer than alone, and the correction takes that out."""
    slopes = {}
    for boundary in ("periodic", "free"):
        changes = ["grid.n=32", f"substrate.boundary={boundary}", "rheology.model=elastic", "output.snapshots=[]"]
        run_scene(load_scene("flat-punch", changes), MPI.COMM_SELF, tmp_path / boundary, lambda line: None)
        with load(tmp_path / boundary) as results:
            slopes[boundary] = Loop.of(results)
    cell = fit_cell_compliance(slopes["periodic"])
    slopes["corrected"] = corrected_simulation(slopes["periodic"], cell.stiffness)

    def stiffness(loop):
        rows = slice(loop.preload_row // 2, loop.preload_row + 1)
        return np.polyfit(loop.indentation[rows], loop.force[rows], 1)[0]

    raw, corrected, free = (stiffness(slopes[name]) for name in ("periodic", "corrected", "free"))
    assert raw > 1.2 * free
    assert abs(corrected - free) < 0.3 * (raw - free)


def test_the_machine_is_taken_off_and_both_ways_differ_alike():
    ideal = some_loop()
    machine, cell = 38.1e3, 3e3
    measured = ideal.pushed_in_by(ideal.force / machine)
    np.testing.assert_allclose(
        corrected_experiment(measured, machine).displacement, ideal.displacement, rtol=0, atol=1e-18
    )
    # A run in the cell needs F/k_cc less indentation than the ideal one; either correction brings both together.
    run = ideal.pushed_in_by(-ideal.force / cell)
    for way in ("experiment", "simulation"):
        found = overlay([run], [measured], way, machine)
        np.testing.assert_allclose(found.loops[0].indentation, found.loops[1].indentation, rtol=0, atol=1e-17)
        assert found.differences[0] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_array_equal(
        overlay([run], [measured], "experiment", machine).loops[0].indentation, run.indentation
    )
    raw = overlay([run], [measured], "none", math.inf)
    assert raw.differences[0] > 1e-3 and raw.loops[1].displacement is not None
    np.testing.assert_array_equal(raw.loops[1].indentation, measured.indentation)


def test_an_offset_is_fitted_on_the_way_in():
    run = some_loop()
    shifted = run.pushed_in_by(1.7e-6)
    assert fitted_offset(run, shifted) == pytest.approx(-1.7e-6, rel=1e-9)
    found = overlay([run], [shifted], "none", math.inf, offset=None)
    assert found.offsets[0] == pytest.approx(-1.7e-6, rel=1e-9) and found.differences[0] < 1e-9
    only_out = loop_of(run.displacement[200:], run.force[200:], 1)
    with pytest.raises(ValueError, match="loading branch"):
        fitted_offset(run, only_out)


def test_differences_of_loops_that_never_meet_are_none():
    run = some_loop()
    assert rms_difference(run, run.pushed_in_by(50e-6)) is None
    assert rms_difference(run, run.with_force(run.force + 1e-3)) == pytest.approx(1e-3, rel=1e-9)


def test_the_papers_effective_tabor_numbers_come_from_its_pull_off_force():
    """0.880 and 1.24 at ranges of 0.264 and 0.187 um, from 1.2 mN; 40 % less for the triangular punch's 0.7 mN."""
    modulus = 2e6 / (1 - 0.495**2)
    ranges = [load_scene("hex-tack", [f"grid.n={n}"]).adhesion.range for n in (2048, 4096)]
    # The forces that round to 1.2 mN.
    rounded = (1.15e-3, 1.25e-3)
    lowest, highest = ([effective_tabor(force, 375e-6, modulus, r).number for r in ranges] for force in rounded)
    assert lowest[0] < 0.880 < highest[0] and lowest[1] < 1.24 < highest[1]
    exact = 1.24 / lowest[1] * 1.15e-3
    assert effective_tabor(exact, 375e-6, modulus, ranges[0]).number == pytest.approx(0.880, abs=0.005)
    tri = effective_tabor(0.7e-3, 375e-6, modulus, ranges[1], 0.05)
    assert tri.number / 1.24 == pytest.approx(0.6, abs=0.04)
    assert tri.share == pytest.approx(tri.work_of_adhesion / 0.05)
    assert tri.number == pytest.approx(0.7e-3 / (math.sqrt(8 * math.pi) * 375e-6 * modulus * ranges[1]), rel=1e-12)
    with pytest.raises(ValueError, match="range_of_adhesion"):
        effective_tabor(1e-3, 375e-6, modulus, 0.0)


SCENE = '[punch]\nradius = "375 um"\n\n[rheology]\nmodel = "{model}"\n\n[grid]\nn = {n}\n'


def test_the_hysteresis_is_split_by_the_audit_and_by_the_twin(tmp_path):
    wide, narrow = some_loop(), some_loop()
    closed = np.append(wide.force[:-1], 0.0)
    wide = wide.with_force(closed)
    way_in = np.interp(narrow.indentation, wide.indentation[:201], wide.force[:201])
    narrow = narrow.with_force(np.append(0.5 * (wide.force + way_in)[:-1], 0.0))
    loss, of_twin = net_work(wide), net_work(narrow)
    scene = SCENE.format(model="single", n=64)
    run = load(write_folder(tmp_path / "run", wide, scene, released=0.25 * loss, viscous=0.75 * loss))
    twin = load(write_folder(tmp_path / "twin", narrow, SCENE.format(model="elastic", n=64), released=of_twin))
    audit = audit_of(run)
    assert (audit.share(audit.viscous), audit.share(audit.released)) == pytest.approx((0.75, 0.25))
    found = twin_of(run, Loop.of(run), twin)
    assert found.multistability_share == pytest.approx(of_twin / loss)
    assert found.multistability_share == pytest.approx(0.5, rel=0.02)
    assert found.twin_loop + found.rest == found.loop and found.remarks == ()
    # The share is that of the audits, not of trapezoids between rows.
    assert found.loop == audit.work and found.twin_loop == audit_of(twin).work


def test_a_twin_that_is_none_is_remarked(tmp_path):
    loop = some_loop()
    closed = loop.with_force(np.append(loop.force[:-1], 0.0))
    run = load(write_folder(tmp_path / "run", closed, SCENE.format(model="single", n=64)))
    half = loop.with_force(0.5 * loop.force)
    other = load(write_folder(tmp_path / "other", half, SCENE.format(model="single", n=128)))
    remarks = "\n".join(twin_of(run, Loop.of(run), other).remarks)
    assert "grid.n differs: 64 here, 128 in the twin" in remarks
    assert "solver.scheme=quasistatic" in remarks
    assert "the loop of the twin is not closed" in remarks and "preloads differ" in remarks


def test_scenes_differ_where_their_values_do():
    one = {"adhesion": {"range": "7.46181672987796e-07 m", "law": "cosine", "q_ref": 1.0}, "grid": {"n": 64}}
    two = {"adhesion": {"range": "7.46182e-07 m", "law": "repulsive", "q_ref": 2.0}, "grid": {"n": 128, "more": 1}}
    found = list(differences(one, two, ("adhesion", "grid", "drive")))
    assert found == [("adhesion.law", "cosine", "repulsive"), ("grid.n", 64, 128)]
    assert list(differences(one, two, ("adhesion", "grid"), ("law", "n"))) == []
    far = {"adhesion": {"range": "7.5e-07 m"}}
    assert len(list(differences(one, far, ("adhesion",)))) == 1
    assert len(list(differences({"a": {"x": "1.0 m"}}, {"a": {"x": "1.0 s"}}, ("a",)))) == 1
