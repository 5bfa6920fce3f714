"""The wheel holds all that runs, and works in an environment of its own: README's first lines."""

import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

import kinetics

ROOT = Path(__file__).parents[1]
PACKAGES = ("kinetics", "mechsim", "calibration")
SHIPPED = {".py", ".toml", ".typed"}
NETWORK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A copy, so that nothing built lies about here."""
    source = tmp_path_factory.mktemp("source")
    for name in PACKAGES:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    for name in ("pyproject.toml", "wellmixed.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    return source


@pytest.fixture(scope="module")
def sdist(source, tmp_path_factory):
    """The source distribution."""
    out = tmp_path_factory.mktemp("sdist")
    act = f"from setuptools import build_meta; build_meta.build_sdist({str(out)!r})"
    subprocess.run([sys.executable, "-W", "ignore", "-c", act], cwd=source, check=True, capture_output=True)
    (built,) = out.glob("*.tar.gz")
    return built


@pytest.fixture(scope="module")
def wheel(sdist, tmp_path_factory):
    """Built from the source distribution, as where no wheel fits."""
    out = tmp_path_factory.mktemp("wheel")
    pip("wheel", "--no-deps", "--no-build-isolation", "-w", out, sdist)
    (built,) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """That of a new environment: the wheel, and the packages that it needs, but nothing of this checkout."""
    home = tmp_path_factory.mktemp("empty") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", home], check=True)
    scheme = sysconfig.get_path("purelib", "venv", {"base": str(home), "platbase": str(home)})
    Path(scheme, "needed.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    pip("--python", home, "install", "--no-deps", "--no-index", "--force-reinstall", wheel)
    return home / "bin" / "python"


def pip(*words):
    subprocess.run([sys.executable, "-m", "pip", "-q", "--disable-pip-version-check", *map(str, words)], check=True)


def said(python, folder, *words):
    """Standard output, from a folder without our sources."""
    return subprocess.run([python, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


def test_the_wheel_has_every_module_book_scene_and_table(wheel):
    kept = {name for name in zipfile.ZipFile(wheel).namelist() if name.startswith(PACKAGES)}
    files = [
        path for name in PACKAGES for path in (ROOT / name).rglob("*") if path.suffix in {".py", ".toml", ".typed"}
    ]
    assert len(files) > 500
    assert {str(path.relative_to(ROOT)) for path in files} <= kept


def test_the_c_kernels_are_built_where_a_compiler_is(wheel):
    assert any(name.startswith("kinetics/native/_native") for name in zipfile.ZipFile(wheel).namelist()) == bool(
        shutil.which("cc")
    )


def test_the_wheel_for_linux_runs_with_the_libc_that_its_name_promises(wheel, tmp_path):
    """`make dist` names glibc 2.17: no symbol that the library wants is newer."""
    promised = re.search(r"manylinux_(\d+)_(\d+)_", (ROOT / "Makefile").read_text("utf-8"))
    (library,) = (name for name in zipfile.ZipFile(wheel).namelist() if name.endswith(".so"))
    file = zipfile.ZipFile(wheel).extract(library, tmp_path)
    if not shutil.which("objdump"):
        pytest.skip("no binutils")
    wanted = subprocess.run(["objdump", "-T", file], check=True, capture_output=True, text=True).stdout
    versions = {tuple(map(int, each.split("."))) for each in re.findall(r"GLIBC_([\d.]+)", wanted)}
    assert versions
    assert max(versions) <= tuple(map(int, promised.groups()))


def test_the_conda_recipe_wants_what_the_package_wants():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    recipe = yaml.safe_load((ROOT / "packaging/recipe.yaml").read_text("utf-8"))
    python, *run = recipe["requirements"]["run"]
    assert python == f"python {project['project']['requires-python']}"
    assert [each.replace(" ", "") for each in run] == project["project"]["dependencies"]
    assert recipe["requirements"]["host"][2:] == [
        each.replace("==", " ==") for each in project["build-system"]["requires"]
    ]
    assert recipe["context"]["version"] == kinetics.__version__


def test_the_readmes_first_lines_run_in_an_empty_environment(python, tmp_path):
    here = said(python, tmp_path, "-c", "import kinetics; print(kinetics.__file__)").strip()
    assert Path(here).is_relative_to(python.parents[1])  # not this checkout
    first = NETWORK.search((ROOT / "README.md").read_text("utf-8"))[1]
    assert "Network.from_text" in first
    (tmp_path / "first.md").write_text(first, encoding="utf-8")
    assert said(python, tmp_path, "-m", "doctest", "first.md") == ""
    command = python.with_name("wellmixed")
    assert "4 species, 8 channels" in said(command, tmp_path, "rules", "derive", "line4")
    lines = said(
        command, tmp_path, *["predict", "line4", "--rates", "table3", "--cubes", "60", "--method", "transient"]
    )
    assert "method transient" in lines


def test_a_wrong_first_line_is_seen(python, tmp_path):
    """The control."""
    (tmp_path / "first.md").write_text(">>> 1 + 1\n3\n", encoding="utf-8")
    with pytest.raises(subprocess.CalledProcessError):
        said(python, tmp_path, "-m", "doctest", "first.md")
