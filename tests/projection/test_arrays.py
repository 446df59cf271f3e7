# SPDX-License-Identifier: GPL-3.0-or-later
"""Matrix products and inverses in pieces, against NumPy's own."""

import numpy as np
import pytest

from scfpf_addon.projection import arrays


@pytest.mark.parametrize("shape", [(3, 4, 5), (700, 96, 40), (5, 0, 4), (2, 900, 900)])
def test_a_product_in_pieces_is_the_product(shape):
    rows, inner, columns = shape
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(inner, rows)).T, rng.normal(size=(inner, columns))
    assert np.allclose(arrays.product(a, b), np.einsum("ri,ic->rc", a, b), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("shape", [(864, 864, 12), (48, 64, 2160)])
def test_no_piece_is_worth_threads_to_blas(monkeypatch, shape):
    rows, inner, columns = shape
    sizes = []
    right = np.matmul

    def counted(a, b, out):
        sizes.append(a.size * b.shape[1])
        return right(a, b, out=out)

    monkeypatch.setattr(arrays.np, "matmul", counted)
    arrays.product(np.ones((rows, inner)), np.ones((inner, columns)))
    assert max(sizes) <= arrays.MOST_MULTIPLICATIONS
    # Pieces are as large as they may be.
    assert min(sizes[:-1]) > arrays.MOST_MULTIPLICATIONS / 2


@pytest.mark.parametrize("size", [1, 63, 65, 131, 240])
def test_the_inverse_of_a_triangle(size):
    lower = np.tril(np.random.default_rng(size).uniform(-0.5, 0.5, (size, size))) + np.eye(size) * size
    assert np.allclose(arrays.inverse_triangle(lower) @ lower, np.eye(size), atol=1e-12)
