"""The policies that runs keep, whoever trained them."""

from __future__ import annotations

from hprs.deploy import load_bundle
from hprs.errors import BundleError, RunError
from hprs.training.policies import BUNDLE_SUFFIX, BatchedPolicy
from hprs.training.run_directory import RunDirectory, Which


def load_policy(run: RunDirectory, which: Which) -> BatchedPolicy:
    """A policy that a run keeps, acting deterministically.

    Raises:
        RunError: There is none, or it is damaged.
        MissingExtraError: What trained it is not installed, and is needed to run it.
    """
    file = run.policy_file(which)
    if file.suffix != BUNDLE_SUFFIX:
        from hprs.training import sb3

        return sb3.load_policy(run, which)
    try:
        return load_bundle(file)
    except BundleError as error:
        raise RunError(str(error)) from None
