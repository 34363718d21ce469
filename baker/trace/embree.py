"""Loads Embree's C API from the library in the `embreex` wheel, and builds Embree scenes.

Other files do not use Embree's functions and constants. `RayScene` owns the Embree device, its scenes and the
vertex memory. Kernels receive integers: addresses of functions and of scenes.

Based on: Embree 4 API reference (Intel, 2023), rtcore.h of Embree 4.4.
"""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, files
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import ResourceError

_GEOMETRY_TRIANGLE = 0
_BUFFER_INDEX, _BUFFER_VERTEX = 0, 1
_FORMAT_UINT3, _FORMAT_FLOAT3 = 0x5003, 0x9003
_PROPERTY_VERSION, _PROPERTY_RAY4, _PROPERTY_RAY8, _PROPERTY_RAY16 = 0, 32, 33, 34
_SCENE_ROBUST = 1 << 2
# Limit of the number of triangles of the scene. Up to this limit, packets are traced as coherent, because
# rays of neighbouring texels usually hit the same triangles. The table shows the time of a final gather (one
# page of 512 x 512 texels, 64 rays per texel) with coherent packets, divided by the time with incoherent
# packets:
#
#     triangles   36     446    986    2714   11,000        70,000
#     time        0.79   0.81   0.77   0.74   0.93 to 1.2   1.35
MAX_COHERENT_TRIANGLES = 4096
_QUALITY_MEDIUM = 1
_ERROR_OUT_OF_MEMORY = 4
_ERRORS = {
    1: "unknown error",
    2: "invalid argument",
    3: "invalid operation",
    4: "out of memory",
    5: "unsupported CPU",
    6: "cancelled",
}

# Name of each function: (result type, argument types). One letter is one type: p pointer, i int, u unsigned,
# z size_t, l ssize_t.
_SIGNATURES = {
    "rtcNewDevice": ("p", "p"), "rtcReleaseDevice": ("", "p"), "rtcGetDeviceProperty": ("l", "pi"),
    "rtcGetDeviceError": ("i", "p"), "rtcNewScene": ("p", "p"), "rtcReleaseScene": ("", "p"),
    "rtcSetSceneFlags": ("", "pi"), "rtcSetSceneBuildQuality": ("", "pi"), "rtcCommitScene": ("", "p"),
    "rtcNewGeometry": ("p", "pi"), "rtcReleaseGeometry": ("", "p"), "rtcCommitGeometry": ("", "p"),
    "rtcSetSharedGeometryBuffer": ("", "piuipzzz"), "rtcAttachGeometryByID": ("", "ppu"),
    "rtcSetGeometryUserData": ("", "pp"), "rtcSetGeometryIntersectFilterFunction": ("", "pp"),
    "rtcSetGeometryOccludedFilterFunction": ("", "pp"),
}  # fmt: skip
_TYPES: dict[str, Any] = {
    "p": ctypes.c_void_p, "i": ctypes.c_int, "u": ctypes.c_uint, "z": ctypes.c_size_t, "l": ctypes.c_ssize_t,
    "": None,
}  # fmt: skip


@cache
def _library() -> ctypes.CDLL:
    """Load Embree 4 from the installed files of the package `embreex`."""
    try:
        installed = files("embreex") or []
    except PackageNotFoundError:
        raise ResourceError("Embree is absent: install it with `pip install embreex`") from None
    named = [
        f for f in installed if "embree4" in f.name and (".so" in f.name or f.suffix in {".dll", ".dylib"})
    ]
    if not named:
        raise ResourceError("the installed embreex carries no Embree 4 library; install embreex 4.4 or newer")
    if sys.platform == "win32":
        import embreex
    try:
        library = ctypes.CDLL(str(named[0].locate()))
    except OSError:
        # Embree's dependency TBB was not found. Importing the extension module loads it.
        import embreex.rtcore  # noqa: F401

        library = ctypes.CDLL(str(named[0].locate()))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype = _TYPES[result]
        function.argtypes = [_TYPES[a] for a in arguments]
    return library


def embree_version() -> str:
    """Return the version of the Embree library in use.

    Returns
    -------
    str
        Major, minor and patch number, for example "4.4.0".
    """
    library = _library()
    device = library.rtcNewDevice(None)
    number = int(library.rtcGetDeviceProperty(device, _PROPERTY_VERSION))
    library.rtcReleaseDevice(device)
    return f"{number // 10000}.{number // 100 % 100}.{number % 100}"


