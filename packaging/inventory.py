#!/usr/bin/env python3
"""What the programs are made of: an SBOM (CycloneDX 1.6, JSON) and the licenses of all parts with their texts.

    packaging/inventory.py FOLDER        writes FOLDER/sbom.cdx.json and FOLDER/THIRD-PARTY.txt

It reads Cargo.lock, the packages that cargo has on this machine, and the lists of vendored files (the console's page, the fonts of
figures), and needs no network after a build. The same sources give the same bytes, but for the time, which SOURCE_DATE_EPOCH sets.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import time
import tomllib
import uuid

ROOT = pathlib.Path(__file__).resolve().parents[1]
PACKAGES = {"cars", "console", "robots", "simulator"}  # of the programs
TARGET = "x86_64-unknown-linux-gnu"
# Folders of files from other projects, and where these are found.
VENDORED = {
    ROOT / "crates" / "console" / "assets" / "vendor": "pkg:npm/",
    ROOT / "crates" / "pictures" / "fonts": "pkg:github/liberationfonts/",
}
LICENSE_FILES = re.compile(r"(un)?licen[sc]e|copying|copyright|notice", re.IGNORECASE)
CODE = {".c", ".h", ".json", ".rs", ".toml", ".yml"}


def metadata():
    """The packages of the workspace and all that they depend on."""
    command = ["cargo", "metadata", "--format-version=1", "--offline", "--locked", "--filter-platform", TARGET]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)


def compiled():
    """Names and versions of what is compiled for the programs. `cargo metadata` has optional dependencies that no feature asks for."""
    command = ["cargo", "tree", "--offline", "--locked", "--target", TARGET, "-e", "normal,build", "--prefix", "none"]
    for package in PACKAGES:
        command += ["-p", f"path+file://{ROOT}/crates/{package}"]
    tree = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    return {(name, version) for name, version in re.findall(r"^(\S+) v(\S+)", tree, re.MULTILINE)}


def reach(graph, roots, kinds):
    """The packages that these depend on, with the packages themselves, through dependencies of these kinds."""
    found = set()
    left = list(roots)
    while left:
        package = left.pop()
        if package in found:
            continue
        found.add(package)
        left.extend(other for other, kind in graph[package] if kind in kinds)
    return found


def license_of(package):
    """An SPDX expression. `/` is crates.io's old form of OR."""
    return re.sub(r"\s*/\s*", " OR ", package["license"] or "NOASSERTION")


def is_ours(package):
    """Whether a package is of this project, and not a changed one of others."""
    return package["source"] is None and not is_changed(package)


def is_changed(package):
    return (ROOT / "vendor") in pathlib.Path(package["manifest_path"]).parents


def component(package, checksums, scope):
    name, version = package["name"], package["version"]
    purl = f"pkg:cargo/{name}@{version}"
    found = {
        "type": "library",
        "bom-ref": reference(package),
        "name": name,
        "version": version,
        "scope": scope,
        "licenses": [{"expression": license_of(package)}],
    }
    if is_changed(package):
        ancestor = {"type": "library", "name": name, "version": version, "purl": purl}
        found["pedigree"] = {"ancestors": [ancestor], "notes": f"changed, see vendor/{name}/README.md"}
    elif not is_ours(package):
        found["purl"] = purl
        found["hashes"] = [{"alg": "SHA-256", "content": checksums[name, version]}]
    if package["repository"] and not is_ours(package):
        found["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
    return found


def reference(package):
    return f"{package['name']}@{package['version']}"


def vendored():
    """The vendored packages, from the tables of their files: name, version, license, text, package URL."""
    found = []
    for folder, place in VENDORED.items():
        page = (folder / "README.md").read_text()
        rows = re.findall(r"^\| `.*` \| (\S+) \| (\S+) \| (\S+), `(\S+)` \|$", page, re.MULTILINE)
        if len(rows) != page.count("\n| `"):
            raise SystemExit(f"{folder}/README.md has rows without a license and its file")
        for name, version, spdx, file in rows:
            found.append((name, version, spdx, (folder / file).read_text().strip(), f"{place}{name}@{version}"))
    return found


def sbom(roots, packages, scopes, graph, checksums):
    """The document about the programs of packages. Parts that only build the programs are `excluded`."""
    components = [component(part, checksums, scopes[id]) for id, part in packages.items() if id in scopes]
    files = []
    for name, version, spdx, _, purl in vendored():
        files.append(purl)
        components.append(
            {
                "type": "library",
                "bom-ref": purl,
                "name": name,
                "version": version,
                "scope": "required",
                "licenses": [{"expression": spdx}],
                "purl": purl,
            }
        )
    dependencies = [
        {"ref": reference(packages[id]), "dependsOn": sorted({reference(packages[other]) for other, _ in graph[id] if other in scopes})}
        for id in scopes
    ]
    package = packages[roots[0]]
    top = {
        "type": "application",
        "bom-ref": "CARS",
        "name": "CARS",
        "version": package["version"],
        "licenses": [{"expression": license_of(package)}],
    }
    dependencies.append({"ref": "CARS", "dependsOn": sorted([*(reference(packages[root]) for root in roots), *files])})
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", time.time()))
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_OID, (ROOT / 'Cargo.lock').read_text())}",
        "version": 1,
        "metadata": {"timestamp": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds)), "component": top},
        "components": sorted(components, key=lambda part: part["bom-ref"]),
        "dependencies": sorted(dependencies, key=lambda part: part["ref"]),
    }


