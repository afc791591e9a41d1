"""Convergence of rays through voxels as the cells shrink."""

from __future__ import annotations

import numpy as np

from nigemizu import field, trace

TYPES = field.types("llvm", "double")


def slope(cells: list[int], errors: list[float]) -> float:
    return float(-np.polyfit(np.log(cells), np.log(errors), 1)[0])


def test_value_is_second_and_gradient_first_order_in_the_cell() -> None:
    """n − 1 = 2.7e-4 − 1e-5 exp(−z) cos x cos y: interpolation errors h² and h."""

    def exact(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        return 2.7e-4 - 1e-5 * np.exp(-z) * np.cos(x) * np.cos(y)

    random = np.random.default_rng(11)
    points = random.uniform(0, 2, (3, 4000))
    cells = [16, 32, 64]
    values, gradients = [], []
    for count in cells:
        nodes = np.linspace(0, 2, count + 1)
        data = exact(nodes[None, None, :], nodes[None, :, None], nodes[:, None, None])
        volume = field.TrilinearVolume(nodes, nodes, nodes, data, TYPES)
        n, gradient = volume.value_and_gradient(TYPES.Array3f(points))
        x, y, z = points
        less = 1e-5 * np.exp(-z)
        true = [less * np.sin(x) * np.cos(y), less * np.cos(x) * np.sin(y), less * np.cos(x) * np.cos(y)]
        values.append(float(np.max(np.abs(np.array(n) - 1 - exact(x, y, z)))))
        gradients.append(float(np.max(np.abs(np.array(gradient) - np.array(true)))))
    assert abs(slope(cells, values) - 2) < 0.2
    assert abs(slope(cells, gradients) - 1) < 0.2


def test_rays_through_voxels_converge() -> None:
    """The log-cosh mirage from a stretched mesh: at least first order in the cell.

    n² = 1.00027² − 5e-5 exp(−z/0.2) from 1.5 m at −3 mrad over 1 km. The gradient of the interpolant is
    first order, but its error changes sign within every cell that a ray crosses whole, so that heights do
    better; the theory gives no definite order beyond the first.
    """
    a, amplitude, h, launch = 1.00027**2, 5e-5, 0.2, -0.003
    n2 = a - amplitude * np.exp(-1.5 / h)
    p_x, p_z = np.sqrt(n2) * np.cos(launch), np.sqrt(n2) * np.sin(launch)
    p_far = np.sqrt(a - p_x**2)
    z_turn = -h * np.log(p_far**2 / amplitude)
    sigma_turn = 2 * h / p_far * np.arctanh(-p_z / p_far)
    cells = [20, 40, 80, 160]
    errors = []
    for count in cells:
        # Heights that stretch with z, halved from one mesh to the next.
        z = 0.3 * np.expm1(np.linspace(0, np.log(1 + 4 / 0.3), count + 1))
        profile = np.sqrt(a - amplitude * np.exp(-z / h)) - 1
        data = np.broadcast_to(profile[:, None, None], (count + 1, 2, 2))
        volume = field.TrilinearVolume([-1, 1100], [-5, 5], z, data, TYPES)
        end = trace.march(
            volume,
            TYPES.Array3f(0, 0, 1.5),
            TYPES.Array3f(float(np.cos(launch)), 0, float(np.sin(launch))),
            step=0.1,
            max_steps=10_000,
        )
        sigma = float(end.position.x[0]) / p_x
        exact = z_turn + 2 * h * np.log(np.cosh(p_far * (sigma - sigma_turn) / (2 * h)))
        errors.append(abs(float(end.position.z[0]) - exact))
    assert slope(cells, errors) > 0.8
    assert errors[-1] < 5e-3
    assert errors[0] > 5 * errors[-1]


def test_escape_through_a_face_keeps_first_order() -> None:
    """Through a box of linear n (the trilinear volume is exact) and on: the direction beyond is first order.

    The step that crosses the face is bent wholly or not at all.
    """
    z = np.array([0.0, 10.0])
    data = np.broadcast_to((3e-4 + 1e-5 * z)[:, None, None], (2, 2, 2))
    volume = field.TrilinearVolume([0, 100], [-5, 5], z, data, TYPES)
    steps = [0.7, 0.35, 0.175, 0.0875]
    exact = 1e-5 * 100 / (1 + 3.5e-4)  # to first order in the small bending: ∇n L / n
    for step in steps:
        end = trace.march(volume, TYPES.Array3f(-50, 0, 5), TYPES.Array3f(1, 0, 0), step=step, max_steps=5000)
        assert end.status[0] == trace.ESCAPED
        assert abs(float(end.direction.z[0]) - exact) < 1e-5 * step + 1e-9
        assert abs(float(end.position.x[0]) - 100) < 1e-9