class Tracer(NamedTuple):
    """Addresses that a kernel needs to trace rays. They are valid until the `RayScene` is closed.

    Attributes
    ----------
    scene : int
        Address of the RTCScene of all triangles.
    intersect, occluded : int
        Addresses of rtcIntersectN and rtcOccludedN.
    width : int
        N, the widest packet that this CPU traces natively: 4, 8 or 16.
    blend_scene : int or None
        Address of the RTCScene of the BLEND triangles that let light through; None without such triangles.
    coherent : bool
        Whether packets are traced as coherent: true for up to `MAX_COHERENT_TRIANGLES` triangles.
    coloured : bool
        Whether any triangle of `blend_scene` colours the light that passes through it.
    """

    scene: int
    intersect: int
    occluded: int
    width: int
    blend_scene: int | None = None
    coherent: bool = False
    coloured: bool = False

    def without_transmittance(self) -> Tracer:
        """Return a tracer that computes no transmittance, for occlusion and distance queries."""
        return self._replace(blend_scene=None)


class HitFilter(NamedTuple):
    """Triangles with an Embree filter callback that accepts or rejects each hit.

    Attributes
    ----------
    chosen : (T,) bool
        Whether each triangle has the callback.
    function : int
        Address of `void f(RTCFilterFunctionNArguments*)`, which sets `valid` of rejected hits to 0.
    data : int
        `geometryUserPtr` of the callback.
    owner : object
        A reference that prevents the release of function and data.
    coloured : bool
        Whether any of these triangles colours the light that passes through it.
    """

    chosen: NDArray[np.bool_]
    function: int
    data: int
    owner: Any
    coloured: bool = False


