"""A file brings everything back, every change of it is noticed, and nothing in it is executed."""

import io
import json
import pickle
import zipfile

import numpy as np
import pytest

from hprs.deploy import ChoiceLayout, ObservationLayout, load_bundle, save_bundle
from hprs.deploy.archive import from_bytes, to_bytes
from hprs.errors import BundleError
from tests.deploy.small import archive, checked, forged, numbers, parts, small


def test_a_file_brings_everything_back(tmp_path):
    layout = ObservationLayout((2,), numbers(1, 0), numbers(2, 0.5), 5.0, {"unit": "m"})
    bundle, file = checked(small(observation=layout)), tmp_path / "p.bundle"
    save_bundle(bundle, file)
    found = load_bundle(file)
    assert to_bytes(found) == to_bytes(bundle) == file.read_bytes()
    assert (found.task, found.rate, found.provenance) == (bundle.task, 10.0, {"run": "x"})
    assert found.observation.details == {"unit": "m"}
    found.self_check()
    choice = small(action=ChoiceLayout(2, start=1))
    assert from_bytes(to_bytes(choice)).action.start == 1


def test_every_changed_byte_is_noticed_or_harmless():
    data, bundle = to_bytes(checked()), checked()
    noticed = 0
    # Headers of the archive, then every seventh byte of all.
    ends = [*range(60), *range(len(data) - 120, len(data))]
    places = [(place, bit) for place in ends for bit in (0x01, 0x08, 0x80)]
    places += [(place, 0x10) for place in range(0, len(data), 7)]
    for place, bit in places:
        changed = bytearray(data)
        changed[place] ^= bit
        try:
            found = from_bytes(bytes(changed))
        except BundleError:
            noticed += 1
            continue
        # Fields of the archive that nobody reads, as the time of an entry.
        np.testing.assert_array_equal(found.batch(bundle.check_observations), bundle.check_actions)
        assert found.task == bundle.task
    assert noticed > len(places) / 2


def test_nothing_is_unpickled(monkeypatch):
    def never(*arguments, **options):
        raise AssertionError("unpickled")

    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.array([print], dtype=object), allow_pickle=True)
    monkeypatch.setattr(pickle, "load", never)
    monkeypatch.setattr(pickle, "loads", never)
    files = parts(to_bytes(small()))
    for evil in (stream.getvalue(), pickle.dumps(print)):
        with pytest.raises(BundleError, match="damaged, or no bundle"):
            from_bytes(archive(**{**files, "mean.npy": evil}))


def test_another_format_is_named():
    files = parts(to_bytes(small()))
    for provenance, writer in (
        ({"written_by": "hprs 9.0"}, "hprs 9.0"),
        ([], "an unknown version"),
    ):
        content = {"format": 7, "provenance": provenance}
        with pytest.raises(BundleError) as error:
            from_bytes(archive(**{**files, "bundle.json": json.dumps(content)}))
        assert str(error.value) == (
            f"its format is 7, written by {writer}; this hprs reads format 1. Use the version that wrote it."
        )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"action": {"kind": "wheel"}}, "an action is a box or a choice, not 'wheel'"),
        (
            {"action": {"kind": "choice", "outputs": "two", "start": 0}},
            "a part is missing or wrong",
        ),
        (
            {"action": {"kind": "box", "shape": [3], "mapping": "raw"}},
            "low has shape (2,), not (3,)",
        ),
        (
            {"observation": {"shape": [2], "clip": None, "details": {}}},
            "a part is missing or wrong",
        ),
        ({"observation": {"shape": [-1, -2], "clip": 1, "details": {}}}, "no negative lengths"),
        ({"observation": {}}, "a part is missing or wrong: 'shape'"),
        ({"layers": 3}, "a part is missing or wrong: 'weights-2'"),
        ({"layers": 0}, "the network has no layers"),
        ({"task": [1]}, "a part is missing or wrong"),
    ],
)
def test_content_that_nothing_can_be_made_of_is_named(content, message):
    with pytest.raises(BundleError) as error:
        from_bytes(forged(small(), content))
    assert message in str(error.value)


def test_what_would_unpack_to_more_than_the_memory_holds_is_refused():
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("bundle.json", b" " * 1_000_000)
    with pytest.raises(BundleError, match=r"bundle\.json in it is compressed"):
        from_bytes(stream.getvalue())
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999,), }"
    huge = b"\x93NUMPY\x01\x00\x76\x00" + header.ljust(117) + b"\n"
    with pytest.raises(BundleError, match="damaged, or no bundle"):
        from_bytes(archive(**{**parts(to_bytes(small())), "mean.npy": huge}))


@pytest.mark.parametrize("data", [b"", b"no zip", archive(a="b"), archive(**{"bundle.json": "[]"})])
def test_what_is_no_bundle_is_said_so(data, tmp_path):
    file = tmp_path / "p.bundle"
    file.write_bytes(data)
    with pytest.raises(BundleError) as error:
        load_bundle(file)
    assert str(file) in str(error.value)


def test_a_missing_file_is_said_so(tmp_path):
    with pytest.raises(BundleError, match=r"none\.bundle cannot be read: No such file"):
        load_bundle(tmp_path / "none.bundle")
    with pytest.raises(BundleError, match=r"p\.bundle cannot be written: No such file"):
        save_bundle(small(), tmp_path / "none" / "p.bundle")
