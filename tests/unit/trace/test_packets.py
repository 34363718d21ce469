"""Ray packets give the same hits as queries of embreex and as a loop over all triangles."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from packet_driver import cast
from scipy.spatial import ConvexHull

from baker.core.errors import ResourceError
from baker.trace.embree import RayScene, embree_version

WIDTHS = (4, 8, 16)


def soup(n, rng):
    centre = rng.uniform(-1, 1, (n, 1, 3))
    position = np.float32(centre + rng.normal(0, 0.25, (n, 3, 3))).reshape(-1, 3)
    return position, np.arange(3 * n, dtype=np.int32).reshape(-1, 3)


def rays_at_random(n, rng):
    origin = rng.uniform(-1.5, 1.5, (n, 3))
    target = rng.uniform(-1, 1, (n, 3))
    return np.float32(origin), np.float32((target - origin) * rng.uniform(0.3, 3.0, (n, 1)))


@pytest.fixture(scope="module")
def soup_rays():
    rng = np.random.default_rng(3)
    position, triangle = soup(60, rng)
    origin, direction = rays_at_random(1003, rng)
    near = np.float32(rng.uniform(0, 0.3, len(origin)))
    far = np.float32(rng.uniform(0.3, 2, len(origin)))
    limits = ((np.zeros_like(near), np.full_like(far, 1e30)), (near, far))
    truth = [
        np.array(
            [naive.intersect(position, triangle, *ray) for ray in zip(origin, direction, *pair, strict=True)]
        )
        for pair in limits
    ]
    return position, triangle, origin, direction, tuple(zip(limits, truth, strict=True))


@pytest.mark.parametrize("robust", [True, False])
@pytest.mark.parametrize("width", WIDTHS)
def test_hits_are_those_of_every_triangle_tried(soup_rays, width, robust):
    position, triangle, origin, direction, cases = soup_rays
    rays = RayScene(position, triangle, robust=robust, threads=1)
    for (low, high), truth in cases:
        geom, prim, u, v, reach = cast(rays, origin, direction, low, high, width=width)
        hit = truth[:, 1] >= 0
        # By rounding, a ray near an edge may hit or miss.
        assert (hit != (geom >= 0)).sum() <= 1
        both = hit & (geom >= 0)
        assert both.sum() > 150
        np.testing.assert_allclose(reach[both], truth[both, 0], rtol=2e-5)
        np.testing.assert_array_equal(prim[both], truth[both, 1])
        corner = position[triangle[prim[both]]].astype(float)
        at = (
            corner[:, 0]
            + u[both, None] * (corner[:, 1] - corner[:, 0])
            + v[both, None] * (corner[:, 2] - corner[:, 0])
        )
        np.testing.assert_allclose(at, (origin + reach[:, None] * direction)[both], atol=2e-5)
        assert (reach[~hit & (geom < 0)] == high[~hit & (geom < 0)]).all()
        blocked = cast(rays, origin, direction, low, high, width=width, occluded=True)[4] < 0
        np.testing.assert_array_equal(blocked, geom >= 0)


def test_embreex_answers_the_same():
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    rng = np.random.default_rng(5)
    position, triangle = soup(200, rng)
    origin, direction = rays_at_random(20000, rng)
    other = EmbreeScene()
    TriangleMesh(other, position[triangle])
    told = other.run(origin, direction, query="INTERSECT", output=True)
    rays = RayScene(position, triangle, threads=1)
    for width in WIDTHS:
        geom, prim, u, v, reach = cast(rays, origin, direction, width=width)
        hit = geom >= 0
        # embreex builds another tree. If a ray hits two triangles at one distance, either may be reported.
        assert (hit != (told["geomID"] >= 0)).sum() == 0
        same = prim[hit] == told["primID"][hit]
        assert (~same).sum() <= 2
        np.testing.assert_allclose(reach[hit], told["tfar"][hit], rtol=1e-5)
        np.testing.assert_allclose(u[hit][same], told["u"][hit][same], atol=1e-4)
        np.testing.assert_allclose(v[hit][same], told["v"][hit][same], atol=1e-4)
        assert 0.5 < hit.mean() < 1


@pytest.mark.parametrize("width", WIDTHS)
def test_invalid_lanes_are_left_alone(soup_rays, width):
    position, triangle, origin, direction, *_ = soup_rays
    rays = RayScene(position, triangle, threads=1)
    geom, prim, _, _, reach = cast(rays, origin, direction, width=width)
    chosen = np.random.default_rng(0).random(len(origin)) < 0.4
    part = cast(rays, origin, direction, width=width, valid=chosen)
    np.testing.assert_array_equal(part[0][chosen], geom[chosen])
    hit = chosen & (geom >= 0)
    np.testing.assert_array_equal(part[1][hit], prim[hit])
    np.testing.assert_array_equal(part[4][chosen], reach[chosen])
    assert (part[0][~chosen] == -1).all()
    assert (part[4][~chosen] == np.float32(1e30)).all()
    blocked = cast(rays, origin, direction, width=width, valid=chosen, occluded=True)[4]
    assert (blocked[~chosen] == np.float32(1e30)).all()
    np.testing.assert_array_equal(blocked[chosen] < 0, geom[chosen] >= 0)


@pytest.mark.parametrize("width", WIDTHS)
def test_small_scenes(width):
    down = np.float32([[0, 0, -1]] * 3)
    origin = np.float32([[0.2, 0.2, 1], [0.7, 0.7, 1], [0.2, 0.2, -1]])
    nothing = RayScene(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), threads=1)
    assert (cast(nothing, origin, down, width=width)[0] == -1).all()
    assert (cast(nothing, origin, down, occluded=True, width=width)[4] > 0).all()
    corner = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    one = RayScene(corner, np.int32([[0, 1, 2]]), threads=1)
    geom, _, u, v, reach = cast(one, origin, down, width=width)
    np.testing.assert_array_equal(geom, [0, -1, -1])
    np.testing.assert_allclose([u[0], v[0], reach[0]], [0.2, 0.2, 1.0], rtol=1e-6)
    # Triangles that are a point or a line are never hit.
    flat = np.float32([[0, 0, 0.5]] * 3 + [[0, 0, 0.5], [0.5, 0.5, 0.5], [1, 1, 0.5]])
    position = np.concatenate([corner, flat])
    both = RayScene(position, np.int32([[3, 4, 5], [6, 7, 8], [0, 1, 2]]), threads=1)
    geom, prim, _, _, reach = cast(both, origin[:2] - [0, 0.05, 0], down[:2], width=width)
    np.testing.assert_array_equal(geom, [0, -1])
    assert prim[0] == 2
    assert reach[0] == pytest.approx(1.0, rel=1e-6)


def test_the_limits_of_a_ray_are_part_of_it():
    corner = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    rays = RayScene(corner, np.int32([[0, 1, 2]]), threads=1)
    assert rays.tracer.width in WIDTHS
    near, far = np.float32([0, 0, 0.6, 0.4, 0]), np.float32([0.4, 0.6, 1.0, 0.6, 0.5])
    origin, direction = np.float32([[0.2, 0.2, 1]] * 5), np.float32([[0, 0, -2]] * 5)
    geom = cast(rays, origin, direction, near, far)[0]
    np.testing.assert_array_equal(geom, [-1, 0, -1, 0, 0])


def closed_room(n, rng):
    """Return a convex closed mesh of irregular triangles around the origin."""
    point = rng.normal(size=(n, 3))
    point = np.float32(point / np.linalg.norm(point, axis=1, keepdims=True) * [3.0, 1.7, 0.9])
    return point, ConvexHull(point.astype(float)).simplices.astype(np.int32)


def rays_at_seams(position, triangle, share, rng):
    """Return origins inside the room, and directions to points at the share `share` (n,) of random edges."""
    n = len(share)
    t, k = rng.integers(0, len(triangle), n), rng.integers(0, 3, n)
    a, b = position[triangle[t, k]], position[triangle[t, (k + 1) % 3]]
    origin = np.float32(rng.uniform(-0.4, 0.4, (n, 3)))
    return origin, a + np.float32(share)[:, None] * (b - a) - origin


def test_no_ray_escapes_through_an_edge():
    rng = np.random.default_rng(11)
    position, triangle = closed_room(2000, rng)
    share = np.where(rng.random(150_000) < 0.3, 0.5, rng.random(150_000))
    origin, direction = rays_at_seams(position, triangle, share, rng)
    robust, plain = (RayScene(position, triangle, robust=r, threads=1) for r in (True, False))
    for width in WIDTHS:
        assert (cast(robust, origin, direction, width=width)[0] >= 0).all()
        assert (cast(robust, origin, direction, width=width, occluded=True)[4] < 0).all()
    # Without robust mode, rays do escape, so the assertions above are significant.
    assert 0.01 < (cast(plain, origin, direction)[0] < 0).mean() < 0.2


def test_few_rays_escape_through_a_vertex():
    """Less than 1 % of the rays aimed exactly at vertices escape, and no ray aimed slightly beside them."""
    rng = np.random.default_rng(13)
    position, triangle = closed_room(2000, rng)
    origin, direction = rays_at_seams(position, triangle, np.zeros(100_000), rng)
    robust, plain = (RayScene(position, triangle, robust=r, threads=1) for r in (True, False))
    leaked = (cast(robust, origin, direction)[0] < 0).mean()
    assert leaked < 0.01
    assert leaked < 0.1 * (cast(plain, origin, direction)[0] < 0).mean()
    near = direction + np.float32(rng.normal(0, 1e-5, direction.shape))
    assert (cast(robust, origin, near)[0] >= 0).all()


def test_the_version_is_told():
    assert embree_version().split(".")[0] == "4"


def test_a_scene_closes_once():
    rays = RayScene(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.int32([[0, 1, 2]]), threads=1)
    assert rays._device
    rays.close()
    assert rays._device is None
    rays.close()
    assert rays._device is None


def test_an_absent_library_is_named(monkeypatch):
    from importlib.metadata import PackageNotFoundError

    from baker.trace import embree

    def absent(name):
        raise PackageNotFoundError(name)

    embree._library.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(embree, "files", absent)
        with pytest.raises(ResourceError, match="pip install embreex"):
            embree.embree_version()
        patch.setattr(embree, "files", lambda name: [])
        with pytest.raises(ResourceError, match="carries no Embree 4"):
            embree.embree_version()
    assert embree.embree_version()[0] == "4"


def test_errors_of_the_library_are_sentences():
    rays = RayScene(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.int32([[0, 1, 2]]), threads=1)

    class Answers:
        code = 4

        def rtcGetDeviceError(self, device):
            return self.code

    library, rays._library = rays._library, Answers()
    with pytest.raises(ResourceError, match="memory ran out while testing"):
        rays._check("testing")
    rays._library.code = 3
    with pytest.raises(ResourceError, match="invalid operation"):
        rays._check("testing")
    rays._library = library
