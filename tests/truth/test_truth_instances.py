"""Rotated, scaled and mirrored instances of a mesh get the same light as copies with transformed vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import point_irradiance
from probes import Probe
from scenes import SceneBuilder

import baker
from baker.core.scene import Instance, PunctualLight

LIGHT = np.array([0.4, 2.5, 0.3])


def body():
    """Return a builder with one asymmetric closed body, a box whose top is sheared."""
    builder = SceneBuilder(64)
    builder.box((0, 0, 0), (1, 0.6, 0.4), builder.material((0.7, 0.5, 0.3)), 10)
    position = np.concatenate([m.position for m in builder.meshes])
    position[:, 0] += 0.5 * position[:, 1]
    normal = np.zeros_like(position)
    triangle = np.concatenate([m.triangle + 4 * k for k, m in enumerate(builder.meshes)])
    for t in triangle:
        face = np.cross(position[t[1]] - position[t[0]], position[t[2]] - position[t[0]])
        normal[t] = face / np.linalg.norm(face)
    mesh = replace(
        builder.meshes[0], position=position, normal=normal, triangle=triangle,
        material=np.zeros(len(triangle), np.int32), primitive=np.zeros(len(triangle), np.int32),
        vertex_primitive=np.zeros(len(position), np.int32),
        source_vertex=np.arange(len(position), dtype=np.int32),
        texcoord=(None, None),
    )  # fmt: skip
    return builder, mesh


def matrices():
    """Return transforms: identity, rotation, reflection, reflection with rotation, non-uniform scale."""
    found = []
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    for k, linear in enumerate(
        [np.eye(3), turn, np.diag([-1.0, 1, 1]), turn @ np.diag([1.0, -1, 1]), np.diag([0.5, 1.5, -1.0])]
    ):
        matrix = np.eye(4)
        matrix[:3, :3] = linear
        matrix[:3, 3] = (2.0 * (k % 3) - 2.5, 0.3 * k, 1.8 * (k // 3) - 1.0)
        found.append(matrix)
    return found


@pytest.fixture(scope="module")
def both():
    """Return probes of a bake of instances and of a bake of copies with transformed vertices."""
    builder, mesh = body()
    light = PunctualLight("point", "", 0, (30.0, 20.0, 10.0), position=tuple(LIGHT))
    scene = replace(builder.build(), meshes=(mesh,), lights=(light,))
    placed = replace(scene, instances=tuple(Instance(k, f"copy{k}", 0, m) for k, m in enumerate(matrices())))
    copies = []
    for matrix in matrices():
        linear = matrix[:3, :3]
        position = (mesh.position.astype(float) @ linear.T + matrix[:3, 3]).astype(np.float32)
        normal = mesh.normal.astype(float) @ np.linalg.inv(linear)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        # A reflection reverses the winding, so the copy reverses it again.
        triangle = mesh.triangle[:, [0, 2, 1]] if np.linalg.det(linear) < 0 else mesh.triangle
        copies.append(replace(mesh, position=position, normal=normal.astype(np.float32), triangle=triangle))
    hand = replace(
        scene, meshes=tuple(copies), instances=tuple(Instance(k, f"copy{k}", k, np.eye(4)) for k in range(5))
    )
    settings = {"resolution": 256, "samples": 256, "sky": "3", "ao_distance": "1.0", "threads": 2}
    return [Probe(baker.bake(s, **settings)) for s in (placed, hand)]


@pytest.mark.parametrize("k", range(5))
def test_instances_are_lit_as_copies_are(both, k):
    placed, _hand = both
    rng = np.random.default_rng(k)
    point, normal = placed.surface_points(f"copy{k}", 80, rng)
    for channel in ("irradiance", "ao"):
        a, b = (np.array([p.at(x, n, channel) for x, n in zip(point, normal, strict=True)]) for p in both)
        size = max(float(b.max()), 1.0)
        # The two bakes have different charts and noise, and shadow edges cross different texels. Therefore
        # only the median difference is below 1 %.
        assert np.median(np.abs(a - b)) < 0.01 * size
        assert np.abs(a - b).mean() < 0.02 * size
        assert abs(a.mean() / b.mean() - 1) < 0.02


@pytest.mark.parametrize("k", range(5))
def test_open_faces_get_sky_and_light_by_closed_form(both, k):
    """Where AO is 1, E is pi times the sky, plus the light if visible, plus a little reflected light."""
    placed, _ = both
    point, normal = placed.surface_points(f"copy{k}", 80, np.random.default_rng(k))
    above = np.array([placed.at(x, n)[1] for x, n in zip(point, normal, strict=True)])
    direct = np.array([20 * point_irradiance(LIGHT, x, n) for x, n in zip(point, normal, strict=True)])
    free = np.array([placed.at(x, n, "ao")[0] for x, n in zip(point, normal, strict=True)]) > 0.999
    assert free.sum() > 10
    truth = 3 * np.pi + direct[free]
    # Other bodies, more than 1 m away, block some of the sky and reflect a part of that light.
    assert np.median(np.abs(above[free] / truth - 1)) < 0.08
    assert (above[free] < 1.2 * truth).all()


def test_mirrored_bodies_are_not_inside_out(both):
    for probe in both:
        assert not (probe.result.status == 3).any()
        assert all(v > 100 for v in probe.result.texel_count)
