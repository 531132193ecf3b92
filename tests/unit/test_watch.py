"""Watching a run: growing files, drawings of letters, the page of the loopback, and the bar of `pgfmd run` on a terminal."""

import io
import json
import shutil
import sys
import threading
import urllib.error
import urllib.request

import numpy as np
import pytest
from rich.console import Console

from pgfmd.cli import main
from pgfmd.errors import ResultError
from pgfmd.files.table_reading import CurveTail
from pgfmd.forecast.progress import Outlook
from pgfmd.output import progress_bar
from pgfmd.results import load
from pgfmd.results.status import FINISHED, RUNNING, Status
from pgfmd.watching import server, terminal
from pgfmd.watching.view import Glimpse, GrowingCurve, View, line_of
from tests.unit.chromium import Browser, executable
from tests.unit.small_runs import SCENE, run
from tests.unit.synthetic_results import write_results

COLUMNS = ("time [s]", "displacement [m]", "force [N]", "step [s]")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return run(tmp_path_factory.mktemp("watch") / "out")


def held(folder, target):
    """A copy of a finished run that looks as if this process were at it."""
    from pgfmd.host.run_lock import RunLock

    shutil.copytree(folder, target)
    for name in ("run.json", "checkpoint.h5", "checkpoint.previous.h5"):
        (target / name).unlink(missing_ok=True)
    return target, RunLock.acquire(target, 1)


def test_a_curve_is_read_as_it_grows(folder, tmp_path):
    content = (folder / "curve.csv").read_bytes()
    path = tmp_path / "curve.csv"
    curve = GrowingCurve(path)
    curve.update()
    assert curve.rows == [[], [], []]
    lines = content.splitlines(keepends=True)
    for size in range(0, len(content) + 1, 977):
        path.write_bytes(content[:size])
        curve.update()
        assert len(curve.rows[0]) == max(content[:size].count(b"\n") - 1, 0)
    path.write_bytes(content)
    curve.update()
    names = lines[0].decode().rstrip().split(",")
    forces = [float(line.split(b",")[names.index("force [N]")]) for line in lines[1:]]
    assert curve.rows[2] == forces
    # Taken back to a checkpoint, and on again by another way: of the same length, and longer.
    changed = lines[-1].replace(b"retract", b"reTract").replace(b"e-", b"e+")
    for end in ([changed], [lines[-2], changed, lines[-1]]):
        path.write_bytes(b"".join([*lines[:-1], *end]))
        curve.update()
        assert len(curve.rows[0]) == len(lines) - 2 + len(end)
    path.write_bytes(content + b"nonsense\n")
    curve.update()
    assert curve.strange == 1 and curve.rows[2] == forces
    path.write_bytes(b"a,b\n")
    with pytest.raises(ResultError, match="not a curve of a run"):
        curve.update()


def test_what_is_just_being_written_is_read_later(folder, tmp_path):
    live, lock = held(folder, tmp_path / "live")
    try:
        view = View(live, 20)
        (live / "fields.h5.undo").write_bytes(b"")
        first = view.look()
        assert not first.over and first.map is None and first.status.state == RUNNING
        (live / "fields.h5.undo").unlink()
        found = view.look().map
        assert found is not None and found.numbers.shape[0] <= 20
        good = (live / "fields.h5").read_bytes()
        (live / "fields.h5").write_bytes(good[: len(good) // 2])
        assert view.look().map is found
    finally:
        lock.release()
    (live / "run.json").write_bytes((folder / "run.json").read_bytes())
    assert view.look().over
    empty = tmp_path / "empty"
    empty.mkdir()
    assert not View(empty, 20).look().over
    with pytest.raises(ResultError, match="no such folder"):
        View(tmp_path / "nothing", 20).look()


def test_it_ends_with_the_run_and_says_so(folder, tmp_path, capsys):
    live, lock = held(folder, tmp_path / "live")
    waited = []

    def rest(seconds):
        waited.append(seconds)
        if len(waited) == 2:
            lock.release()
            for name in ("run.json", "checkpoint.h5"):
                shutil.copy(folder / name, live / name)

    terminal.watch(View(live, 20), 0.5, rest)
    lines = capsys.readouterr().out.splitlines()
    assert waited == [0.5, 0.5] and lines[0].startswith("running") and lines[-1].startswith("finished (detached)")
    # The same line is not said twice.
    assert len(lines) == len(set(lines))


def test_lines_of_dots_are_where_the_points_are():
    cells = terminal.dots(np.array([0.0, 1.0]), np.array([0.0, 1.0]), 5, 3, letters=False)
    assert [row.find("*") for row in cells] == [3, 2, 0] and cells[0].rstrip().endswith("*")
    steep = terminal.dots(np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0, 0.0]), 4, 2)
    assert all(0x2800 <= ord(letter) < 0x2900 or letter == " " for row in steep for letter in row)
    assert terminal.dots(np.zeros(2), np.zeros(2), 4, 2, letters=False)[0].strip() in ("*", "")


