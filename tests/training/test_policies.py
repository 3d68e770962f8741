import sys

import pytest

from hprs.errors import UsageError
from hprs.training.policies import import_policy


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != ""])
    (tmp_path / "my_policies.py").write_text("def left(observation):\n    return 0\n\nx = 3\n")
    yield
    sys.modules.pop("my_policies", None)


def test_a_policy_is_found_beside_the_user(here):
    assert import_policy("my_policies:left")(None) == 0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("my_policies:right", "policy 'my_policies:right': module 'my_policies' has no function 'right'."),
        ("my_policies:x", "policy 'my_policies:x': module 'my_policies' has no function 'x'."),
        ("my_policie:left", "policy 'my_policie:left': there is no module 'my_policie'."),
    ],
)  # fmt: skip
def test_a_policy_that_does_not_exist_is_said(here, name, message):
    with pytest.raises(UsageError) as error:
        import_policy(name)
    assert str(error.value) == message
