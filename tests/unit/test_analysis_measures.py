"""Measures of a loop against closed forms, and against what a real run says of itself."""

import dataclasses
import shutil

import numpy as np
import pytest

from pgfmd.analysis.bulges import bulges
from pgfmd.analysis.contact_stiffness import stiffness_at, stiffness_table, unloading_stiffness
from pgfmd.analysis.low_pass import filtered
from pgfmd.analysis.summary import analyse
from pgfmd.reference import flat_punch, hertz
from pgfmd.results import load
from pgfmd.results.curve import Loop, dip, measure, net_work, net_work_of_rows, separation_of_rows, work_of_separation
from pgfmd.results.sites import site_loads
from tests.unit.analysis_loops import MODULUS, PUNCH, WORK, flat_punch_loop, loop_of, triangle, write_folder
from tests.unit.small_runs import run


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    return load(run(tmp_path_factory.mktemp("real") / "run"))


def test_kendalls_punch_has_its_pull_off_force_work_and_stiffness():
    loop = flat_punch_loop()
    found = measure(loop)
    assert found.pull_off.tension == pytest.approx(-flat_punch.pull_off_force(PUNCH, MODULUS, WORK), rel=1e-12)
    assert found.pull_off.displacement == pytest.approx(-flat_punch.pull_off_indentation(PUNCH, MODULUS, WORK))
    assert found.work_of_separation == pytest.approx(flat_punch.work_of_separation(PUNCH, WORK), rel=1e-6)
    # In and out are the same line down to the pull-off: what is pulled is lost in the jump, w times twice the area.
    assert found.hysteresis == pytest.approx(2 * np.pi * PUNCH**2 * WORK, rel=1e-6)
    assert found.snap_in.tension == 0.0 and list(found.landmarks) == ["pull-off"]
    stiffness = 2 * PUNCH * MODULUS
    assert unloading_stiffness(loop).stiffness == pytest.approx(stiffness, rel=1e-9)
    assert [row.stiffness for row in stiffness_table(loop)] == pytest.approx([stiffness] * 7, rel=1e-9)


def test_the_parabola_finds_the_bottom_between_rows_and_spares_jumps():
    displacement, turn = triangle(rows=61, turn_rows=31)
    bottom, depth, curvature = 1.37e-6, 2.2e-3, 4e8
    force = np.where(np.arange(61) < turn, -1e3 * displacement, -depth + 0.5 * curvature * (displacement - bottom) ** 2)
    loop = loop_of(displacement, force, turn)
    lowest = turn + int(np.argmin(force[turn:]))
    found = dip(loop, lowest)
    assert abs(displacement[lowest] - bottom) > 1e-8
    assert found.displacement == pytest.approx(bottom, rel=1e-9)
    assert found.tension == pytest.approx(depth, rel=1e-12)
    assert loop.time[lowest - 1] < found.time < loop.time[lowest + 1]
    for row in (lowest, lowest + 1):
        jumped = dataclasses.replace(loop, jump=np.arange(61) == row)
        assert dip(jumped, lowest).tension == -force[lowest]


def test_work_of_separation_counts_the_part_of_a_step_under_tension_only():
    # 3 mN of compression to 1 mN of tension on 4 um: a quarter of the way, half of 1 mN; then 1 mN on 2 um.
    loop = loop_of([0, -4e-6, 0, 2e-6], [0, 3e-3, -1e-3, -1e-3], 2)
    assert work_of_separation(loop) == pytest.approx(0.5 * 1e-3 * 1e-6 + 1e-3 * 2e-6, rel=1e-14)
    # Tension on the way in is no separation; a jump is met with the force from before.
    assert work_of_separation(loop_of([2e-6, 1e-6, -4e-6, 0], [-1e-3, -1e-3, 3e-3, 0], 3)) == 0.0
    jumping = loop_of([0, -4e-6, 0, 2e-6], [0, 3e-3, -1e-3, -5e-3], 2, jumps=[3])
    assert work_of_separation(jumping) == pytest.approx(work_of_separation(loop), rel=1e-14)


def test_stiffness_of_hertz_is_twice_modulus_times_contact_radius():
    radius = 5e-3
    displacement, turn = triangle(20e-6, 0.0, rows=2001, turn_rows=1001)
    loop = loop_of(displacement, hertz.force(-displacement, radius, MODULUS), turn)
    preload = loop.force.max()
    for branch in ("approach", "retraction"):
        for part in (0.25, 0.5, 0.75):
            found = stiffness_at(loop, branch, part * preload)
            contact = (3 * found.load * radius / (4 * MODULUS)) ** (1 / 3)
            assert found.load == pytest.approx(part * preload)
            assert found.stiffness == pytest.approx(2 * MODULUS * contact, rel=5e-3)
    assert stiffness_at(loop, "retraction", 1.01 * preload) is None
    assert stiffness_at(loop, "retraction", -0.2 * preload) is None