def test_a_terminal_shows_curve_and_map(folder):
    glimpse = View(folder, 22, coarse=True).look()
    assert glimpse.map is not None
    text = terminal.picture(glimpse, 120, 40).plain
    assert "indentation (µm)" in text and "contact (gap < " in text and "finished (detached)" in text
    assert all(len(line) <= 120 for line in text.splitlines()) and len(text.splitlines()) <= 40
    small = terminal.picture(glimpse, 50, 12).plain.splitlines()
    assert len(small) <= 14 and max(map(len, small)) <= 50
    bare = Glimpse(Status("x", FINISHED), np.zeros(0), np.zeros(0), np.zeros(0), None)
    assert "no curve yet" in terminal.picture(bare, 80, 24).plain


def test_coarse_maps_show_the_closest_points(tmp_path):
    big = write_results(tmp_path / "big", rows=50, nb=60, snapshots=2)
    most, closest = (View(big, 6, coarse=coarse).look().map.numbers for coarse in (False, True))
    assert most.shape == closest.shape == (6, 6) and (closest <= most).all() and (closest < most).any()


def get(address, **headers):
    with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=30) as answer:
        return answer.headers, answer.read()


def refused(address, method="GET", **headers):
    request = urllib.request.Request(address, headers=headers, method=method)
    with pytest.raises(urllib.error.HTTPError) as problem:
        urllib.request.urlopen(request, timeout=30)
    return problem.value.code


