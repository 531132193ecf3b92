"""MPI launchers: whether one has started this process, and which variables must not be passed to another. No MPI."""

from __future__ import annotations

import os

PROGRAMS = ("mpi", "orte", "orted", "prte", "hydra", "pmi", "slurmstepd", "palsd")
"""Parts of the names of programs that start ranks."""
COUNTS = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("MV2_COMM_WORLD_SIZE", "MV2_COMM_WORLD_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
)
"""Variables in which launchers give the number of processes and the rank."""
LEFT_BEHIND = (
    "OMPI_COMM_", "OMPI_APP_CTX_", "OMPI_FILE_LOCATION", "OMPI_UNIVERSE_SIZE", "OMPI_COMMAND", "OMPI_ARGV",
    "OMPI_NUM_APP_CTX", "OMPI_FIRST_RANKS", "OMPI_MCA_ess", "OMPI_MCA_initial_wdir", "OMPI_MCA_orte_ess_",
    "OMPI_MCA_orte_hnp_uri", "OMPI_MCA_orte_launch", "OMPI_MCA_orte_local_daemon_uri", "OMPI_MCA_orte_num_nodes",
    "OMPI_MCA_orte_precondition_transports", "OMPI_MCA_pmix", "OMPI_MCA_shmem_RUNTIME_QUERY_hint", "ORTE_", "PRTE_",
    "PMIX_", "PMI_", "HYDRA_", "HYDI_",
)  # fmt: skip
"""Prefixes of variables that a launcher, or a process that has initialised MPI, passes to its children, and that a
launcher started by these must not see. Settings of users (`OMPI_MCA_...`) are not among them."""


def launched() -> tuple[int, int]:
    """(number of processes, rank) from the launcher's variables; (1, 0) without a launcher."""
    for size, rank in COUNTS:
        if os.environ.get(size, "").isdecimal() and os.environ.get(rank, "0").isdecimal():
            return int(os.environ[size]), int(os.environ.get(rank, "0"))
    return 1, 0


def is_launched() -> bool:
    """Whether a launcher has started this process, even if it is a single one."""
    return any(size in os.environ for size, _ in COUNTS)


def environment_without() -> dict[str, str]:
    """This process's environment without those variables, for a launcher that it starts."""
    return {name: value for name, value in os.environ.items() if not name.startswith(LEFT_BEHIND)}
