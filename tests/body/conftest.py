"""What the tests of the body share: bodies, measured data, and slow oracles."""

import numpy as np
import pytest

from fes_pin.body.build import Body


@pytest.fixture(scope="session")
def measured_body(walk) -> Body:
    return Body.from_segments(walk / "reference/subject01_model.json", stance="right")


@pytest.fixture(scope="session")
def jacobi():
    return jacobi_rotations


def jacobi_rotations(Q: np.ndarray, sweeps: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """The paper's Jacobi iteration: eigenvalues and eigenvectors of a symmetric matrix by plane rotations."""
    D, V = Q.copy(), np.eye(len(Q))
    for _ in range(sweeps):
        if np.abs(D - np.diag(np.diag(D))).max() < 1e-13 * np.abs(D).max():
            break
        for p in range(len(Q)):
            for q in range(p + 1, len(Q)):
                angle = 0.5 * np.arctan2(2.0 * D[p, q], D[q, q] - D[p, p])
                c, s = np.cos(angle), np.sin(angle)
                G = np.eye(len(Q))
                G[p, p], G[q, q], G[p, q], G[q, p] = c, c, s, -s
                D, V = G.T @ D @ G, V @ G
    return np.diag(D).copy(), V
