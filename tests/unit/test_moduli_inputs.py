"""Moduli in the shapes that instruments, papers and finite-element programs give them, to the right series, or refused."""

import re
import tomllib

import numpy as np
import pytest
from typer.testing import CliRunner

from pgfmd.characterisation.dma import read_moduli
from pgfmd.characterisation.relaxation_fit import fit_relaxation
from pgfmd.characterisation.rheology_table import characterise
from pgfmd.cli import app
from pgfmd.errors import MeasurementError, SceneError
from pgfmd.forecast.plausibility import warnings
from pgfmd.physics.rheology import PronySeries
from pgfmd.restart.scene_changes import differing
from pgfmd.scene import Scene, load_scene, parse_scene, shipped_text
from pgfmd.scene_objects import series_of
from tests.unit.measured_inputs import KNOWN, STATIC, moduli, written

HZ, STORAGE, LOSS, TAN = moduli()
OMEGA, DEGREES = 2 * np.pi * HZ, np.degrees(np.arctan(TAN))
COMPLEX = np.hypot(STORAGE, LOSS)


def right(path, **reading):
    """Whether the known elastomer comes back."""
    found = characterise(path, 2, **reading)
    assert found.fit.static_modulus == pytest.approx(STATIC, rel=2e-3)
    np.testing.assert_allclose(found.fit.series.kappa, KNOWN.kappa, rtol=2e-3)
    np.testing.assert_allclose(found.fit.series.tau, KNOWN.tau, rtol=2e-3)
    return found


def refused(path, words, **reading):
    with pytest.raises(MeasurementError, match=words) as caught:
        characterise(path, **reading)
    assert path.name in str(caught.value)


def test_complex_moduli_with_tan_delta_or_the_phase_angle(tmp_path):
    right(written(tmp_path / "a.csv", "frequency (Hz),E* (MPa),tan delta", HZ, COMPLEX, TAN))
    right(written(tmp_path / "b.csv", "Angular Frequency (rad/s),|E*| (MPa),Phase angle (°)", OMEGA, COMPLEX, DEGREES))
    right(written(tmp_path / "c.csv", "f (Hz),Complex modulus E* (MPa),delta (rad)", HZ, COMPLEX, np.arctan(TAN)))
    right(written(tmp_path / "d.csv", "omega,E' (MPa),phase (deg)", OMEGA, STORAGE, DEGREES))
    refused(
        written(tmp_path / "e.csv", "f (Hz),E* (MPa),phase", HZ, COMPLEX, DEGREES),
        "expected an angle, ° or rad, found none",
    )
    refused(
        written(tmp_path / "f.csv", "f (Hz),E* (MPa)", HZ, COMPLEX), r"expected a column E', or \|E\*\| and tan delta"
    )


def test_names_after_din_as_netzsch_writes_them(tmp_path):
    header = (
        "#EXPORTTYPE:DATA ALL\n#DECIMAL:COMMA\n#SEPARATOR:SEMICOLON\n\n##Frequency/Hz;Temp./°C;E'/MPa;E''/MPa;tan d"
    )
    columns = HZ, np.full(HZ.size, 25), STORAGE, LOSS, TAN
    path = written(tmp_path / "dma.txt", header, *columns, mark=";", decimal=",", coding="cp1252")
    assert right(path).sweeps[0].temperature == pytest.approx(298.15)


@pytest.mark.parametrize("unit", ["1/s", "s^-1", "[1/s]", "s⁻¹"])
def test_hertz_and_radians_are_never_guessed(tmp_path, unit):
    columns = STORAGE, LOSS
    refused(written(tmp_path / "a.csv", f"frequency ({unit}),E' (MPa),E'' (MPa)", HZ, *columns), r"a factor of 6\.28")
    right(written(tmp_path / "b.csv", f"angular frequency ({unit}),E' (MPa),E'' (MPa)", OMEGA, *columns))
    both = "frequency (Hz),angular frequency (rad/s),E' (MPa),E'' (MPa)"
    right(written(tmp_path / "c.csv", both, HZ, OMEGA, *columns))
    refused(written(tmp_path / "d.csv", both, HZ, HZ, *columns), "of 2 pi times the frequency")


