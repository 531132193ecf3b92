#!/bin/bash
# A run that is longer than a job may last, with PBS:   qsub pbs-chain.sh
# Before its time is over it writes a checkpoint, and the next job is submitted, until the run is finished.
#PBS -N pgfmd
#PBS -l select=1:ncpus=16:mpiprocs=16:mem=32gb
#PBS -l walltime=24:00:00
#PBS -j oe

# Edit these six lines, and the resources above. WALLTIME: somewhat less than walltime. SCRIPT: this file.
PGFMD_HOME=${PGFMD_HOME:-$HOME/pgfmd}
RESULTS=${RESULTS:-out/tri-tack}
WALLTIME=${WALLTIME:-23:50:00}
SCRIPT=${SCRIPT:-pbs-chain.sh}
LINKS=${LINKS:-100}
set -- tri-tack.toml

cd "$PBS_O_WORKDIR" || exit 1
LAUNCH=${LAUNCH:-mpirun --hostfile $PBS_NODEFILE -n $(wc -l <"$PBS_NODEFILE")}
. "$PGFMD_HOME/jobs/batch.bash"
run_pgfmd "$@" --walltime "$WALLTIME" --out "$RESULTS"
code=$?
LINK=${LINK:-1}
if [ "$code" = 75 ] && [ "$LINK" -lt "$LINKS" ]; then
    note "link $LINK ends, the next is submitted"
    settings=PGFMD_HOME=$PGFMD_HOME,RESULTS=$RESULTS,WALLTIME=$WALLTIME,SCRIPT=$SCRIPT,LINKS=$LINKS
    qsub -v "$settings,LINK=$((LINK + 1))" "$SCRIPT" || note "qsub could not submit the next link: submit it by hand"
else
    note "the chain ends with link $LINK"
fi
exit "$code"
