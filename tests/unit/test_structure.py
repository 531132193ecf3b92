"""What imports what, and how long things are."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import pgfmd
from pgfmd.physics.adhesion.registry import LAWS
from pgfmd.schemes import registry

PACKAGE = Path(pgfmd.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))


def dotted(file):
    """The name by which a file of the package is imported."""
    return ".".join(("pgfmd", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")


NAMES = {file: dotted(file) for file in FILES}
NODES = {file: list(ast.walk(ast.parse(file.read_text(encoding="utf-8")))) for file in FILES}

LONGEST_FILE, LONGEST_FUNCTION = 500, 60

PLAIN = ["units", "errors", "reference", *(f"physics.{path.stem}" for path in (PACKAGE / "physics").glob("[a-z]*.py")),
         "physics.adhesion.registry", "schemes.registry", "schemes.gfmd.inertia", "characterisation.dma",
         "characterisation.prony_fit",
         "characterisation.temperature_shift"]  # fmt: skip
READERS = ["results", *(f"plots.{path.stem}" for path in (PACKAGE / "plots").glob("[a-z]*.py")),
           "characterisation.rheology_table", "commands.fit_prony", "analysis.summary", "analysis.bearing_area",
           "studies.campaign", "studies.slurm_array", "studies.pictures", "studies.extrapolation", "studies.refinement", "studies.study",
           "analysis.comparison", "commands.plot",
           "commands.study"]  # fmt: skip
HEAVY = ("mpi4py", "mpi4py_fft", "h5py", "numba")


class _WithoutTypes(ast.NodeTransformer):
    """Leaves out what is imported for type checkers alone."""

    def visit_If(self, node):
        return None if ast.unparse(node.test) == "TYPE_CHECKING" else self.generic_visit(node)


def imported_by(file):
    """Names of the modules that a file imports anywhere, functions included."""
    found = set()
    for node in ast.walk(_WithoutTypes().visit(ast.parse(file.read_text(encoding="utf-8")))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            package = NAMES[file].split(".")
            package = package if file.name == "__init__.py" else package[:-1]
            start = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*start, *([node.module] if node.module else [])])
            found |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    return found


IMPORTS = {NAMES[file]: imported_by(file) for file in FILES}


def first_loaded(modules, heavy):
    """The first of these modules, imported one after the other in a fresh interpreter, with which one of the heavy ones is loaded,
    and which; empty if none is."""
    program = f"""
import importlib, sys
for name in {[f"pgfmd.{module}" for module in modules]}:
    importlib.import_module(name)
    found = [one for one in sys.modules if any(one == heavy or one.startswith(heavy + ".") for heavy in {list(heavy)})]
    if found:
        sys.exit(f"{{name}} loads {{found[0]}}")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 or " loads " in done.stderr, done.stderr
    return done.stderr


def test_plain_modules_know_no_mpi_no_hdf5_and_no_scene():
    assert first_loaded(PLAIN, (*HEAVY, "pgfmd.scene", "pgfmd.scene_objects")) == ""
    assert first_loaded(["files.storage", "scene"], ("pgfmd.scene",)).startswith("pgfmd.scene loads pgfmd.scene")


def test_analysis_and_plots_know_no_mpi():
    assert first_loaded(READERS, ("mpi4py", "mpi4py_fft", "pgfmd.solver.simulation", "pgfmd.solver.transform")) == ""


def test_reports_and_watching_know_no_mpi():
    modules = (
        "commands.report",
        "commands.watch",
        "reporting.run_page",
        "reporting.study_page",
        "watching.server",
        "watching.terminal",
    )
    assert first_loaded(modules, ("mpi4py", "mpi4py_fft")) == ""


def test_reading_a_scene_needs_no_mpi():
    assert first_loaded(["scene"], HEAVY) == ""


def test_one_module_alone_computes_with_mpi4py_fft():
    users = {name for name, modules in IMPORTS.items() if any(m.split(".")[0] == "mpi4py_fft" for m in modules)}
    # The doctor asks whether it is there, and computes nothing with it.
    assert users - {"pgfmd.host.doctor"} == {"pgfmd.solver.transform"}


def test_nothing_imports_the_command_line():
    users = {name for name, modules in IMPORTS.items() if any(m.startswith("pgfmd.cli") for m in modules)}
    assert users <= {"pgfmd.__main__"}