@pytest.mark.parametrize(
    "header",
    [
        "freq_hz,temperature_C,G_storage_pa,G_loss_pa,tan_delta",
        "Frequency (Hz),Temperature (°C),Shear modulus (elastic component)(Pa),Shear modulus(viscous component)(Pa),tan d",
        "Frequenz [Hz],Temperatur [°C],Speichermodul G' [Pa],Verlustmodul G'' [Pa],Verlustfaktor [1]",
        "Frequency / Hz,T / °C,G′ / Pa,G″ / Pa,tan(δ)",
    ],
)
def test_shear_moduli_by_their_names(tmp_path, header):
    path = written(tmp_path / "g.csv", header, HZ, np.full(HZ.size, 25), STORAGE / 3e-6, LOSS / 3e-6, TAN)
    assert any("E = 2 (1 + nu) G with nu = 0.5" in line for line in right(path).report())
    found = characterise(path, 2, poisson_ratio=0.2)
    assert found.fit.static_modulus == pytest.approx(0.8 * STATIC, rel=2e-3)
    refused(path, "is a shear modulus by its name", modulus="tensile")


def test_a_rheometers_moduli_without_a_letter_have_to_be_told(tmp_path):
    header = (
        "Storage modulus,Loss modulus,Tan(delta),Angular frequency,Oscillation torque,Temperature\nPa,Pa,,rad/s,µN.m,°C"
    )
    still = np.full(HZ.size, 25)
    path = written(
        tmp_path / "saos.csv", header, STORAGE / 3e-6, LOSS / 3e-6, TAN, OMEGA, still / 20, still, coding="cp1252"
    )
    refused(path, "next to 'Oscillation torque' they will be of shear.*--modulus shear")
    right(path, modulus="shear")
    path = written(tmp_path / "p.csv", "Geometry,25mm parallel plate,\nomega,storage modulus (Pa),loss modulus (Pa)", OMEGA,
                   STORAGE / 3e-6, LOSS / 3e-6)  # fmt: skip
    refused(path, "the lines above speak of 'parallel plate'")
    path = written(tmp_path / "e.csv", "f (Hz),storage modulus (MPa),loss modulus (MPa)", HZ, STORAGE, LOSS)
    assert "are called by neither E nor G and are taken for tensile" in right(path).warnings()[0]
    assert right(path, modulus="tensile").warnings() == []
    refused(path, "tensile moduli, which need no Poisson's ratio", modulus="tensile", poisson_ratio=0.4)


def test_files_of_reptate(tmp_path):
    header = "T=25;Mw=100;chem=PDMS;\nFreq\tG'\tG\"\tTemp\tTemp\tTan_delta\nrad/s\tPa\tPa\t°C\t°C\t "
    still = np.full(HZ.size, 25)
    shear = STORAGE / 3e-6, LOSS / 3e-6
    right(written(tmp_path / "a.osc", header, OMEGA, *shear, still, still, TAN, mark="\t"))
    found = right(written(tmp_path / "b.tts", "T=-35;Mw=2.4;chem=PI;", OMEGA, *shear, still - 60, mark="  "))
    assert found.sweeps[0].degrees == "-35 C"
    time = np.geomspace(1e-4, 20, 30)
    stress = STATIC / 3 * KNOWN.relaxation(time)
    right(written(tmp_path / "c.gt", "gamma=0.5;T=25;\nt sxy", time, 0.5 * stress, mark=" "))
    refused(tmp_path / "b.tts", "holds shear moduli; leave out --modulus tensile", modulus="tensile")
    # A head of one or two lines that has other units, or a frequency that may be in Hz.
    kilopascal = HZ, STORAGE / 3e-3, LOSS / 3e-3
    for number, header in enumerate(
        ["f (Hz) G' (kPa) G'' (kPa)", "T=25;\nf (Hz) G' (kPa) G'' (kPa)", "f/Hz G'/kPa G''/kPa"]
    ):
        right(written(tmp_path / f"{number}.tts", header, *kilopascal, mark=" "))
    right(written(tmp_path / "d.osc", "f\tG'\tG''\nHz\tkPa\tkPa", *kilopascal, mark="\t"))
    refused(written(tmp_path / "e.osc", "f G' G''", OMEGA, *shear, mark=" "), "expected .* Hz")
    right(written(tmp_path / "g.tts", "w G' G''", OMEGA, *shear, mark=" "))


