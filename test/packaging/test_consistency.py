"""What is said twice about the package is said alike."""

import ast
import configparser
import importlib.metadata
import re
import sys
import tomllib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import stiction_ros
from stiction_ros.nodes.__main__ import NODES

ROOT = Path(__file__).resolve().parents[2]
# Python module → distribution in setup.cfg, where the names differ.
DISTRIBUTION = {"mcap_ros2": "mcap-ros2-support", "yaml": "pyyaml"}
# Imported where it is there; the package runs without.
OPTIONAL = {"asyncua", "cryptography", "dask", "distributed", "openpyxl", "pyarrow"}
# Distribution in setup.cfg → rosdep key in package.xml; the others are installed with pip.
ROSDEP = {
    "numpy": "python3-numpy",
    "pyyaml": "python3-yaml",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
}


def config() -> configparser.ConfigParser:
    parser = configparser.ConfigParser()
    parser.read(ROOT / "setup.cfg")
    return parser


def requirements(text: str) -> set[str]:
    """Return the names at the head of requirement lines, normalised."""
    heads = [re.match(r"[\w.-]+", line.strip()) for line in text.splitlines()]
    return {re.sub(r"[-_.]+", "-", head.group()).lower() for head in heads if head}


def manifest() -> ElementTree.Element:
    return ElementTree.parse(ROOT / "package.xml").getroot()


def studies() -> dict[str, Any]:
    text = (ROOT / "studies" / "pyproject.toml").read_text(encoding="utf-8")
    return dict(tomllib.loads(text)["project"])


def imports() -> set[str]:
    """Return the top-level modules that the package imports, its own and Python's left out."""
    found: set[str] = set()
    for path in (ROOT / "stiction_ros").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                found.add(node.module.partition(".")[0])
    return found - set(sys.stdlib_module_names) - {"stiction_ros"}


def test_version_is_the_same_everywhere() -> None:
    assert manifest().findtext("version") == stiction_ros.__version__
    assert importlib.metadata.version("stiction_ros") == stiction_ros.__version__
    assert studies()["version"] == stiction_ros.__version__


def test_manifest_agrees_with_setup() -> None:
    metadata = config()["metadata"]
    root = manifest()
    assert root.get("format") == "3"
    assert root.findtext("name") == metadata["name"]
    assert root.findtext("license") == metadata["license"]
    assert root.findtext("description") == metadata["description"]
    assert root.findtext("maintainer") == metadata["maintainer"]
    assert root.findtext("author") == metadata["author"]
    assert all(one.get("email") for one in root.findall("maintainer"))  # REP 149 asks for it
    assert root.findtext("export/build_type") == "ament_python"


def test_every_import_is_a_declared_dependency() -> None:
    base = requirements(config()["options"]["install_requires"])
    keys = {entry.text for entry in manifest().findall("exec_depend")}
    for module in sorted(imports()):
        if module in keys or module in OPTIONAL:  # a ROS package, or one of an extra
            continue
        distribution = DISTRIBUTION.get(module, module)
        assert distribution in base, f"{module} is imported and stands not in setup.cfg"


def test_every_rosdep_key_is_in_the_manifest() -> None:
    base = requirements(config()["options"]["install_requires"])
    keys = {entry.text for entry in manifest().findall("exec_depend")}
    assert {key for key in keys if key and key.startswith("python3-")} == set(ROSDEP.values())
    assert set(ROSDEP) <= base


def test_every_requirement_is_pinned_and_explained() -> None:
    extras = config()["options.extras_require"]
    wanted = requirements(config()["options"]["install_requires"])
    wanted |= requirements("\n".join(extras[name] for name in extras))
    wanted |= requirements("\n".join(studies()["dependencies"]))
    wanted -= {"stiction-ros"}
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    assert all("==" in line for line in lines if line and not line.startswith("#"))
    assert wanted <= requirements("\n".join(line for line in lines if "==" in line))
    document = (ROOT / "docs" / "dependencies.md").read_text()
    explained = {name.lower() for name in re.findall(r"^\| `([\w.-]+)", document, re.MULTILINE)}
    assert explained == wanted


def test_every_node_has_a_launcher() -> None:
    assert {path.name for path in (ROOT / "launchers").iterdir()} == {"node", *NODES}
