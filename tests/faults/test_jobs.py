"""The scripts of jobs/ on a real Slurm of this machine's own (scripts/slurm): the very files that users submit.

Skipped, with the reason, where no Slurm can be started. `scripts/test_jobs` makes that a failure, and with --full waits
for Slurm's own limits of time, too.
"""

import os
import re
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import pytest

from pgfmd.host import launch
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.restart.checkpoint_layout import examine
from pgfmd.results import load

pytestmark = [
    pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks"),
    pytest.mark.timeout(400),
]

ROOT = Path(__file__).parents[2]
JOBS, SLURM = ROOT / "jobs", ROOT / "scripts" / "slurm"
CANNOT_START = (69, 71)
ACTIVE = ("PENDING", "CONFIGURING", "RUNNING", "COMPLETING", "REQUEUED", "SUSPENDED", "STOPPED")
# What a login shell has: nothing of MPI's and Slurm's settings, which the scripts have to make themselves.
FOREIGN = ("OMPI_", "PMI", "SLURM_", "SBATCH_")
CLEAN = {name: value for name, value in os.environ.items() if not name.startswith(FOREIGN)}
SCENE = ["tri-tack", "grid.n=64", "solver.accuracy=5e-5", 'output.snapshots=["5 s", "1.1 t_pl"]']
"""About 1400 steps: 2 s on a free core."""
LONG = ["tri-tack", "grid.n=128", "solver.accuracy=1e-8"]
"""Some minutes."""


class Cluster:
    """A Slurm with two nodes, and a folder to submit from."""

    def __init__(self, folder: Path):
        self.work, self.slurm = folder / "work", folder / "slurm"
        self.work.mkdir()
        self.environment = CLEAN | {
            "SLURM_CONF": str(self.slurm / "slurm.conf"),
            "PGFMD_SLURM_NODES": "2",
            "PGFMD_SLURM_LIFETIME": "900",
            "PGFMD_HOME": str(ROOT),
            # What setup has compiled.
            "NUMBA_CACHE_DIR": "",
            # Ranks that wait leave their core to others: cores are few where tests run.
            "OMPI_MCA_mpi_yield_when_idle": "1",
            # mpirun spends twice this time on every exit code but 0.
            "OMPI_MCA_odls_base_sigkill_timeout": "1",
        }

    def call(self, *command, limit=30.0, **more) -> subprocess.CompletedProcess:
        return subprocess.run(
            command, cwd=self.work, env=self.environment | more, capture_output=True, text=True, timeout=limit
        )

    def submit(self, script: str, *arguments: str, options=("--ntasks=2", "--nodes=1"), **settings: str) -> str:
        """Submits a script of jobs/, or another one; returns the job's number. Its output goes to NUMBER.txt."""
        common = ("sbatch", "--parsable", "--mem-per-cpu=100", "--output=%A.txt")
        done = self.call(*common, *options, str(JOBS / script), *arguments, **settings)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def job(self, number: str) -> dict[str, str]:
        """What Slurm tells of a job."""
        done = self.call("scontrol", "--oneliner", "show", "job", number)
        assert done.returncode == 0, done.stderr
        return dict(re.findall(r"(\S+?)=(\S*)", done.stdout))

    def output(self, number: str) -> str:
        path = self.work / f"{number.partition('_')[0]}.txt"
        return path.read_text() if path.exists() else ""

    def wait(self, number: str, reached, limit=100.0) -> dict[str, str]:
        """What Slurm tells of a job as soon as `reached(job)`."""
        latest = time.monotonic() + limit
        while not reached(job := self.job(number)):
            assert time.monotonic() < latest, f"{job}\n{self.output(number)}"
            time.sleep(0.1)
        return job

    def end(self, number: str, limit=100.0) -> dict[str, str]:
        return self.wait(number, lambda job: job["JobState"] not in ACTIVE, limit)

    def rows(self, folder: str) -> int:
        curve = self.work / folder / "curve.csv"
        return curve.read_bytes().count(b"\n") if curve.exists() else 0

    def under_way(self, number: str, folder: str, steps: int) -> None:
        """Returns after so many more steps."""
        wanted = self.rows(folder) + steps
        self.wait(number, lambda job: self.rows(folder) >= wanted or job["JobState"] not in ACTIVE)

    def signal(self, number: str, name: str) -> None:
        """What --signal=B:USR1@... does at its time."""
        done = self.call("scancel", "--batch", f"--signal={name}", number)
        assert done.returncode == 0, f"{done.stderr}\n{self.output(number)}"

    def stop(self, number: str) -> None:
        """Has a link of a chain stop; returns when the job is queued again."""
        before = int(self.job(number)["Restarts"])
        self.signal(number, "USR1")
        job = self.wait(number, lambda job: int(job["Restarts"]) > before or job["JobState"] not in ACTIVE)
        assert int(job["Restarts"]) == before + 1, self.output(number)


