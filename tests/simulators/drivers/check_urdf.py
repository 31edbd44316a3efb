"""check_urdf of urdfdom, the parser of ROS. It returns 0 where it has printed an error: its words are read."""

import os
import shutil
import subprocess

from definition import Reader, all_but

from .text import FILES


class Urdf(Reader):
    format, simulator = "URDF", "check_urdf"
    cannot = all_but({1}, "only parses")
    # Where install.py unpacked it, if it is not on the path.
    folder = None

    def __init__(self, twin):
        own = self.folder / "usr/bin/check_urdf" if self.folder else None
        command = str(own) if own and own.exists() else shutil.which("check_urdf")
        libraries = [str(p) for p in self.folder.glob("usr/lib/*")] if own and own.exists() else []
        paths = ":".join([*libraries, os.environ.get("LD_LIBRARY_PATH", "")])
        result = subprocess.run(
            [command, twin.folder / FILES["URDF"]],
            capture_output=True,
            text=True,
            env={**os.environ, "LD_LIBRARY_PATH": paths},
        )
        said = (result.stdout + result.stderr).splitlines()
        complaints = [line for line in said if "rror" in line or "arning" in line]
        self.warnings = "\n".join(complaints or ([f"exit code {result.returncode}"] if result.returncode else []))


def missing(folder):
    """Why it cannot run."""
    Urdf.folder = folder
    found = (folder and (folder / "usr/bin/check_urdf").exists()) or shutil.which("check_urdf")
    return None if found else "no check_urdf (Debian: liburdfdom-tools)"


READERS = [Urdf]
