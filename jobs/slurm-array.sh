#!/bin/bash
# Many runs, with Slurm; a line of the file CASES is a run:   sbatch --array=1-3 slurm-array.sh
# Each is a chain of its own (see slurm-chain.sh), with a folder of its own.
#SBATCH --job-name=pgfmd
#SBATCH --ntasks=4
#SBATCH --mem-per-cpu=2G
#SBATCH --time=24:00:00
#SBATCH --signal=B:USR1@300
#SBATCH --requeue
#SBATCH --open-mode=append

# Edit these four lines, and ntasks, mem-per-cpu and time above.
PGFMD_HOME=${PGFMD_HOME:-$HOME/pgfmd}
CASES=${CASES:-cases.txt}
RESULTS=${RESULTS:-out/study}
LINKS=${LINKS:-100}

case=$(grep -v -e '^ *#' -e '^ *$' "$CASES" | sed -n "${SLURM_ARRAY_TASK_ID}p")
[ -n "$case" ] || { echo "job: $CASES has no case $SLURM_ARRAY_TASK_ID" >&2; exit 2; }
# Words as on a command line, with its quotes, but nothing in them is carried out. The first is the folder, the others go
# to pgfmd run.
if ! words=$(printf '%s\n' "$case" | xargs printf '%s\n'); then
    echo "job: $CASES: case $SLURM_ARRAY_TASK_ID can't be read: $case" >&2
    exit 2
fi
mapfile -t words <<<"$words"
folder=$RESULTS/${words[0]}
set -- "${words[@]:1}"

. "$PGFMD_HOME/jobs/batch.bash"
run_pgfmd "$@" --out "$folder"
end_link $?
