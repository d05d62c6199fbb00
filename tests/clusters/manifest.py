"""Checks the manifest on the standard input with the schemas of Kubernetes, strictly, and prints it as JSON."""

import json
import sys

import kubernetes_validate
import yaml

# The oldest release in which every field of the manifest is stable, and the newest one that the package has.
VERSIONS = ["1.33", kubernetes_validate.latest_version()]


def main():
    manifest = yaml.safe_load(sys.stdin)
    for version in VERSIONS:
        kubernetes_validate.validate(manifest, version, strict=True)
    json.dump(manifest, sys.stdout)


if __name__ == "__main__":
    main()
