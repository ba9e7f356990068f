"""The bills of materials that go into the FMUs, against CycloneDX's own schema and against Cargo.lock."""

import json
import pathlib
import tomllib

import pytest
from cyclonedx.schema import OutputFormat, SchemaVersion
from cyclonedx.validation import make_schemabased_validator

ROOT = pathlib.Path(__file__).parents[2]
FILES = sorted((ROOT / "src/package/sbom").glob("*.cdx.json"))


def errors(text):
    """What CycloneDX's schema has against it."""
    return list(make_schemabased_validator(OutputFormat.JSON, SchemaVersion.V1_6).validate_str(text, all_errors=True) or [])


@pytest.fixture(params=FILES, ids=lambda file: file.stem)
def text(request):
    return request.param.read_text()


@pytest.fixture
def bill(text):
    return json.loads(text)


def test_there_is_one_for_each_fmu():
    assert [file.name for file in FILES] == ["BessConsensus.cdx.json", "BessGrid.cdx.json"]


def test_it_is_valid(text):
    assert errors(text) == []


def test_the_validator_finds_a_wrong_licence_and_a_component_without_a_name(bill):
    bill["components"][0]["licenses"] = [{"license": {"id": "No-Such-1.0"}}]
    assert errors(json.dumps(bill))
    del bill["components"][0]["licenses"]
    assert not errors(json.dumps(bill))
    del bill["components"][0]["name"]
    assert errors(json.dumps(bill))


def test_it_says_nothing_about_when_and_by_whom(bill):
    assert "serialNumber" not in bill and "timestamp" not in bill["metadata"]


def test_every_crate_is_the_locked_one(bill):
    with open(ROOT / "Cargo.lock", "rb") as file:
        locked = {(p["name"], p["version"]): p.get("checksum") for p in tomllib.load(file)["package"]}
    crates = [c for c in bill["components"] if c.get("purl", "").startswith("pkg:cargo/")]
    assert len(crates) > 15
    for crate in crates:
        assert crate["purl"] == f"pkg:cargo/{crate['name']}@{crate['version']}"
        [digest] = crate["hashes"]
        assert digest == {"alg": "SHA-256", "content": locked[crate["name"], crate["version"]]}


def test_every_component_is_reached_from_the_library(bill):
    edges = {one["ref"]: one.get("dependsOn", []) for one in bill["dependencies"]}
    refs = {one["bom-ref"] for one in bill["components"]} | {bill["metadata"]["component"]["bom-ref"]}
    assert set(edges) == refs
    reached, to_do = set(), [bill["metadata"]["component"]["bom-ref"]]
    while to_do:
        ref = to_do.pop()
        if ref not in reached:
            reached.add(ref)
            to_do.extend(edges[ref])
    assert reached == refs
