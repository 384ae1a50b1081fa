"""Shared libraries of C sources: for every system by ziglang where that is installed, else for this one."""

from __future__ import annotations

import importlib.util
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ..base.errors import PowertrainError


class Target(NamedTuple):
    """A system: its name, that of ziglang, folders in an FMU of version 2.0 and 3.0, how libraries end."""

    name: str
    zig: str
    folder_2: str
    folder_3: str
    suffix: str

    def folder(self, version: str) -> str:
        return self.folder_2 if version == "2.0" else self.folder_3


# Of FMI 2.0 only those with three folders exist.
TARGETS = (
    Target("linux", "x86_64-linux-gnu.2.17", "linux64", "x86_64-linux", ".so"),
    Target("windows", "x86_64-windows-gnu", "win64", "x86_64-windows", ".dll"),
    Target("macos", "x86_64-macos", "darwin64", "x86_64-darwin", ".dylib"),
    Target("macos_arm", "aarch64-macos", "", "aarch64-darwin", ".dylib"),
    Target("linux_arm", "aarch64-linux-gnu.2.17", "", "aarch64-linux", ".so"),
)
FLAGS = ["-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off"]
# A first build for a system makes its libraries besides [s].
LONGEST_BUILD = 900.0


def this_system() -> str | None:
    """Name of the target that this computer is, if it is one."""
    arm = platform.machine().lower() in ("arm64", "aarch64")
    names = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}
    name = names.get(platform.system())
    if name is None or (not arm and platform.machine().lower() not in ("x86_64", "amd64")):
        return None
    return f"{name}_arm" if arm else name


def found_compilers() -> dict[str, list[str]]:
    """Command by target: of ziglang for all, else of the compiler that is found here for this system alone."""
    if importlib.util.find_spec("ziglang") is not None:
        return {target.name: [sys.executable, "-m", "ziglang", "cc", "-target", target.zig] for target in TARGETS}
    here, command = this_system(), next(filter(None, map(shutil.which, ("gcc", "cc", "clang"))), None)
    return {here: [command]} if here is not None and command is not None else {}


def libraries(source: str, name: str, version: str, systems: Sequence[str] | None) -> dict[str, bytes]:
    """Path in the FMU to library: for these systems, or for all that the compilers found make if None.

    Raises
    ------
    PowertrainError
        A system for which there is no compiler, or one that fails.
    """
    commands = found_compilers()
    known = {target.name: target for target in TARGETS if target.folder(version)}
    wanted = [name for name in known if name in commands] if systems is None else list(systems)
    for system in wanted:
        if system not in known:
            raise PowertrainError(f'systems has "{system}", permitted in FMI {version}: {", ".join(known)}')
        if system not in commands:
            raise PowertrainError(
                f"there is no compiler for {system} here; pip install ziglang makes libraries for all systems, systems=() "
                "writes the sources only"
            )
    made = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.c"
        file.write_text(source, encoding="utf-8")
        for system in wanted:
            target = known[system]
            library = file.with_name(f"{name}_{system}{target.suffix}")
            _build(commands[system], file, library, target)
            made[f"binaries/{target.folder(version)}/{name}{target.suffix}"] = library.read_bytes()
    return made


def _build(command: Sequence[str], file: Path, library: Path, target: Target) -> None:
    flags = [flag for flag in FLAGS if not (flag == "-fPIC" and target.name == "windows")]
    try:
        done = subprocess.run(
            [*command, *flags, "-o", str(library), str(file), "-lm"],
            cwd=file.parent,
            capture_output=True,
            text=True,
            timeout=LONGEST_BUILD,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise PowertrainError(f"the compiler for {target.name} cannot be run: {error}") from error
    if done.returncode or not library.exists():
        first = (done.stderr.strip() or "no message").splitlines()[0]
        raise PowertrainError(f"the compiler for {target.name} fails: {first}")
