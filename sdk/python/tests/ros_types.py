"""Packages of ROS messages and services of which there is no wheel, made from their definitions by the generators of the wheels."""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

DOMAIN = 50 + os.getpid() % 50
"""A domain of ROS for the tests of this process: others that test on this machine would answer its calls."""
PREFIX = Path(sys.prefix)
"""Where the wheels put headers, libraries and the index of packages."""
USED = ("std_msgs", "geometry_msgs", "builtin_interfaces", "service_msgs")
"""Packages that definitions may refer to."""
SERIALIZED = "rosidl_typesupport_fastrtps_c"
"""The only way of writing messages that is built: without a choice, nothing is looked for when the package is used."""


def missing_tools() -> str:
    """What has to be installed before packages or programs can be built, or nothing."""
    if not (shutil.which("gcc") and shutil.which("g++")):
        return "there is no compiler: install gcc and g++"
    if not (PREFIX / "include" / "rcl").is_dir():
        return f"there are no headers of ROS 2 in {PREFIX / 'include'}: `pip install 'cars-simulator[ros]'`"
    return ""


def includes() -> list[str]:
    """Arguments by which a compiler finds the headers of ROS."""
    folder = PREFIX / "include"
    return [f"-I{folder}", *(f"-I{path}" for path in sorted(folder.iterdir()) if path.is_dir())]


def build(folder: Path, package: str, definitions: dict[str, str]) -> None:
    """Makes ``folder/package``, which Python can import.

    ``definitions`` are texts by file names, such as ``msg/TFMessage.msg``. A process of its own generates: the generators read the
    environment when they are imported.
    """
    made = folder / package
    for name, text in definitions.items():
        file = made / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    environment = {**os.environ, "AMENT_PREFIX_PATH": str(PREFIX)}
    command = [sys.executable, __file__, str(folder), package, *definitions]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    _compile(folder, package)


def _generate(folder: Path, package: str, names: list[str]) -> None:
    """Generates Python and C. The command ``rosidl generate`` of the wheels does not start: they list each of its extensions twice,
    and lack catkin_pkg."""
    made = folder / package
    idl = []
    for name in names:
        kind = Path(name).suffix[1:]
        convert = getattr(importlib.import_module(f"rosidl_adapter.{kind}"), f"convert_{kind}_to_idl")
        convert(made, package, Path(name), made / kind)
        idl.append(f"{made}:{Path(name).with_suffix('.idl')}")

    stems = [Path(name).with_suffix("") for name in names]
    share = PREFIX / "share"
    packages = [f"{one}:{share / one}" for one in USED] + [f"{package}:{made}"]
    generators = {
        "rosidl_generator_type_description": ("generate_type_hash", []),
        "rosidl_generator_c": ("generate_c", []),
        "rosidl_typesupport_c": ("generate_c", [[SERIALIZED]]),
        "rosidl_typesupport_fastrtps_c": ("generate_typesupport_fastrtps_c", []),
        "rosidl_generator_py": ("generate_py", [["rosidl_typesupport_c"]]),
    }
    for generator, (function, more) in generators.items():
        templates = share / generator / "resource"
        arguments = made / f"{generator}.json"
        given = {
            "package_name": package,
            "output_dir": str(made),
            "template_dir": str(templates),
            "idl_tuples": idl,
            "ros_interface_files": [f"{made}/{name}" for name in names],
            "include_paths": packages,
            "ros_interface_dependencies": [],
            "target_dependencies": [],
            "type_description_tuples": [f"{stem}.idl:{made / stem}.json" for stem in stems],
        }
        arguments.write_text(json.dumps(given))
        getattr(importlib.import_module(generator), function)(str(arguments), *more)
        for template in templates.glob("*visibility_control.h.in"):
            upper = template.read_text().replace("@PROJECT_NAME_UPPER@", package.upper()).replace("@PROJECT_NAME@", package)
            (made / "msg" / template.name.removesuffix(".in")).write_text(upper)
    (made / "__init__.py").touch()


def _compile(folder: Path, package: str) -> None:
    """Makes one extension module of all that is C and C++ in the package."""
    made = folder / package
    # Most of the time goes into headers: what can be is one file. Descriptions of types have names of their own, each the same.
    together = {suffix: made / f"all{suffix}" for suffix in (".c", ".cpp")}
    descriptions = sorted(made.rglob("*__description.c"))
    for suffix, file in together.items():
        sources = sorted(set(made.rglob(f"*{suffix}")).difference(descriptions))
        file.write_text("".join(f'#include "{source}"\n' for source in sources))
    sources = [*together.values(), *descriptions]

    numpy = importlib.import_module("numpy").get_include()
    headers = [f"-I{folder}", f"-I{sysconfig.get_path('include')}", f"-I{numpy}", *includes()]
    parts = ("generator_c", "generator_py", "typesupport_c", "typesupport_fastrtps_c")
    libraries = [f"-l{one}__rosidl_{part}" for one in USED for part in parts]
    libraries += ["-lrosidl_runtime_c", "-lrosidl_typesupport_c", f"-l{SERIALIZED}", "-lfastcdr", "-lrcutils", "-lrmw", "-lstdc++"]
    module = made / f"{package}_s__rosidl_typesupport_c.so"
    # The compiler of C takes each file as what its suffix says, where that of C++ takes all as C++.
    command = ["gcc", "-shared", "-fPIC", "-O0", "-w", "-o", str(module), *headers, *map(str, sources)]
    command += [f"-L{PREFIX / 'lib'}", *libraries]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stderr}"


if __name__ == "__main__":
    _generate(Path(sys.argv[1]), sys.argv[2], sys.argv[3:])