def texts_of(folder):
    """The license texts that a package ships, also those of the C sources in a folder of it."""
    files = [*folder.glob("*"), *folder.glob("*/*")]
    files = [file for file in sorted(files) if LICENSE_FILES.match(file.name) and file.suffix not in CODE and file.is_file()]
    return [file.read_text(errors="replace").strip() for file in files]


def notices(packages, scopes):
    """What is shipped, by name, with its license; then each text once, with the packages that it is of."""
    shipped = {}
    texts = {}
    for id, package in packages.items():
        if scopes.get(id) != "required" or is_ours(package):
            continue
        title = f"{package['name']} {package['version']}"
        shipped[title] = license_of(package)
        for text in texts_of(pathlib.Path(package["manifest_path"]).parent):
            texts.setdefault(text, []).append(title)
    for name, version, spdx, text, _ in vendored():
        title = f"{name} {version}"
        shipped[title] = spdx
        texts.setdefault(text, []).append(title)

    without = sorted(set(shipped).difference(*texts.values()))
    width = max(map(len, shipped))
    lines = ["CARS is licensed under Apache-2.0 or MIT, at your option. Its programs contain these packages:", ""]
    lines += [f"{title:{width}}  {spdx}" for title, spdx in sorted(shipped.items())]
    lines += ["", f"These ship no license text of their own: {', '.join(without)}."]
    for text, titles in sorted(texts.items(), key=lambda entry: sorted(entry[1])):
        lines += ["", "=" * 100, f"The license text of {', '.join(sorted(titles))}:", "", text]
    return "\n".join(lines) + "\n"


def main(folder):
    found = metadata()
    packages = {package["id"]: package for package in sorted(found["packages"], key=lambda package: package["id"])}
    used = compiled()
    packages = {id: package for id, package in packages.items() if (package["name"], package["version"]) in used}
    graph = {}
    for node in found["resolve"]["nodes"]:
        parts = [part for part in node["deps"] if part["pkg"] in packages]
        graph[node["id"]] = [(part["pkg"], kind["kind"] or "normal") for part in parts for kind in part["dep_kinds"]]
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text())
    checksums = {(entry["name"], entry["version"]): entry.get("checksum") for entry in lock["package"]}

    roots = [id for id, package in packages.items() if package["name"] in PACKAGES and is_ours(package)]
    # What only a procedural macro depends on runs in the compiler.
    macros = {id for id, package in packages.items() if any("proc-macro" in target["kind"] for target in package["targets"])}
    runtime = {id: [] if id in macros else parts for id, parts in graph.items()}
    shipped = reach(runtime, roots, {"normal"}) - macros
    scopes = {id: "required" if id in shipped else "excluded" for id in sorted(reach(graph, roots, {"normal", "build"}))}

    folder.mkdir(parents=True, exist_ok=True)
    document = sbom(roots, packages, scopes, graph, checksums)
    (folder / "sbom.cdx.json").write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n")
    (folder / "THIRD-PARTY.txt").write_text(notices(packages, scopes))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    main(pathlib.Path(sys.argv[1]))
