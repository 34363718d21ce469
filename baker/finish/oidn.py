"""Runs Open Image Denoise's filters; the only file that imports `pyoidn`.

*Measured* with OIDN 2.5.1 on the CPU: the result has the same bytes in each run, with 1 and 2 threads, and
for any `memory_mb`, because tiles overlap by the network's receptive field. The lightmap filter ignores the
options `hdr` and `quality`, because it has a single network. Loading the library takes 0.2 s. Creating the
device and the network takes 0.04 s.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import ResourceError
from baker.core.parallel import thread_count
from baker.core.progress import Progress, report, silent
from baker.core.stage import Stage

# Largest scratch memory of the filter, MB. More memory allows larger tiles, but these did not make the filter
# faster.
MEMORY_MB = 1000


def denoiser_name() -> dict[str, str]:
    """Return name, version and filter of the denoiser, for the manifest.

    Returns
    -------
    dict of str to str
        `name`, `version`, `filter` and `pyoidn`.

    Raises
    ------
    ResourceError
        If Open Image Denoise cannot be loaded.
    """
    library = _library()
    return {
        "name": "Open Image Denoise",
        "version": str(library.version.oidn_version),
        "filter": str(library.OIDN_FILTER_TYPE_RT_LIGHTMAP),
        "pyoidn": importlib.metadata.version("pyoidn"),
    }


def filter_picture(
    image: NDArray[np.float32],
    *,
    albedo: NDArray[np.float32],
    normal: NDArray[np.float32],
    threads: int = 0,
    progress: Progress = silent,
) -> NDArray[np.float32]:
    """Denoise a rendered HDR picture, with albedo and normals at first hits as auxiliary images.

    Parameters
    ----------
    image : (H, W, 3) float32
        Radiance.
    albedo : (H, W, 3) float32
        Base colour at the first hits.
    normal : (H, W, 3) float32
        Normal at the first hits.
    threads : int
        Number of threads; 0 = all cores.
    progress : Progress
        Called with the fraction done; a truthy return value cancels.

    Returns
    -------
    image : (H, W, 3) float32
        The denoised picture.

    Raises
    ------
    ResourceError, Cancelled
        See `LightmapDenoiser.filter`.
    """
    library = _library()
    inputs = {
        library.OIDN_IMAGE_COLOR: image,
        library.OIDN_IMAGE_ALBEDO: albedo,
        library.OIDN_IMAGE_NORMAL: normal,
    }
    device = _new_device(library, threads)
    try:
        filter_ = library.Filter(device, library.OIDN_FILTER_TYPE_RT)
        try:
            filter_.set_bool("hdr", True)
            filter_.set_int("maxMemoryMB", MEMORY_MB)
            return _execute(library, device, filter_, inputs, progress)
        finally:
            filter_.release()
    finally:
        device.release()


class LightmapDenoiser:
    """Denoises pages one after the other and keeps the filter's scratch memory until `close`.

    *Measured* on pages of 512 x 512 texels: if a new device is created for each page, denoising takes a
    seventh longer, because the operating system clears the scratch memory (160 MB) each time.

    Parameters
    ----------
    threads : int
        Number of threads; 0 = all cores.
    memory_mb : int
        Largest scratch memory of the filter, MB.
    """

    def __init__(self, threads: int = 0, memory_mb: int = MEMORY_MB) -> None:
        self._threads = threads
        self._memory_mb = memory_mb
        self._device: Any = None
        # Filters by the argument `signed` of `filter`, created when first needed.
        self._filters: dict[bool, Any] = {}

    @property
    def threads(self) -> int:
        """Return the number of threads, at least 1."""
        return thread_count(self._threads or None)

    def __enter__(self) -> LightmapDenoiser:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def filter(
        self, image: NDArray[np.float32], progress: Progress = silent, *, signed: bool = False
    ) -> NDArray[np.float32]:
        """Denoise one picture of light, or of signed values.

        Parameters
        ----------
        image : (H, W, 3) float32
            Linear light, finite and not negative. If `signed` is true, finite values of both signs. All
            pixels must have a meaningful value.
        progress : Progress
            Called with the fraction done; a truthy return value stops the filter.
        signed : bool
            Use the filter's mode for coefficients of directional lightmaps in [-1, 1]. The values are scaled
            to that range by the filter's input scale.

        Returns
        -------
        image : (H, W, 3) float32
            The denoised picture.

        Raises
        ------
        ResourceError
            If the library cannot be loaded or runs out of memory.
        Cancelled
            If `progress` returned a truthy value.
        """
        library = _library()
        if self._device is None:
            self._device = _new_device(library, self._threads)
        if signed not in self._filters:
            self._filters[signed] = library.Filter(self._device, library.OIDN_FILTER_TYPE_RT_LIGHTMAP)
        filter_ = self._filters[signed]
        filter_.set_int("maxMemoryMB", self._memory_mb)
        if signed:
            filter_.set_bool("directional", True)
            largest = float(np.abs(image).max(initial=0.0))
            filter_.set_float("inputScale", 1.0 / largest if largest > 0.0 else 1.0)
        return _execute(library, self._device, filter_, {library.OIDN_IMAGE_COLOR: image}, progress)

    def close(self) -> None:
        """Release the filter's memory; the next picture allocates it again."""
        for filter_ in self._filters.values():
            filter_.release()
        self._filters.clear()
        if self._device is not None:
            self._device.release()
            self._device = None


