"""Owner's files in the workload of power cuts: valid or damaged."""

from pathlib import Path

import pytest

from firmware.card.store import Store
from tests.proof.image import workload

KEY = "0123456789abcdef"


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setattr(workload, "OWNER", tmp_path)
    return Store(tmp_path)


def test_a_set_has_the_number_that_all_its_files_have(store: Store):
    assert workload.read_owner() == -1
    files = dict.fromkeys(("captain.toml", "mqtt/ca.pem"), b"# 7\n")
    store.accept(KEY, ["ssh-ed25519 7"], files, {})
    assert workload.read_owner() == 7


def test_a_set_of_two_numbers_is_damage(store: Store):
    store.accept(KEY, ["ssh-ed25519 7"], {"captain.toml": b"# 7\n", "mqtt/ca.pem": b"# 6\n"}, {})
    assert workload.read_owner() == "a set of ['6', '7']"


def test_a_set_that_the_whole_system_has_put_in_force_is_none_of_the_workload(store: Store):
    store.accept(KEY, [], {}, {})
    store.tell(KEY, 0, ["the box runs as it was made"])
    assert workload.read_owner() == -1


def test_a_set_that_lacks_files_and_is_not_the_boxs_own_is_damage(store: Store):
    store.accept(KEY, [], {}, {})
    store.tell("another", 0, [])
    assert workload.read_owner() == "a set without captain.toml"