def test_the_server_shows_one_page_and_no_file(folder):
    shown = server.Server()
    assert shown.server_address[0] == "127.0.0.1"
    thread = threading.Thread(target=shown.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        shown.show(server.content_of(View(folder, 64).look()))
        headers, page = get(shown.address)
        assert b"new Chart" in page and "connect-src 'self'" in headers["Content-Security-Policy"]
        found = json.loads(get(shown.address + "data")[1])
        assert found["over"] and found["map"]["image"].startswith("data:image/png") and shown.served.wait(30)
        assert [chart["key"] for chart in found["charts"]] == ["force", "time"]
        home = shown.address.removesuffix(f"{shown.secret}/")
        for path in ("", "data", f"{shown.secret}/../", f"{shown.secret}/curve.csv", "etc/passwd", f"{shown.secret}x/"):
            assert refused(home + path) == 404
        assert refused(shown.address, Host="elsewhere.example") == 404
        assert refused(shown.address, method="POST") == refused(shown.address, method="PUT") == 501
        with pytest.raises(ResultError, match="can't be used"):
            server.Server(shown.server_port)
    finally:
        shown.shutdown()
        shown.server_close()
        thread.join()


@pytest.mark.skipif(executable() is None, reason="no Chromium here: the page is not looked at by a browser")
def test_a_browser_follows_until_the_end(folder, tmp_path, capsys):
    live, lock = held(folder, tmp_path / "live")
    rows = (live / "curve.csv").read_bytes().splitlines(keepends=True)
    (live / "curve.csv").write_bytes(b"".join(rows[:10]))
    with Browser(tmp_path / "profile") as browser:
        counts = []

        def rest(seconds):
            if not counts:
                browser.open(capsys.readouterr().out.split(" at ")[1].split()[0])
            counts.append(browser.run(
                "new Promise(d => { const f = () => charts.force ? d(charts.force.data.series[0].x.length) "
                ": setTimeout(f, 20); f(); })"
            ))  # fmt: skip
            (live / "curve.csv").write_bytes(b"".join(rows))
            lock.release()
            for name in ("run.json", "checkpoint.h5"):
                shutil.copy(folder / name, live / name)

        server.serve(View(live, 64), 0.1, rest=rest)
        assert counts == [9]
        browser.run(
            "new Promise(d => { const f = () => document.getElementById('state').textContent.startsWith('finished') ? d(1) "
            ": setTimeout(f, 20); f(); })"
        )
        assert browser.run("charts.force.data.series[0].x.length") == len(rows) - 1
        assert browser.run("document.getElementById('newest').hidden") is False and browser.overflow(400) == 0
        assert browser.faults == []
    assert capsys.readouterr().out.startswith("finished")


def test_ctrl_c_ends_it_quietly(folder, tmp_path, monkeypatch, capsys):
    live, lock = held(folder, tmp_path / "live")
    monkeypatch.setattr(terminal.watch, "__defaults__", (lambda seconds: (_ for _ in ()).throw(KeyboardInterrupt),))
    with pytest.raises(SystemExit) as end:
        main(["watch", str(live)])
    told = capsys.readouterr()
    lock.release()
    assert end.value.code == 0 and told.err == "" and told.out.startswith("running")
    with pytest.raises(SystemExit) as end:
        main(["watch", str(live), "--port", "8000"])
    assert end.value.code == 2 and "--browser" in capsys.readouterr().err


def test_a_line_says_how_much_is_left():
    status = Status(
        "x", RUNNING, phase="approach", steps=7, steps_per_s=2.0, progress=0.25, left_s=200.0, left_remark="and a dwell"
    )
    assert line_of(status) == "running  approach  7 steps, 2.0/s  25 % of the way  about 3.33 min left (and a dwell)"


class Terminal(io.StringIO):
    """A terminal that keeps what is drawn."""

    def isatty(self):
        return True


def test_a_terminal_has_a_bar_and_the_run_is_the_same(folder, tmp_path, monkeypatch):
    drawn = Terminal()
    monkeypatch.setattr(
        "rich.console.Console", lambda **options: Console(file=drawn, force_terminal=True, width=100, **options)
    )
    monkeypatch.setattr(progress_bar, "EVERY", 0.0)
    monkeypatch.setattr(progress_bar, "is_wanted", lambda: True)
    monkeypatch.setattr(progress_bar, "PATIENCE", 0.0)
    moments = []
    monkeypatch.setattr(
        progress_bar, "outlook", lambda _, moment: moments.append(moment) or Outlook(moment.time / 10.0, 60.0, "or so")
    )
    monkeypatch.setattr(sys, "stdout", said := Terminal())
    with pytest.raises(SystemExit) as end:
        main(["run", *SCENE, "--out", str(tmp_path / "bar")])
    assert end.value.code == 0
    assert (tmp_path / "bar" / "curve.csv").read_bytes() == (folder / "curve.csv").read_bytes()
    text = drawn.getvalue()
    # What the bar itself shows depends on how fast the run is.
    assert " detached  t " in text and "  preload  t " in text and text.count("warning: ") >= 1
    assert {"approach", "retract"} <= {each.phase for each in moments}
    rows = set(zip(*(load(folder).curve[name] for name in COLUMNS), strict=True))
    assert len(moments) > 50
    assert all((each.time, each.displacement, each.force, each.step) in rows for each in moments)
    last = moments[-1]
    assert last.depth == pytest.approx(-load(folder).events["displacement [m]"][0]) and last.preload_time < last.time
    # What the bar knows of the slope of the force is what `status` reads off the file.
    approach = max((each for each in moments if each.phase == "approach"), key=lambda each: each.time)
    lines = (folder / "curve.csv").read_text().splitlines(keepends=True)
    (tmp_path / "part.csv").write_text("".join(lines[: approach.steps + 2]))
    assert approach.stiffness == pytest.approx(CurveTail(tmp_path / "part.csv").stiffness, rel=1e-12)
    # Once it is gone, lines are said as ever.
    assert "results: " not in text and "results: " in said.getvalue() and "left" not in said.getvalue()


def test_a_run_that_stops_takes_its_bar_away(tmp_path, monkeypatch):
    monkeypatch.setattr("rich.console.Console", lambda **options: Console(file=io.StringIO(), **options))
    bar = progress_bar.ProgressBar()
    with pytest.raises(RuntimeError), bar:
        raise RuntimeError
    assert not bar.shown
    # A terminal that is gone: what is said goes on without the bar.
    with bar:
        monkeypatch.setattr(bar.bar.console, "print", lambda *_, **__: (_ for _ in ()).throw(OSError))
        bar.say("still said")
        assert not bar.shown


def test_a_bar_is_for_terminals_alone(monkeypatch):
    monkeypatch.setattr(sys, "stdout", Terminal())
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress_bar, "is_launched", lambda: False)
    assert progress_bar.is_wanted()
    monkeypatch.setenv("TERM", "dumb")
    assert not progress_bar.is_wanted()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress_bar, "is_launched", lambda: True)
    assert not progress_bar.is_wanted()
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    assert not progress_bar.is_wanted()
