"""Imports run one way, sizes are capped, the public names are exactly the public names."""

import ast
import importlib
import pkgutil
import subprocess
import sys
from configparser import ConfigParser
from graphlib import TopologicalSorter
from pathlib import Path

import grimp
import pytest

import etnet

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path for package in ("etnet", "app") for path in (ROOT / package).rglob("*.py"))

PUBLIC = {
    "open_recording", "Recording", "Events", "Sensor", "GroundTruth", "Triggers",
    "plan_windows", "Window", "BetweenFrames", "ByCount", "ByDuration", "ByDensity",
    "ByCountOrDuration", "ByActivity", "ByStamps",
    "voxel_grid", "load_model", "build_model", "State", "Step",
    "Attention", "AttentionProbe", "Intervention", "EventEdit",
    "reconstruct", "Playback",
    "EtnetError", "RecordingError", "WindowError", "ModelError", "WeightsError", "Cancelled",
}  # fmt: skip


def test_public_names_are_exactly_these_and_each_loads():
    assert set(etnet.__all__) == PUBLIC
    for name in PUBLIC:
        assert callable(getattr(etnet, name))
    with pytest.raises(AttributeError, match="nonsense"):
        _ = etnet.nonsense


def test_imports_run_one_way():
    code = "import sys; from importlinter.cli import lint_imports_command; lint_imports_command()"
    command = [sys.executable, "-c", code, "--config", str(ROOT / ".importlinter"), "--no-cache"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_no_module_depends_on_itself_by_others():
    """Imports for types and within functions count."""
    graph = grimp.build_graph("etnet", "app", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) - {module} for module in graph.modules}
    TopologicalSorter(imports).prepare()  # raises CycleError with the circle


def test_every_module_stands_in_a_layer():
    contract = ConfigParser()
    contract.read(ROOT / ".importlinter")
    layers = {name for name in contract["importlinter:contract:layers"]["layers"].split() if name != ":"}
    roots = {"etnet", "app", "etnet.__main__", "app.__main__"}
    graph = grimp.build_graph("etnet", "app", cache_dir=None)
    for module in graph.modules - roots:
        assert any(module == layer or module.startswith(f"{layer}.") for layer in layers), f"{module} is in no layer"


TAKES_HOME = ("app.views.demo.jobs", "app.views.export.jobs")
"""The page that a visitor of the demo takes home is an export."""


def test_a_view_knows_of_another_one_its_state_at_most():
    graph = grimp.build_graph("etnet", "app", cache_dir=None)
    views = {f"app.views.{path.parent.name}" for path in (ROOT / "app" / "views").glob("*/__init__.py")}
    assert len(views) > 12
    owner = {name: view for view in views for name in graph.find_descendants(view) | {view}}
    across = [
        (importer, imported)
        for importer, view in owner.items()
        for imported in graph.find_modules_directly_imported_by(importer)
        if owner.get(imported, view) != view
    ]
    assert across
    assert {edge for edge in across if edge[1] != f"{owner[edge[1]]}.state"} == {TAKES_HOME}


def test_the_session_names_no_view_but_the_demo_that_it_leads():
    graph = grimp.build_graph("etnet", "app", cache_dir=None)
    contract = {"app.views", "app.views.view", "app.views.page", "app.views.panel"}
    imported = {
        name
        for module in graph.find_descendants("app.session") | {"app.web", "app.state", "app.engine"}
        for name in graph.find_modules_directly_imported_by(module)
        if name.startswith("app.views")
    }
    assert imported - contract == {"app.views.demo.state"}


@pytest.mark.parametrize("package", ["etnet", "app"])
def test_importing_a_package_loads_neither_torch_nor_viser(package: str):
    code = f"import sys, {package}; print([m for m in ('torch', 'viser', 'h5py', 'cv2') if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_every_module_imports():
    for package in ("etnet", "app"):
        for module in pkgutil.walk_packages([str(ROOT / package)], f"{package}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_sizes_are_capped(path: Path):
    text = path.read_text()
    assert len(text.splitlines()) <= 400, "a file has one subject"
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            length = (node.end_lineno or node.lineno) - node.lineno + 1
            cap = 40 if node.name == "forward" else 60
            assert length <= cap, f"{node.name} has {length} lines, at most {cap} fit a screen"


def test_no_module_is_a_drawer_for_odds_and_ends():
    assert not {path.stem for path in SOURCES} & {"utils", "util", "misc", "helpers", "common", "v2", "legacy"}
