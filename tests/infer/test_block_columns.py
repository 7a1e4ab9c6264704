"""Inner products of columns that concern the trials of one group, compared with those of full columns."""

import numpy as np
import pytest

from fes_pin.infer.problem import Linearized
from fes_pin.infer.projection import BlockColumns, Projection, slices

ROWS = {"before": slice(0, 50), "after": slice(50, 120)}
UNITS = [slice(0, 20), slice(20, 50), slice(50, 90), slice(90, 120)]


@pytest.fixture
def projection() -> Projection:
    rng = np.random.default_rng(3)
    return Projection(
        [
            Linearized(rng.normal(size=m), rng.normal(size=(m, 3)), rng.normal(size=(m, 2)), 0.0)
            for m in (20, 30, 40, 30)
        ]
    )


@pytest.fixture
def pieces() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    return {name: rng.normal(size=(rows.stop - rows.start, 2)) for name, rows in ROWS.items()}


def whole(pieces: dict[str, np.ndarray], *blocks: str) -> np.ndarray:
    """Return the columns over all rows, zero outside some blocks."""
    out = np.zeros((120, 2))
    for name in blocks:
        out[ROWS[name]] = pieces[name]
    return out


@pytest.mark.parametrize("blocks", [("before",), ("after",), ("before", "after")])
def test_products_are_those_of_the_whole_columns(
    projection: Projection, pieces: dict[str, np.ndarray], blocks: tuple[str, ...]
) -> None:
    columns = BlockColumns(projection, ROWS)
    place = {name: columns.added(name, pieces[name]) for name in blocks}
    gram, along, norms = columns.products(place)
    left = projection(whole(pieces, *blocks))
    assert np.allclose(gram, left.T @ left, rtol=1e-12)
    assert np.allclose(along, left.T @ projection.residual, atol=1e-12)
    assert np.allclose(norms, np.linalg.norm(whole(pieces, *blocks), axis=0))
    sizes, inner = columns.by_unit([place], UNITS)
    assert np.allclose(sizes[:, 0], [left[u, 0] @ left[u, 0] for u in UNITS])
    assert np.allclose(inner[:, 0], [left[u, 0] @ projection.residual[u] for u in UNITS])


def test_the_gram_matrix_of_several_blocks_is_that_of_the_whole_columns(
    projection: Projection, pieces: dict[str, np.ndarray]
) -> None:
    columns = BlockColumns(projection, ROWS)
    places = [{name: columns.added(name, pieces[name])} for name in ("after", "before")]
    gram, blocks = columns.gram(places)
    left = projection(np.concatenate([whole(pieces, "after"), whole(pieces, "before")], axis=1))
    assert np.allclose(gram, left.T @ left, rtol=1e-12, atol=1e-12)
    assert blocks == slices([2, 2])
    assert columns.gram([])[0].shape == (0, 0)


def test_an_array_that_two_items_share_is_added_once(projection: Projection, pieces: dict[str, np.ndarray]) -> None:
    columns = BlockColumns(projection, ROWS)
    assert columns.added("after", pieces["after"]) == columns.added("after", pieces["after"]) == slice(0, 2)
    assert columns.added("after", pieces["after"].copy()) == slice(2, 4)


def test_a_column_that_diverges_has_no_products(projection: Projection, pieces: dict[str, np.ndarray]) -> None:
    columns = BlockColumns(projection, ROWS)
    pieces["after"][:, 1] = np.inf
    gram, along, norms = columns.products({"after": columns.added("after", pieces["after"])})
    assert along[1] == norms[1] == gram[1, 1] == 0.0