def _new_device(library: Any, threads: int) -> Any:
    device = library.Device(library.OIDN_DEVICE_TYPE_CPU)
    device.set_int("numThreads", threads)
    # Do not pin threads to cores: pinning would also affect other threads of the caller, and did not make the
    # filter faster.
    device.set_bool("setAffinity", False)
    device.commit()
    _check(library, device)
    return device


def _execute(
    library: Any, device: Any, filter_: Any, inputs: dict[Any, NDArray[np.float32]], progress: Progress
) -> NDArray[np.float32]:
    """Run a filter and return (H, W, 3) float32; `inputs` maps OIDN's image names to pictures (H, W, 3)."""
    sources = {name: np.ascontiguousarray(image, np.float32) for name, image in inputs.items()}
    result = np.zeros_like(sources[library.OIDN_IMAGE_COLOR])
    for name, source in sources.items():
        filter_.set_image(name, source, library.OIDN_FORMAT_FLOAT3)
    filter_.set_image(library.OIDN_IMAGE_OUTPUT, result, library.OIDN_FORMAT_FLOAT3)
    monitor = _Monitor(library, filter_, progress)
    filter_.commit()
    filter_.execute()
    monitor.finish()
    _check(library, device)
    return result


class _Monitor:
    """Reports OIDN's progress through its C library, because `pyoidn` does not wrap the progress function."""

    def __init__(self, library: Any, filter_: Any, progress: Progress) -> None:
        self._progress = progress
        self._caught: BaseException | None = None
        # Keep a reference to the callback, so that it is not freed while the filter runs.
        self._function = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_double)(self._step)
        native = ctypes.CDLL(str(_native_path(library)))
        native.oidnSetFilterProgressMonitorFunction.argtypes = [ctypes.c_void_p] * 3
        native.oidnSetFilterProgressMonitorFunction.restype = None
        handle = int(library.capi.oidn_ffi.cast("uintptr_t", filter_._filter))
        native.oidnSetFilterProgressMonitorFunction(
            handle, ctypes.cast(self._function, ctypes.c_void_p), None
        )

    def _step(self, user: int | None, fraction: float) -> bool:
        # Store any exception, KeyboardInterrupt included, and stop the filter, because exceptions cannot pass
        # through C code.
        try:
            if self._caught is None:
                report(self._progress, Stage.DENOISE, float(fraction))
        except BaseException as error:
            self._caught = error
        return self._caught is None

    def finish(self) -> None:
        """Raise the exception that was caught while the filter ran."""
        if self._caught is not None:
            raise self._caught


def _native_path(library: Any) -> Path:
    folder = Path(library.__file__).parent / "oidn"
    for pattern in (
        "lib/libOpenImageDenoise.so",
        "lib/libOpenImageDenoise.dylib",
        "bin/OpenImageDenoise.dll",
    ):
        path = folder / pattern
        if path.exists():
            return path
    raise ResourceError(
        f"Open Image Denoise is not in {folder}: reinstall pyoidn or bake with `denoise=False`"
    )


def _library() -> Any:
    try:
        import pyoidn
        import pyoidn.capi

        supported = bool(pyoidn.Device.is_cpu_available())
    except (ImportError, OSError, AttributeError) as error:
        raise ResourceError(
            f"Open Image Denoise cannot be loaded ({error}): reinstall pyoidn or bake with `denoise=False`"
        ) from error
    if not supported:
        raise ResourceError("Open Image Denoise does not support this processor: bake with `denoise=False`")
    return pyoidn


def _check(library: Any, device: Any) -> None:
    message = device.get_error()
    if message is not None:
        raise ResourceError(
            f"Open Image Denoise failed ({message}): bake with `denoise=False` or smaller pages"
        )