@pytest.fixture(scope="module")
def cluster():
    # Not pytest's own folder: the name of a socket must be short.
    folder = Path(tempfile.mkdtemp(prefix="pgfmd-jobs-"))
    cluster = Cluster(folder)
    try:
        done = cluster.call(SLURM, "start", cluster.slurm, limit=90.0)
        if done.returncode in CANNOT_START:
            pytest.skip(f"no Slurm to test with: {done.stderr.strip()}")
        assert done.returncode == 0, done.stderr
        yield cluster
    finally:
        done = cluster.call(SLURM, "stop", cluster.slurm, limit=90.0)
        shutil.rmtree(folder, ignore_errors=True)
        assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def undisturbed(cluster):
    """A folder of results, and the job that made them in one piece."""
    number = cluster.submit("slurm-single.sh", *SCENE, RESULTS="undisturbed")
    cluster.end(number)
    return cluster.work / "undisturbed", number


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_a_single_job_runs_to_the_end_and_then_has_nothing_to_do(cluster, undisturbed):
    folder, number = undisturbed
    assert cluster.job(number)["JobState"] == "COMPLETED", cluster.output(number)
    record = load(folder).run
    assert record["finished"] == "detached" and record["ranks"] == 2
    before = contents(folder)
    again = cluster.submit("slurm-single.sh", *SCENE, RESULTS="undisturbed")
    assert cluster.end(again)["ExitCode"] == "0:0", cluster.output(again)
    assert contents(folder) == before


def test_a_chain_that_is_signalled_twice_leaves_the_same_bits(cluster, undisturbed):
    # Two nodes: mpirun starts the second rank through srun.
    two = ("--ntasks=2", "--nodes=2", "--ntasks-per-node=1")
    number = cluster.submit("slurm-chain.sh", *SCENE, options=two, RESULTS="chain")
    for _ in range(2):
        cluster.under_way(number, "chain", 150)
        cluster.stop(number)
    job = cluster.end(number)
    text = cluster.output(number)
    assert (job["JobState"], job["Restarts"], job["ExitCode"]) == ("COMPLETED", "2", "0:0"), text
    assert text.count("job: stopped early with a checkpoint") == 2 and "the chain ends with link 3" in text
    assert differences(undisturbed[0], cluster.work / "chain") == []


def test_runs_stop_before_slurm_ends_their_job(cluster):
    # Slurm's limits are minutes, but the end of a job that runs may be set to the second. Two tasks of an array,
    # because one of them has the number of the whole array.
    script = cluster.work / "short.sh"
    script.write_text(
        "#!/bin/bash\n"
        # Both tasks write to one file.
        "#SBATCH --open-mode=append\n"
        "job=${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID\n"
        "scontrol update JobId=$job EndTime=now+22\n"
        "SLURM_TIME_FORMAT=%s squeue --noheader --jobs=$job --format='ends %e'\n"
        f'RESULTS=short/$SLURM_ARRAY_TASK_ID exec bash {JOBS}/slurm-chain.sh "$@"\n'
    )
    number = cluster.submit(str(script), *LONG, options=("--ntasks=1", "--array=1-2"), LINKS="1")
    for task in ("1", "2"):
        # Once pgfmd has asked for it, the end is put off: who stops the run in time is pgfmd.
        cluster.under_way(f"{number}_{task}", f"short/{task}", 2)
        assert cluster.call("scontrol", "update", f"JobId={number}_{task}", "EndTime=now+300").returncode == 0
    jobs = [cluster.end(f"{number}_{task}") for task in (1, 2)]
    text = cluster.output(number)
    assert [(job["JobState"], job["ExitCode"]) for job in jobs] == [("FAILED", "75:0")] * 2, text
    assert text.count("pgfmd: stopped by the limit of time") == 2
    assert text.count("the chain ends with link 1, the last that LINKS=1 allows") == 2
    ends = [float(end) for end in re.findall(r"^ends (\d+)$", text, re.MULTILINE)]
    assert len(ends) == 2
    for task in ("1", "2"):
        assert (cluster.work / "short" / task / "checkpoint.h5").stat().st_mtime < max(ends)