class RayScene:
    """The Embree scene of T triangles.

    A hit has `geomID` 2 on triangles of `blend_filter`, 1 on the other triangles of `hit_filter`, and 0 on
    the remaining triangles. Its `primID` is the index of the triangle in `triangle`.

    Parameters
    ----------
    position : (V, 3) float32, metres, world
        Vertices.
    triangle : (T, 3) uint32 or int32
        Indices of the triangles' vertices.
    robust : bool
        Embree's ROBUST flag. With it, no ray leaks through a shared edge. If rays are aimed exactly at a
        vertex, 0.7 % of them leak with the flag, and 17 % without it.
    threads : int
        Number of threads that build the tree; 0 means all.
    hit_filter : HitFilter, optional
        Triangles that may let rays pass.
    blend_filter : HitFilter, optional
        The triangles of `hit_filter` that let a share of the light through. They also form a second scene,
        `Tracer.blend_scene`, in which this filter is called.

    Raises
    ------
    ResourceError
        If Embree is absent, has another major version, or runs out of memory.
    """

    def __init__(
        self,
        position: NDArray[np.float32],
        triangle: NDArray[Any],
        *,
        robust: bool = True,
        threads: int = 0,
        hit_filter: HitFilter | None = None,
        blend_filter: HitFilter | None = None,
    ) -> None:
        library = _library()
        self._library = library
        self._owners = hit_filter, blend_filter
        n = len(position)
        # Every geometry contains all T triangles, so that `primID` is the same in each. With filters, vertex
        # n is NaN. All three vertices of a triangle that does not belong to a geometry are vertex n there, so
        # that Embree skips the triangle. The last row is padding, because Embree reads 16 bytes at each
        # vertex.
        self._position = np.zeros((n + (1 if hit_filter is None else 2), 3), np.float32)
        self._position[:n] = position
        whole = np.ascontiguousarray(triangle, np.uint32)
        self._triangles = [whole]
        if hit_filter is not None:
            self._position[n] = np.nan
            chosen = hit_filter.chosen
            share = np.zeros_like(chosen) if blend_filter is None else blend_filter.chosen
            kept = [~chosen, chosen & ~share, *([] if blend_filter is None else [share])]
            self._triangles = [np.where(own[:, None], whole, np.uint32(n)) for own in kept]
        config = f"threads={threads},set_affinity=0".encode() if threads else b"set_affinity=0"
        self._device = library.rtcNewDevice(ctypes.cast(ctypes.c_char_p(config), ctypes.c_void_p))
        if not self._device:
            raise ResourceError(
                f"Embree could not start: {_ERRORS.get(library.rtcGetDeviceError(None), 'unknown')}"
            )
        self._scenes: list[int] = []
        if int(library.rtcGetDeviceProperty(self._device, _PROPERTY_VERSION)) // 10000 != 4:
            raise ResourceError("Embree 4 is needed; install embreex 4.4 or newer")
        filters = (None, hit_filter, hit_filter)
        parts = zip(range(3), self._triangles, filters, strict=False) if len(triangle) else ()
        # Omit geometry 1 if it has no triangles. The other geometries keep their numbers.
        scene = self._add_scene([part for part in parts if part[0] != 1 or kept[1].any()], robust)
        blend_scene = None
        if blend_filter is not None:
            blend_scene = self._add_scene([(0, self._triangles[-1], blend_filter)], robust)
        self._check("building the ray tree")
        self.tracer = self._tracer(scene, blend_scene, blend_filter is not None and blend_filter.coloured)

    def _add_scene(self, parts: list[tuple[int, NDArray[np.uint32], HitFilter | None]], robust: bool) -> int:
        library = self._library
        scene = int(library.rtcNewScene(self._device))
        self._scenes.append(scene)
        library.rtcSetSceneFlags(scene, _SCENE_ROBUST if robust else 0)
        library.rtcSetSceneBuildQuality(scene, _QUALITY_MEDIUM)
        for number, indices, see in parts:
            self._add_triangles(scene, number, indices, see)
        library.rtcCommitScene(scene)
        return scene

    def _add_triangles(
        self, scene: int, number: int, triangle: NDArray[np.uint32], hit_filter: HitFilter | None
    ) -> None:
        library = self._library
        geometry = library.rtcNewGeometry(self._device, _GEOMETRY_TRIANGLE)
        library.rtcSetSharedGeometryBuffer(
            geometry,
            _BUFFER_VERTEX,
            0,
            _FORMAT_FLOAT3,
            self._position.ctypes.data,
            0,
            12,
            len(self._position) - 1,
        )
        library.rtcSetSharedGeometryBuffer(
            geometry, _BUFFER_INDEX, 0, _FORMAT_UINT3, triangle.ctypes.data, 0, 12, len(triangle)
        )
        if hit_filter is not None:
            library.rtcSetGeometryUserData(geometry, hit_filter.data)
            library.rtcSetGeometryIntersectFilterFunction(geometry, hit_filter.function)
            library.rtcSetGeometryOccludedFilterFunction(geometry, hit_filter.function)
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometryByID(scene, geometry, number)
        library.rtcReleaseGeometry(geometry)

    def _check(self, what: str) -> None:
        code = self._library.rtcGetDeviceError(self._device)
        if code == _ERROR_OUT_OF_MEMORY:
            raise ResourceError(f"memory ran out while {what}; bake fewer triangles at once")
        if code:
            raise ResourceError(f"Embree failed while {what}: {_ERRORS.get(code, code)}")

    def _tracer(self, scene: int, blend_scene: int | None, coloured: bool) -> Tracer:
        library = self._library
        width = 4
        for candidate, name in ((16, _PROPERTY_RAY16), (8, _PROPERTY_RAY8)):
            if library.rtcGetDeviceProperty(self._device, name):
                width = candidate
                break
        coherent = len(self._triangles[0]) <= MAX_COHERENT_TRIANGLES
        return Tracer(scene, *self.functions(width), width, blend_scene, coherent, coloured)

    def functions(self, width: int) -> tuple[int, int]:
        """Return the addresses of rtcIntersectN and rtcOccludedN for packets of 4, 8 or 16 rays."""
        intersect, occluded = (
            ctypes.cast(getattr(self._library, f"{kind}{width}"), ctypes.c_void_p).value or 0
            for kind in ("rtcIntersect", "rtcOccluded")
        )
        return intersect, occluded

    def close(self) -> None:
        """Release scenes and device; the tracer must not be used afterwards."""
        if self._device:
            for scene in self._scenes:
                self._library.rtcReleaseScene(scene)
            self._library.rtcReleaseDevice(self._device)
            self._device = None

    def __del__(self) -> None:
        """Release scenes and device if `close` was not called."""
        if getattr(self, "_device", None):
            self.close()