def test_bulges_are_found_where_they_were_put():
    displacement, turn = triangle(10e-6, 4e-6, rows=3001, turn_rows=501)
    smooth = -1e3 * (displacement - 1e-6)

    def with_dip(depth):
        force = smooth - depth * np.exp(-0.5 * ((displacement + 5e-6) / 0.4e-6) ** 2)
        end = displacement > 2e-6
        force[end] = np.minimum(force[end] + 4e3 * (displacement[end] - 2e-6), 0)
        return loop_of(displacement, np.where(np.arange(3001) < turn, smooth, force), turn)

    minimum, pull_off = bulges(with_dip(2e-3))
    assert minimum.kind == pull_off.kind == "minimum"
    assert minimum.displacement == pytest.approx(-5e-6, abs=0.3e-6) and minimum.force > 0
    assert pull_off.displacement == pytest.approx(2e-6, abs=0.1e-6) and pull_off.force < 0
    shoulder, pull_off = bulges(with_dip(0.4e-3))
    assert (shoulder.kind, pull_off.kind) == ("inflection", "minimum")
    # The slope of a Gaussian dip is largest one width behind its middle.
    assert shoulder.displacement == pytest.approx(-4.6e-6, abs=0.1e-6)
    assert [bulge.kind for bulge in bulges(with_dip(0.0))] == ["minimum"]
    # Nanometres and metres, to which 0.1 um is the whole way, or finer than can be filtered.
    for scale in (1e-3, 1e5):
        loop = with_dip(2e-3)
        minimum, pull_off = bulges(dataclasses.replace(loop, displacement=scale * loop.displacement))
        assert minimum.displacement == pytest.approx(-5e-6 * scale, abs=0.3e-6 * scale)
        # To the resolution, 1/50 of the way.
        assert pull_off.displacement == pytest.approx(2e-6 * scale, abs=0.24e-6 * scale)


def test_a_loop_without_tension_or_retraction_says_so():
    found = measure(loop_of([0, -1e-6, -2e-6], [0.0, 1e-3, 2e-3], 3))
    assert found.pull_off is None and found.work_of_separation is None and found.snap_in.tension == 0.0
    assert found.preload is None and found.landmarks == {}
    assert found.hysteresis == pytest.approx(2e-9) and found.largest_force == 2e-3
    assert unloading_stiffness(loop_of([0, -1e-6], [0.0, 1e-3], 2)) is None
    assert bulges(loop_of([0, -1e-6, -2e-6], [0.0, 1e-3, 2e-3], 3)) == []


def test_a_real_run_is_measured_as_it_measured_itself(real):
    loop, record = Loop.of(real), real.run
    found = measure(loop)
    # The turn goes on a little, by a fixed share of the range, which is wide on this grid.
    assert record["preload_N"] <= found.largest_force < 1.05 * record["preload_N"]
    assert (found.pull_off.tension, found.snap_in.tension) == (record["pull_off_force_N"], record["snap_in_force_N"])
    rows = measure(dataclasses.replace(loop, recorded={}))
    assert rows.pull_off.tension == pytest.approx(record["pull_off_force_N"], abs=rows.pull_off.uncertainty)
    assert rows.snap_in.tension == pytest.approx(record["snap_in_force_N"], abs=rows.snap_in.uncertainty)
    assert (rows.preload, rows.largest_force) == (record["preload_N"], record["largest_force_N"])
    assert rows.time_to_preload == pytest.approx(record["time_to_preload_s"], rel=1e-12)
    assert (found.work_of_separation, found.hysteresis) == (record["work_of_separation_J"], record["work_J"])
    assert separation_of_rows(loop) == pytest.approx(record["work_of_separation_J"], rel=0.02)
    at_most = np.max(np.abs(loop.force)) * np.ptp(loop.displacement)
    assert net_work_of_rows(loop) == pytest.approx(record["work_J"], abs=0.01 * at_most)