def test_an_array_has_a_folder_a_case_and_queues_only_the_stopped_case_again(cluster):
    (cluster.work / "cases.txt").write_text(
        '# folder, then what pgfmd run is given\n\nslow tri-tack grid.n=96 solver.accuracy=2e-5 "drive.speed=2 um/s"\n'
        "  fast tri-tack grid.n=48 'drive.speed=20 um/s'\n"
    )
    number = cluster.submit("slurm-array.sh", options=("--ntasks=1", "--array=1-3"), RESULTS="study")
    cluster.under_way(f"{number}_1", "study/slow", 50)
    cluster.signal(f"{number}_1", "USR2")
    # What it says of checkpoints that were asked for, and of those every 10 minutes.
    cluster.wait(f"{number}_1", lambda job: "checkpoint  t" in cluster.output(number) or job["JobState"] not in ACTIVE)
    cluster.stop(f"{number}_1")
    slow, fast, third = (cluster.end(f"{number}_{case}") for case in (1, 2, 3))
    text = cluster.output(number)
    assert (slow["Restarts"], slow["ExitCode"], fast["Restarts"], fast["ExitCode"]) == ("1", "0:0", "0", "0:0"), text
    assert text.count("checkpoint  t") == text.count("job: stopped early with a checkpoint") == 1
    assert third["ExitCode"] == "2:0" and "job: cases.txt has no case 3" in text
    for name, speed in (("slow", 2e-6), ("fast", 20e-6)):
        curve = load(cluster.work / "study" / name).curve
        approach = curve[curve["phase"] == "approach"]
        travelled = approach["displacement [m]"].iloc[-1] - approach["displacement [m]"].iloc[0]
        assert abs(travelled) / (approach["time [s]"].iloc[-1] - approach["time [s]"].iloc[0]) == pytest.approx(speed)


def test_a_chain_ends_at_once_with_the_exit_code_of_a_bad_scene(cluster):
    number = cluster.submit("slurm-chain.sh", "tri-tack", "grid.n=0", RESULTS="bad")
    job, text = cluster.end(number), cluster.output(number)
    assert (job["JobState"], job["Restarts"], job["ExitCode"]) == ("FAILED", "0", "2:0"), text
    assert text.count("pgfmd: tri-tack: 1 problem in this scene") == 1
    assert "job: failed with exit code 2; the reason is above" in text and "the chain ends with link 1" in text
    assert not (cluster.work / "bad").exists()


@pytest.mark.skipif("PGFMD_FULL_LIMITS" not in os.environ, reason="takes 2 minutes: scripts/test_jobs --full")
def test_slurms_own_signal_and_slurms_own_end(cluster):
    signalled = cluster.submit(
        "slurm-chain.sh", *LONG, options=("--ntasks=1", "--time=1", "--signal=B:USR1@40"), RESULTS="signalled",
        LINKS="2",
    )  # fmt: skip
    # Without the number of its job pgfmd knows no end; and nothing else tells it.
    unwarned = ("--ntasks=1", "--time=1", "--signal=B:CONT@1")
    lost = {"RESULTS": "ended", "LAUNCH": "mpirun -n 1 env -u SLURM_JOB_ID"}
    ended = cluster.submit("slurm-single.sh", *LONG, "--checkpoint-every", "5s", options=unwarned, **lost)
    job, text = cluster.end(signalled, limit=200.0), cluster.output(signalled)
    assert (job["Restarts"], job["ExitCode"]) == ("1", "75:0"), text
    assert text.count("pgfmd: stopped by USR1") == 2 and "TIME LIMIT" not in text
    job, text = cluster.end(ended, limit=200.0), cluster.output(ended)
    assert job["JobState"] == "TIMEOUT" and "DUE TO TIME LIMIT" in text, text
    examine(cluster.work / "ended" / "checkpoint.h5")
    rows = len(load(cluster.work / "ended").curve)
    again = cluster.submit("slurm-chain.sh", *LONG, options=("--ntasks=1",), RESULTS="ended")
    cluster.under_way(again, "ended", 200)
    cluster.stop(again)
    assert len(load(cluster.work / "ended").curve) > rows, cluster.output(again)
    assert cluster.call("scancel", again).returncode == 0


@pytest.mark.parametrize("script", sorted(JOBS.glob("*.*sh")), ids=lambda path: path.name)
def test_the_syntax_of_the_scripts(script):
    done = subprocess.run(["bash", "-n", script], capture_output=True, text=True, timeout=10)
    assert done.returncode == 0 and done.stderr == ""
