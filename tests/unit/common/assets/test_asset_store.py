"""Content by its hash: in memory, in the shared cache, and when the cache is damaged."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from elys.common.assets import AssetStore, is_reference, reference_of
from elys.common.errors import AssetError


def test_a_reference_is_the_hash_of_the_content() -> None:
    assert reference_of(b"abc") == "blake2b:" + hashlib.blake2b(b"abc", digest_size=16).hexdigest()
    assert is_reference(reference_of(b""))
    for text in ("", "blake2b:", "blake2b:" + "0" * 31, "blake2b:" + "G" * 32, "box", "blake2b:" + "0" * 32 + "\n"):
        assert not is_reference(text)


def test_what_is_put_can_be_got_and_told_about() -> None:
    store = AssetStore()
    first = store.put(b"abc", kind="mesh", source="a.gltf#0/0")
    second = store.put(b"xyz", kind="image")
    assert store.put(b"abc", kind="mesh", source="b.gltf#0/0") == first
    assert (store.get(first), store.kind(first), store.source(first)) == (b"abc", "mesh", "a.gltf#0/0")
    assert (store.source(second), store.kind("blake2b:" + "0" * 32)) == ("", None)
    assert list(store.references()) == [first, second]
    assert store.has(first)
    assert store
    assert AssetStore()  # an empty store is a store


@pytest.mark.parametrize("reference", ["blake2b:" + "0" * 32, "box", "", "blake2b:../../etc/passwd", "\0"])
def test_what_is_not_there_is_an_error_with_and_without_a_cache(reference: str, tmp_path: Path) -> None:
    for store in (AssetStore(), AssetStore(tmp_path)):
        assert not store.has(reference)
        with pytest.raises(AssetError, match="there is no asset"):
            store.get(reference)


def test_another_process_finds_it_in_the_cache(tmp_path: Path) -> None:
    reference = AssetStore(tmp_path / "cache").put(b"abc", kind="image")
    other = AssetStore(tmp_path / "cache")
    assert other.has(reference)
    assert other.get(reference) == b"abc"
    assert [p.name for p in (tmp_path / "cache").iterdir()] == [reference.removeprefix("blake2b:")]


def test_a_damaged_file_is_thrown_away_and_can_be_put_again(tmp_path: Path) -> None:
    reference = AssetStore(tmp_path).put(b"abc", kind="image")
    (file,) = tmp_path.iterdir()
    file.write_bytes(b"abd")
    with pytest.raises(AssetError, match=r"was damaged in the cache .* and was removed"):
        AssetStore(tmp_path).get(reference)
    assert not file.exists()
    AssetStore(tmp_path).put(b"abc", kind="image")
    assert AssetStore(tmp_path).get(reference) == b"abc"


def test_a_cache_that_cannot_be_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(AssetError, match=r"the asset cache .* cannot be made"):
        AssetStore(tmp_path / "file" / "cache")
    store = AssetStore(tmp_path / "cache")
    (tmp_path / "cache").rmdir()
    with pytest.raises(AssetError, match="cannot be written"):
        store.put(b"abc", kind="image")