def test_what_a_scheme_can_do_is_told_without_loading_it():
    assert first_loaded([f"schemes.{name}.plugin" for name in registry.names()], HEAVY) == ""


def test_no_module_outside_the_schemes_names_one():
    """They ask the registry what a scheme can do: no comparison, and no table, with the name of one."""
    for file in FILES:
        if "schemes" not in file.relative_to(PACKAGE).parts:
            for node in NODES[file]:
                named = isinstance(node, ast.Constant) and node.value in registry.names()
                assert not named, f"{file}, line {node.lineno}: ask pgfmd.schemes.registry what {node.value} can do"


def is_plugin(module):
    """Whether a module is the part of a scheme that knows scenes, or the entry or the registry that name it."""
    return module.startswith("pgfmd.schemes.") and module.split(".")[-1] in ("plugin", "entry", "registry")


def test_the_core_knows_no_scene_and_no_files():
    """Only what puts a run together knows how scenes are written and where results go."""
    known = ("errors", "hashing", "physics", "solver", "files.packing")
    for core in (
        name for name in IMPORTS if name.startswith(("pgfmd.solver", "pgfmd.schemes")) and not is_plugin(name)
    ):
        allowed = (*known, "schemes") if core.startswith("pgfmd.schemes") else known
        own = {module for module in IMPORTS[core] if module.startswith("pgfmd.")}
        assert all(module.startswith(tuple(f"pgfmd.{other}" for other in allowed)) for module in own), core


def test_no_law_of_adhesion_is_known_by_name():
    """Elsewhere it is asked what a law can do: a new one is its module and a line of the registry."""
    for file in (file for file in FILES if "adhesion" not in file.parts):
        for node in NODES[file]:
            if isinstance(node, ast.Compare) and "law" in ast.unparse(node):
                words = {part.value for part in ast.walk(node) if isinstance(part, ast.Constant)}
                assert words.isdisjoint(LAWS), f"{file}:{node.lineno}"


def test_no_folder_needs_one_that_needs_it():
    """Folders of the package stand on each other in one order. What a scheme can do is known to all, and loads none of it."""
    facts = {"pgfmd.schemes", "pgfmd.schemes.entry", "pgfmd.schemes.registry"}
    facts |= {f"pgfmd.schemes.{name}" for name in registry.names()}

    def folder(module):
        known = module in facts or (module.rpartition(".")[0] in facts and module not in IMPORTS)
        return "facts of schemes" if known else module.split(".")[1]

    needs = {folder(name): set() for name in IMPORTS if name != "pgfmd"}
    for name in IMPORTS.keys() - {"pgfmd"}:
        others = {folder(other) for other in IMPORTS[name] if other.startswith("pgfmd.")}
        needs[folder(name)] |= (others & needs.keys()) - {folder(name)}
    order = graphlib.TopologicalSorter(needs)
    order.prepare()


def test_no_module_needs_one_that_needs_it():
    """Nor do the modules that read, measure, draw and compare results, in whichever way they import each other."""
    ours = tuple(
        f"pgfmd.{name}."
        for name in ("files", "output", "results", "plots", "analysis", "studies", "benchmark", "reporting", "watching")
    )
    modules = {name for name in IMPORTS if name.startswith(ours)}
    graphlib.TopologicalSorter({name: IMPORTS[name] & modules - {name} for name in modules}).prepare()


def test_no_numbers_come_from_pictures():
    """What draws is asked for the manner of drawing alone."""
    for name, modules in IMPORTS.items():
        if name.startswith(("pgfmd.analysis", "pgfmd.studies", "pgfmd.benchmark")):
            drawn = {module for module in modules if module.startswith("pgfmd.plots.")}
            assert all(module.startswith("pgfmd.plots.drawing") for module in drawn), name


def test_closed_forms_import_nothing_of_the_solver():
    allowed = ("pgfmd.reference", "pgfmd.physics.rheology", "pgfmd.physics.adhesion")
    for name, modules in IMPORTS.items():
        if name.startswith("pgfmd.reference"):
            assert all(module.startswith(allowed) for module in modules if module.startswith("pgfmd")), name


def test_files_and_functions_stay_short():
    for file, nodes in NODES.items():
        assert len(file.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE, file
        for node in nodes:
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                length = node.end_lineno - node.lineno + 1
                assert length <= LONGEST_FUNCTION, f"{file}: {node.name} has {length} lines"