@pytest.mark.parametrize("header", ["time (s),E (MPa)", "t [s];E(t) [MPa]", "Time/s\tRelaxation modulus E(t)/MPa"])
def test_a_relaxation(tmp_path, header):
    time = np.concatenate([[0.0], np.geomspace(1e-4, 20, 30)])
    mark = next(mark for mark in "\t;," if mark in header)
    found = right(written(tmp_path / "r.csv", header, time, 1e-6 * STATIC * KNOWN.relaxation(time), mark=mark))
    assert any("passed over 1 of 31 rows, at time 0" in line for line in found.report()) and found.warnings() == []
    refused(tmp_path / "r.csv", "a relaxation at one temperature is not shifted", reference_temperature=298.15)
    rising = written(tmp_path / "s.csv", header, time, 1.0 + time, mark=mark)
    refused(rising, "expected a modulus that falls with time")


def test_a_relaxation_that_is_cut_off_is_warned_about():
    time = np.geomspace(5e-3, 0.3, 20)
    early, late = fit_relaxation(time, STATIC * KNOWN.relaxation(time)).warnings()[-2:]
    assert "at the longest time E(t) still falls" in early and "at the shortest time E(t) already falls" in late
    with pytest.raises(ValueError, match="at least 3 times"):
        fit_relaxation([1, 2], [2, 1])


def test_moduli_that_no_solid_has(tmp_path):
    path = written(tmp_path / "m.csv", "frequency (Hz),E' (mPa),E'' (mPa)", HZ, STORAGE, LOSS)
    refused(path, "the largest is 0.0225 Pa, softer than any gel; look at the unit: mPa")


def test_numbers_copied_from_a_spreadsheet(tmp_path):
    thousands = [f"{1e3 * value:,.0f}" for value in STORAGE], [f"{1e3 * value:,.1f}" for value in LOSS]
    rows = ["frequency (Hz)\tE' (kPa)\tE'' (kPa)"]
    rows += [f"{f:.6g}\t{s}\t{v}" for f, s, v in zip(HZ, *thousands, strict=True)]
    (tmp_path / "t.txt").write_text("\n".join(rows))
    refused(
        tmp_path / "t.txt", "expected one decimal mark, found numbers with a point and numbers with a comma|thousands"
    )


def test_glassy_sweeps_are_left_out_and_named(tmp_path):
    """A full DMA: below the glass transition a law of its own, and moduli that hardly change."""
    series = PronySeries.geometric(600, 1e-11, elements=22, time_ratio=3.5, exponent=0.52)
    random = np.random.default_rng(2)
    rows = ["temperature (C),frequency (Hz),E' (MPa),E'' (MPa)"]
    for celsius in np.arange(-85.0, 20.0, 7.5):
        above = max(celsius, -60.0) + 10.0
        shift = -9 * above / (100 + above) + 0.12 * max(-60.0 - celsius, 0.0)
        omega = 2 * np.pi * np.geomspace(0.1, 100, 7)
        reduced = omega * 10**shift
        factors = 1 + 0.01 * random.standard_normal((2, 7))
        values = factors * [3 * series.storage(reduced), 3 * series.loss(reduced) + 0.01 * series.storage(reduced)]
        rows += [f"{celsius},{f},{e},{v}" for f, e, v in zip(omega / 2 / np.pi, *values, strict=True)]
    (tmp_path / "s.csv").write_text("\n".join(rows))
    found = characterise(tmp_path / "s.csv", 12, 263.15)
    told = " ".join(found.left_out)
    assert re.match(r"(one|\d+) sweeps? at -85 C", told) and "no shift is determined" in told and " K" not in told
    assert pytest.approx(9, rel=0.12) == found.wlf.C1 and pytest.approx(100, rel=0.12) == found.wlf.C2
    assert float(found.wlf.log_shift(291.15)) == pytest.approx(-9 * 28 / 128, abs=0.1)


