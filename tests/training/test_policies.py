import sys

import pytest

from hprs.errors import UsageError
from hprs.training.policies import import_policy


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != ""])
    (tmp_path / "policies_beside_the_user.py").write_text(
        "def left(observation):\n    return 0\n\nx = 3\n"
    )
    yield
    sys.modules.pop("policies_beside_the_user", None)


def test_a_policy_is_found_beside_the_user(here):
    assert import_policy("policies_beside_the_user:left")(None) == 0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("policies_beside_the_user:right", "policy 'policies_beside_the_user:right': module 'policies_beside_the_user' has no function 'right'."),
        ("policies_beside_the_user:x", "policy 'policies_beside_the_user:x': module 'policies_beside_the_user' has no function 'x'."),
        ("my_policie:left", "policy 'my_policie:left': there is no module 'my_policie'."),
    ],
)  # fmt: skip
def test_a_policy_that_does_not_exist_is_said(here, name, message):
    with pytest.raises(UsageError) as error:
        import_policy(name)
    assert str(error.value) == message
