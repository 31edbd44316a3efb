"""Installs the simulators of matrix.py into a folder of their own, from PyPI, npm and Debian.

    python3 tests/simulators/install.py DIR [--require]
    DIR/python/bin/python tests/simulators/matrix.py TWIN_DIR...

About 2 GB and two minutes; what is there already, at the same versions, is kept, and the system is left alone. What
cannot be installed is reported as "cannot run: reason"; with --require that is exit code 1. What is optional
(requirements-optional.txt) is "left out: reason" and no failure: its wheels are not there for every machine.
"""

import argparse
import pathlib
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
# check_urdf and the libraries it needs; what the system has of them is not fetched.
DEBIAN = "liburdfdom-tools"


def run(*command, cwd=None):
    """Runs a command; the end of its words is the error."""
    result = subprocess.run([str(c) for c in command], cwd=cwd, capture_output=True, text=True)
    if result.returncode:
        words = (result.stderr or result.stdout).strip().splitlines()[-2:]
        raise RuntimeError(f"{command[0]} {command[1] if len(command) > 1 else ''}: {' | '.join(words)}")
    return result.stdout


def pip_of(folder):
    """The command that installs into an environment."""
    return [folder / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]


def environment(folder, requirements):
    """A virtual environment; one package that fails does not take the others with it."""
    run(sys.executable, "-m", "venv", "--clear", folder)
    # What was added to it is gone with the old one.
    (folder.parent / "optional.installed").unlink(missing_ok=True)
    pip = pip_of(folder)
    try:
        run(*pip, "-r", requirements)
    except RuntimeError:
        lines = [line for line in requirements.read_text().splitlines() if line.strip() and not line.startswith("#")]
        failed = []
        for line in lines:
            try:
                run(*pip, line)
            except RuntimeError as error:
                failed.append(f"{line} ({error})")
        if failed:
            raise RuntimeError("; ".join(failed)) from None


def optional(folder, requirements):
    """What few machines may lack: added to the environment of the drivers."""
    run(*pip_of(folder.parent / "python"), "-r", requirements)


def node(folder, package):
    """npm packages; none of their install scripts is run."""
    if not shutil.which("npm"):
        raise RuntimeError("no npm")
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(package, folder / "package.json")
    run("npm", "install", "--ignore-scripts", "--no-audit", "--no-fund", cwd=folder)


def debian(folder, _):
    """Debian packages unpacked without installing them."""
    if shutil.which("check_urdf"):
        return
    if not shutil.which("apt-get"):
        raise RuntimeError(f"no apt-get, and no check_urdf ({DEBIAN}) on the path")
    folder.mkdir(parents=True, exist_ok=True)
    plan = ["apt-get", "install", "--print-uris", "-qq", "--no-install-recommends", DEBIAN]
    try:
        uris = run(*plan)
    except RuntimeError:
        run("apt-get", "update", "-qq")
        uris = run(*plan)
    # 'URI' name_version_arch.deb size hash
    names = [line.split()[1].split("_")[0] for line in uris.splitlines() if line.startswith("'")]
    run("apt-get", "download", "-qq", *names, cwd=folder)
    for package in folder.glob("*.deb"):
        run("dpkg", "-x", package, folder)


STEPS = (
    ("python", environment, HERE / "requirements.txt"),
    ("optional", optional, HERE / "requirements-optional.txt"),
    ("usd", environment, HERE / "requirements-usd.txt"),
    ("node", node, HERE / "package.json"),
    ("debian", debian, HERE / "install.py"),
)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folder", type=pathlib.Path, metavar="DIR")
    arguments.add_argument("--require", action="store_true", help="what cannot be installed is a failure")
    args = arguments.parse_args()
    failed = False
    for name, install, wanted in STEPS:
        folder, stamp = args.folder.resolve() / name, args.folder.resolve() / f"{name}.installed"
        if stamp.exists() and stamp.read_text() == wanted.read_text():
            print(f"{name}: there already")
            continue
        try:
            install(folder, wanted)
        except (RuntimeError, OSError) as error:
            is_needed = name != "optional"
            print(f"{name}: {'cannot run' if is_needed else 'left out'}: {error}")
            failed = failed or is_needed
        else:
            stamp.write_text(wanted.read_text())
            print(f"{name}: installed")
    return 1 if failed and args.require else 0


if __name__ == "__main__":
    sys.exit(main())