SPHERE = """# the elastomer of a finite-element model
[substrate]
youngs_modulus = "30 MPa"   # at once
poisson_ratio = 0.495
[rheology]   # from material.inp
model = "prony"
kappa = [0.50, 0.30, 0.15]
tau = ["0.5 ms", "10 ms", "200 ms"]
{reference}
[punch]
pattern = "sphere"
radius = "150 um"
curvature_radius = "1 mm"
[adhesion]
work_of_adhesion = "50 mJ/m^2"
[drive]
speed = "20 um/s"
preload = "1 mN"
[grid]
n = 64
length = "0.6 mm"
"""


def test_shares_of_the_instantaneous_modulus_become_weights_of_the_relaxed_one():
    scene = parse_scene(SPHERE.format(reference='reference = "instantaneous"'))
    assert scene.substrate.youngs_modulus == pytest.approx(1.5e6, rel=1e-12)
    assert scene.rheology.reference == "relaxed"
    assert scene.rheology.kappa == pytest.approx((10, 6, 3), rel=1e-12)
    # At once the modulus is the one given, and the resolved scene says the same.
    assert scene.substrate.youngs_modulus * series_of(scene.rheology).kappa_inf == pytest.approx(30e6, rel=1e-12)
    assert parse_scene(scene.to_toml()) == scene
    by_hand = SPHERE.format(reference="").replace("30 MPa", "1.5 MPa").replace("0.50, 0.30, 0.15", "10, 6, 3")
    assert parse_scene(by_hand).adhesion.range == pytest.approx(scene.adhesion.range, rel=1e-12)


def test_weights_with_a_sum_below_one_are_asked_about():
    def said(reference):
        return [text for text in warnings(parse_scene(SPHERE.format(reference=reference))) if "rheology.kappa" in text]

    (text,) = said("")
    assert 'set rheology.reference = "instantaneous"' in text and "1.95 times as stiff" in text
    assert not said('reference = "relaxed"') and not said('reference = "instantaneous"')
    plain = parse_scene(SPHERE.format(reference=""))
    assert plain.substrate.youngs_modulus == 30e6 and plain.rheology.reference is None
    assert "reference" not in plain.to_toml()
    # Who says what was meant can go on with a run.
    assert not list(differing(plain.to_toml(), parse_scene(SPHERE.format(reference='reference = "relaxed"'))))


@pytest.mark.parametrize("kappa", ["0.5, 0.3, 0.2", "10, 6, 3", "0.5, 0.3, 0.1999999999"])
def test_shares_that_leave_nothing_are_refused(kappa):
    text = SPHERE.format(reference='reference = "instantaneous"').replace("0.50, 0.30, 0.15", kappa)
    with pytest.raises(SceneError, match="shares of the instantaneous modulus with a sum below 1"):
        parse_scene(text)


def test_other_models_have_no_reference(tmp_path):
    text = shipped_text("tri-tack").replace("[rheology]", '[rheology]\nreference = "instantaneous"')
    with pytest.raises(SceneError, match=r"rheology\.reference .* no such key for the model"):
        parse_scene(text)
    (tmp_path / "g0.txt").write_text("1e3 1e-9\n1e7 1e-13\n")
    file = SPHERE.format(reference='reference = "instantaneous"').replace(
        "poisson_ratio = 0.495", 'poisson_ratio = 0.495\ncompliance_file = "g0.txt"'
    )
    with pytest.raises(SceneError, match="the file holds the static compliance"):
        parse_scene(file, folder=tmp_path)


