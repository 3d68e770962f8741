"""`hprs export`: a policy as files that run without hprs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hprs.errors import BundleError, RunError, UsageError

if TYPE_CHECKING:
    from hprs.deploy import Bundle
    from hprs.wrappers.single import TaskWrapper


@dataclass(frozen=True)
class Export:
    """Write a policy as a bundle, with a runtime beside it that needs Python 3.8 and NumPy alone.

    The bundle holds weights, what the policy sees and does, its rate, its task, where it comes
    from, and a check of itself, which is made before it is written. With the extra onnx the policy
    is written as an ONNX file too. A bundle that is older than its details is completed.

    Examples:
      hprs export runs/hprs-SafeDriving-v0/hprs-ppo-1a2b3c4d/seed-0 policy.bundle
      hprs export runs/hprs-SafeDriving-v0/hprs-ppo-1a2b3c4d/seed-0 car/policy.bundle --which best
      hprs export old.bundle policy.bundle --environment hprs/SafeDriving-v0
    """

    subject: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|BUNDLE")]
    """Run directory of one seed, or a policy bundle."""
    out: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE")]
    """The bundle to write; the other files are written beside it."""
    which: str = "last"
    """The policy of a run: last, or best (by PAM)."""
    environment: Annotated[str | None, tyro.conf.arg(metavar="ENV", help_behavior_hint="")] = None
    """Where a bundle was trained that does not say so."""

    def run(self) -> int:
        """Write the files."""
        from hprs.deploy import save_bundle
        from hprs.deploy.runtime import NAME, runtime_source
        from hprs.training.description import described, details_of
        from hprs.training.policies import BUNDLE_SUFFIX, check_fits

        if self.out.suffix != BUNDLE_SUFFIX:
            raise UsageError(f"the name of a bundle ends in {BUNDLE_SUFFIX}, unlike '{self.out}'.")
        if not self.out.absolute().parent.is_dir():
            raise UsageError(f"there is no folder '{self.out.parent}'.")
        bundle, environment = self._found()
        check_fits(self.subject, bundle, environment)
        bundle = described(bundle, details_of(environment, environment.task))
        environment.close()
        bundle.self_check()
        save_bundle(bundle, self.out)
        runtime = self.out.with_name(NAME)
        try:
            runtime.write_text(runtime_source(_writer()), encoding="utf-8")
        except OSError as error:
            raise BundleError(f"{runtime} cannot be written: {error.strerror}.") from None
        print(f"Written: {self.out}, which has checked itself")
        print(f"Written: {runtime}")
        print(self._onnx(bundle))
        return 0

    def _onnx(self, bundle: Bundle) -> str:
        """Write the ONNX file where its package is installed; says what was done."""
        from hprs.errors import MissingExtraError

        file = self.out.with_suffix(".onnx")
        try:
            from hprs.deploy.onnx import OPSET, save_onnx
        except MissingExtraError as error:
            return f"Not written: {file}. {error}"
        save_onnx(bundle, file)
        return f"Written: {file}, of opset {OPSET}"

    def _found(self) -> tuple[Bundle, TaskWrapper]:
        """The bundle, with all that is known of where it comes from, and its environment."""
        from hprs.cli.assessed_run import check_which, environment_of_bundle
        from hprs.training.run_directory import find_runs

        which = check_which(self.which)
        asked: dict[str, Any] = {
            "task_path": None,
            "constants": (),
            "options": (),
            "horizon": None,
        }
        if Path(self.subject).is_file() and self.environment is not None:
            return self._told(self.environment)
        if Path(self.subject).is_file():
            _, bundle, make = environment_of_bundle(self.subject, **asked)
            return bundle, make()
        run, *others = find_runs(Path(self.subject))
        if others:
            raise UsageError(
                f"'{self.subject}' holds {len(others) + 1} seeds; name one, as in {run.path}"
            )
        file = run.policy_file(which)
        from hprs.training.policies import BUNDLE_SUFFIX

        if file.suffix != BUNDLE_SUFFIX:
            raise RunError(
                f"the {which} policy of {run.path} is no bundle: it was trained by "
                f"{run.configuration.trainer}. Train with --trainer jax."
            )
        _, bundle, make = environment_of_bundle(str(file), **asked)
        origin = {**bundle.provenance, "which": which, **run.origin}
        return replace(bundle, provenance=origin), make()

    def _told(self, environment: str) -> tuple[Bundle, TaskWrapper]:
        """A bundle that does not say where it was trained, and its environment."""
        from hprs.deploy import load_bundle
        from hprs.spec.json_format import task_from_json
        from hprs.training.environment import make_environment

        bundle = load_bundle(self.subject)
        said = bundle.provenance.get("environment")
        if said not in (None, environment):
            raise UsageError(f"'{self.subject}' was trained in {said}, not in {environment}.")
        made = make_environment(environment, task_from_json(bundle.task), "sparse")
        return replace(bundle, provenance={**bundle.provenance, "environment": environment}), made


def _writer() -> str:
    from hprs.training.provenance import versions

    return f"hprs {versions().get('hprs', 'of an unknown version')}"
