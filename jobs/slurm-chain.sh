#!/bin/bash
# A run that is longer than a job may last, with Slurm:   sbatch slurm-chain.sh [SCENE [KEY=VALUE ...]]
# Before its time is over it writes a checkpoint, and the job is put back into the queue, until the run is finished.
#SBATCH --job-name=pgfmd
#SBATCH --ntasks=16
#SBATCH --mem-per-cpu=2G
#SBATCH --time=24:00:00
#SBATCH --signal=B:USR1@300
#SBATCH --requeue
#SBATCH --open-mode=append

# Edit these four lines, and ntasks, mem-per-cpu and time above.
PGFMD_HOME=${PGFMD_HOME:-$HOME/pgfmd}
RESULTS=${RESULTS:-out/tri-tack}
LINKS=${LINKS:-100}
[ $# -gt 0 ] || set -- tri-tack.toml

. "$PGFMD_HOME/jobs/batch.bash"
run_pgfmd "$@" --out "$RESULTS"
end_link $?