def test_a_fit_is_written_into_a_scene_whose_comments_stay(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SPHERE.format(reference='reference = "instantaneous"'))
    shear = written(tmp_path / "g.csv", "f (Hz),G' (MPa),G'' (MPa)", HZ, STORAGE / 2.99, LOSS / 2.99)
    done = CliRunner().invoke(app, ["fit-prony", str(shear), "-n", "2", "--into", str(scene)])
    assert done.exit_code == 0, done.exception
    text = scene.read_text()
    for comment in ("# the elastomer of a finite-element model", "# at once", "# from material.inp"):
        assert comment in text
    found = load_scene(scene)
    # Poisson's ratio is the scene's.
    assert found.substrate.youngs_modulus == pytest.approx(STATIC, rel=2e-3)
    np.testing.assert_allclose(series_of(found.rheology).kappa, KNOWN.kappa, rtol=2e-3)
    assert tomllib.loads(text)["punch"]["pattern"] == "sphere" and "nu = 0.495" in done.stdout
    scene.write_text(shipped_text("tri-tack"))
    assert CliRunner().invoke(app, ["fit-prony", str(shear), "-i", str(scene), "-n", "2"]).exit_code == 0
    assert "modulus_ratio" not in tomllib.loads(scene.read_text())["rheology"] and load_scene(scene).rheology.kappa
    before = scene.read_text()
    (tmp_path / "bad.csv").write_text("f (Hz),G' (MPa)\n1,2\n")
    assert CliRunner().invoke(app, ["fit-prony", str(tmp_path / "bad.csv"), "-i", str(scene)]).exit_code != 0
    assert scene.read_text() == before


def test_a_series_goes_through_each_table_to_a_scene(tmp_path):
    moduli_file = written(tmp_path / "e.csv", "f (Hz),E' (MPa),E'' (MPa)", HZ, STORAGE, LOSS)
    fit = characterise(moduli_file, 2).fit
    scene, table = tmp_path / "scene.toml", tmp_path / "table.toml"
    scene.write_text(SPHERE.format(reference='reference = "instantaneous"'))
    words = ["fit-prony", moduli_file, "-n", 2, "--into", scene, "--out", table]
    done = CliRunner().invoke(app, list(map(str, words)))
    assert done.exit_code == 0, done.exception
    text = table.read_text()
    told = re.search(r'^# (youngs_modulus = ".*")$', text, re.MULTILINE)[1]
    tables = tomllib.loads(text) | {"substrate": tomllib.loads(told) | {"poisson_ratio": 0.495}}
    own = Scene("tri-tack").tables() | tables
    again = parse_scene(load_scene(scene).to_toml())
    for found in (load_scene(scene), again, Scene(own)):
        series = series_of(found.rheology)
        np.testing.assert_allclose(series.kappa, fit.series.kappa, rtol=1e-5)
        np.testing.assert_allclose(series.tau, fit.series.tau, rtol=1e-5)
        assert found.substrate.youngs_modulus == pytest.approx(fit.static_modulus, rel=1e-5)
    # The moduli of the scene's series are those of the file, and give the series again.
    omega = 2 * np.pi * HZ
    columns = (
        HZ,
        *(1e-6 * found.substrate.youngs_modulus * part for part in (series.storage(omega), series.loss(omega))),
    )
    back = characterise(written(tmp_path / "back.csv", "f (Hz),E' (MPa),E'' (MPa)", *columns), 2).fit.series
    np.testing.assert_allclose([back.kappa, back.tau], [series.kappa, series.tau], rtol=2e-3)


def test_a_read_file_says_what_it_took_for_granted(tmp_path):
    path = written(
        tmp_path / "a.csv", "Report\n\nf (Hz),G' (MPa),G'' (MPa)", HZ, STORAGE, LOSS, after="end of file,,\n"
    )
    found = read_moduli(path)
    assert "below the numbers" in found.notes[0] and "shear moduli" in found.notes[1] and found.unsure == ()
