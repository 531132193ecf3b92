#!/bin/bash
# One run, with Slurm:   sbatch slurm-single.sh [SCENE [KEY=VALUE ...]]
# Submitted again, it goes on from the newest checkpoint.
#SBATCH --job-name=pgfmd
#SBATCH --ntasks=16
#SBATCH --mem-per-cpu=2G
#SBATCH --time=24:00:00
#SBATCH --signal=B:USR1@300
#SBATCH --requeue
#SBATCH --open-mode=append

# Edit these three lines, and ntasks, mem-per-cpu and time above.
PGFMD_HOME=${PGFMD_HOME:-$HOME/pgfmd}
RESULTS=${RESULTS:-out/tri-tack}
[ $# -gt 0 ] || set -- tri-tack.toml

. "$PGFMD_HOME/jobs/batch.bash"
run_pgfmd "$@" --out "$RESULTS"
