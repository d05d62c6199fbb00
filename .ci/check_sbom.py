#!/usr/bin/env python3
"""Whether the inventory of a release (packaging/inventory.py) is complete: `check_sbom.py FOLDER`.

The SBOM satisfies CycloneDX's schema, every part has a license and every registry package its digest, and the packages of
Cargo.lock that are not in it are those of tests and of other platforms, so fewer than those in it.
"""

import json
import pathlib
import sys
import tomllib

from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

folder = pathlib.Path(sys.argv[1])
text = (folder / "sbom.cdx.json").read_text()
error = JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)
assert error is None, error

document = json.loads(text)
parts = document["components"]
lacking = [part["bom-ref"] for part in parts if part["licenses"][0]["expression"] == "NOASSERTION"]
assert not lacking, f"without a license: {lacking}"
known = {part["bom-ref"] for part in parts} | {"CARS"}
for entry in document["dependencies"]:
    assert known.issuperset([entry["ref"], *entry["dependsOn"]]), entry

root = pathlib.Path(__file__).resolve().parents[1]
lock = tomllib.loads((root / "Cargo.lock").read_text())["package"]
digests = {(entry["name"], entry["version"]): entry.get("checksum") for entry in lock}
cargo = [part for part in parts if part.get("purl", "").startswith("pkg:cargo/")]
for part in cargo:
    assert part["hashes"][0]["content"] == digests[part["name"], part["version"]], part["bom-ref"]
assert len(digests) / 2 < len(cargo) < len(digests), (len(cargo), len(digests))

# What is listed for people is what is shipped.
notices = (folder / "THIRD-PARTY.txt").read_text()
for part in parts:
    is_of_others = "purl" in part or "pedigree" in part
    if part["scope"] == "required" and is_of_others:
        assert f"\n{part['name']} {part['version']}  " in notices, part["bom-ref"]

print(f"{len(parts)} parts, {sum(part['scope'] == 'required' for part in parts)} of them in the programs")