@pytest.mark.parametrize("changes", [(), ("output.every=5",), ("drive.machine_stiffness=1 kN/m",)])
def test_a_quasi_static_run_is_measured_as_it_measured_itself(changes, tmp_path):
    results = load(run(tmp_path / "slow", "solver.scheme=quasistatic", "grid.n=32", *changes))
    loop, record = Loop.of(results), results.run
    found = measure(loop)
    assert loop.jump.sum() > 10 and not loop.held
    assert found.pull_off.tension == record["pull_off_force_N"]
    rows = measure(dataclasses.replace(loop, recorded={}))
    # Rows of smooth parts may be left out, and the lowest force may be in one; those beside jumps are there.
    near = 1e-3 if results.scene["output"]["every"] == 1 else 0.01
    assert rows.pull_off.tension == pytest.approx(record["pull_off_force_N"], rel=near)
    assert separation_of_rows(loop) == pytest.approx(record["work_of_separation_J"], rel=0.02)
    at_most = np.max(np.abs(loop.force)) * np.ptp(loop.displacement)
    spared = 0.01 * at_most if results.scene["output"]["every"] > 1 else 0.0
    assert net_work_of_rows(loop) == pytest.approx(record["work_J"], rel=0.05, abs=spared)


@pytest.mark.parametrize("scheme", ["inertialess", "quasistatic"])
def test_a_filter_leaves_the_works_of_a_run_alone(scheme, tmp_path):
    changes = [f"solver.scheme={scheme}", "adhesion.work_of_adhesion=500 mJ/m^2"]
    changes += ["drive.control=load"] if scheme == "quasistatic" else ["rheology.model=elastic"]
    folder = run(tmp_path / "run", *changes)
    loop, record = Loop.of(load(folder)), load(folder).run
    assert loop.held and loop.jump.any()
    rough = dataclasses.replace(loop, work=None, separation=None)
    # A filter of a tenth of the loop's width: its rows say something else.
    smooth = 0.1 * float(np.ptp(loop.displacement))
    assert net_work(filtered(rough, smooth)) != pytest.approx(record["work_J"], rel=0.05)
    for found in (measure(loop), measure(filtered(loop, smooth)), analyse(folder, resolution=smooth).measures):
        assert (found.work_of_separation, found.hysteresis) == (record["work_of_separation_J"], record["work_J"])


def test_the_work_of_a_run_without_record_is_that_of_its_audit_or_of_its_rows(real, tmp_path):
    folder = shutil.copytree(real.directory, tmp_path / "run")
    record = real.run
    (folder / "run.json").unlink()
    assert Loop.of(load(folder)).work == pytest.approx(record["work_J"], rel=1e-14)
    (folder / "energy.csv").unlink()
    loop = Loop.of(load(folder))
    assert (loop.work, loop.separation) == (net_work_of_rows(loop), separation_of_rows(loop))
    assert measure(filtered(loop, 1e-6)).hysteresis == loop.work


def test_a_correction_of_displacements_adds_what_the_rows_say(real):
    loop = Loop.of(real)
    shifted, tilted = loop.pushed_in_by(1e-6), loop.pushed_in_by(loop.force / 3e3)
    assert (shifted.work, shifted.separation) == (loop.work, loop.separation)
    # A spring in series takes no work over a closed loop but in held jumps.
    assert (tilted.work, tilted.separation) == pytest.approx((loop.work, loop.separation), rel=1e-9)
    jumping = dataclasses.replace(flat_punch_loop(), work=2e-9, separation=1e-9)
    soft, last = jumping.pushed_in_by(jumping.force / 1e6), -jumping.force[-2]
    gained = 0.5 * last**2 / 1e6
    assert (soft.work - 2e-9, soft.separation - 1e-9) == pytest.approx((-gained, gained), rel=1e-5)


def test_an_audit_that_explains_little_is_remarked(tmp_path):
    loop = flat_punch_loop()
    folder = write_folder(tmp_path / "run", loop, '[punch]\nradius = "375 um"\n', released=1e-9)
    assert not any("unexplained" in remark for remark in analyse(folder).table.remarks)
    text = (folder / "energy.csv").read_text()
    (folder / "energy.csv").write_text(text.replace("1e-09,0.0\n", "8e-10,2e-10\n"))
    remark = next(remark for remark in analyse(folder).table.remarks if "unexplained" in remark)
    assert "leaves 0.2 nJ unexplained of a loop of 1 nJ" in remark


def test_loads_of_sites_are_those_of_the_table(real):
    loads = {entry.kind: entry for entry in site_loads(real, Loop.of(real))}
    sites = real.sites
    if sites is None or not len(sites):
        assert loads == {}
        return
    summit = loads["summit"]
    own = np.asarray(sites["kind"]) == "summit"
    assert summit.of == 23 and summit.most == np.asarray(sites["in_contact"])[own].max()
    assert summit.first_joins == np.asarray(sites["force [N]"])[own][0]
    assert summit.last_leaves == np.asarray(sites["force [N]"])[own][-1]
