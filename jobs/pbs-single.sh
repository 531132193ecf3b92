#!/bin/bash
# One run, with PBS:   qsub pbs-single.sh
# Submitted again, it goes on from the newest checkpoint.
#PBS -N pgfmd
#PBS -l select=1:ncpus=16:mpiprocs=16:mem=32gb
#PBS -l walltime=24:00:00
#PBS -j oe

# Edit these four lines, and the resources above. WALLTIME: somewhat less than walltime.
PGFMD_HOME=${PGFMD_HOME:-$HOME/pgfmd}
RESULTS=${RESULTS:-out/tri-tack}
WALLTIME=${WALLTIME:-23:50:00}
set -- tri-tack.toml

cd "$PBS_O_WORKDIR" || exit 1
LAUNCH=${LAUNCH:-mpirun --hostfile $PBS_NODEFILE -n $(wc -l <"$PBS_NODEFILE")}
. "$PGFMD_HOME/jobs/batch.bash"
run_pgfmd "$@" --walltime "$WALLTIME" --out "$RESULTS"
