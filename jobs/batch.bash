# shellcheck shell=bash
# What the job scripts of this folder share, and source. Settings from the environment:
#   PGFMD_HOME       where pgfmd is
#   LAUNCH           how the ranks are started (default: mpirun, a rank for each task of the job)
#   NUMBA_CACHE_DIR  where compiled loops are kept (default: a folder of this user on a disk of the node; empty: beside
#                    pgfmd's sources)
#   LINKS            how often a chain may start, for `end_link` (default: 100)

note() { printf 'job: %s\n' "$*"; }

# Bash ends on a signal that it has no trap for, and Slurm then kills what the job still runs.
ranks=
trap '[ -z "$ranks" ] || kill -USR1 "$ranks"' USR1
trap '[ -z "$ranks" ] || kill -USR2 "$ranks"' USR2
trap : TERM

# shellcheck source=../scripts/environment
. "$PGFMD_HOME/scripts/environment" || { note "PGFMD_HOME=$PGFMD_HOME: pgfmd is not ready there" >&2; exit 1; }

if [ -z "${NUMBA_CACHE_DIR+set}" ]; then
    NUMBA_CACHE_DIR=${TMPDIR:-/tmp}/pgfmd-numba-$(id -u)
    export NUMBA_CACHE_DIR
    # A cache holds programs: use none that somebody else has put there.
    if ! (umask 077 && mkdir -p "$NUMBA_CACHE_DIR") || [ ! -O "$NUMBA_CACHE_DIR" ]; then
        NUMBA_CACHE_DIR=$(mktemp -d)
    fi
fi
# Ranks are bound to cores where the job sees no other cores than its own. Elsewhere two jobs on a node would be bound
# to the same ones. (nproc counts what this process may use; but with OMP_NUM_THREADS set it says that.)
if [ "$(env -u OMP_NUM_THREADS -u OMP_THREAD_LIMIT nproc)" != "${SLURM_CPUS_ON_NODE:-${NCPUS:-0}}" ]; then
    export OMPI_MCA_hwloc_base_binding_policy="${OMPI_MCA_hwloc_base_binding_policy:-none}"
fi

# run_pgfmd ARGUMENTS...: `pgfmd run` on all ranks, and its exit code. USR1 (stop) and USR2 (checkpoint) go from this
# shell to mpirun or srun, and from there to every rank.
run_pgfmd() {
    local code argument kept=()
    for argument in "$@"; do
        # Later links go on with what the first one has begun, and so does a job that Slurm has queued again by itself.
        if [ "$argument" != --fresh ] || [ "$((${SLURM_RESTART_COUNT:-0} + ${LINK:-1}))" = 1 ]; then kept+=("$argument"); fi
    done
    # shellcheck disable=SC2086
    ${LAUNCH:-mpirun -n ${SLURM_NTASKS:-1}} pgfmd run "${kept[@]}" &
    ranks=$!
    # A signal ends `wait`, not the ranks.
    while kill -0 "$ranks" 2>/dev/null; do wait "$ranks"; done
    wait "$ranks"
    code=$?
    ranks=
    case $code in
        0) note "finished" ;;
        75) note "stopped early with a checkpoint (exit code 75): submitted again, it goes on" ;;
        *) note "failed with exit code $code; the reason is above" ;;
    esac
    return "$code"
}

# end_link CODE: the end of a link of a chain. After 75 Slurm puts this very job back into its queue; else the job ends.
end_link() {
    local code=$1 link=$((${SLURM_RESTART_COUNT:-0} + 1)) links=${LINKS:-100}
    # The number of one task of an array may also stand for the whole array.
    local job=${SLURM_ARRAY_JOB_ID:+${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID}
    if [ "$code" != 75 ]; then
        note "the chain ends with link $link"
    elif [ "$link" -ge "$links" ]; then
        note "the chain ends with link $link, the last that LINKS=$links allows"
    else
        note "link $link ends, the job is queued again"
        scontrol requeue "${job:-$SLURM_JOB_ID}" || note "scontrol could not queue the job again: submit it by hand"
    fi
    exit "$code"
}
