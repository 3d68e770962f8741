"""The committed policy of every benchmark says where it was trained, and does what it did there."""

import json
from pathlib import Path

import pytest

from hprs.cli import main
from hprs.deploy import load_bundle
from hprs.envs.registration import benchmark_of
from hprs.training.session import POLICY

POLICIES = Path(__file__).parents[2] / "results" / "policies"
FOLDERS = sorted(path.name for path in POLICIES.iterdir())


@pytest.mark.parametrize("name", FOLDERS)
def test_a_committed_policy_knows_its_benchmark_and_checks_itself(name):
    bundle = load_bundle(POLICIES / name / POLICY)
    bundle.self_check()
    assert benchmark_of(bundle.provenance["environment"]) is not None
    assert (POLICIES / name / POLICY).stat().st_size < 1_000_000


def test_a_committed_policy_is_assessed_by_the_name_of_its_folder(capsys):
    folder = POLICIES / "cart-pole"
    assert main(["evaluate", str(folder), "--json"]) == 0
    chosen, found = (
        json.loads((folder / "chosen.json").read_text()),
        json.loads(capsys.readouterr().out),
    )
    assert found["subject"] == f"hprs/CartPole-v0, policy {folder / POLICY}"
    assert found["measures"]["S+T"]["value"] == chosen["S+T"]
    assert found["measures"]["S+T+C"]["value"] == pytest.approx(chosen["S+T+C"], abs=1e-3)
