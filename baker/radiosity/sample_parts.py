"""Divides texel entries into parts with equal numbers of rays, because objects may have a factor on these.

Each part is traced like a whole job. Without such factors, there is one part that contains all entries.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Scene
from baker.core.texels import TexelBuffer
from baker.radiosity.emitter_choice import EmitterSampling
from baker.radiosity.trace_job import TraceJob

# Largest number of rays per texel, the limit of the settings.
_MOST = 65536


@dataclass(frozen=True)
class SamplePart:
    """Entries whose objects have the same factor on the numbers of rays.

    Attributes
    ----------
    number : int
        Index of the part. It identifies the part to the workers of a cluster.
    factor : float
        Factor on the numbers of rays.
    entry : (m,) int64 or None
        The entries, ascending; None for all.
    n_front : int
        Number of front entries of the part, which come first.
    """

    number: int
    factor: float
    entry: NDArray[np.int64] | None
    n_front: int

    @property
    def rows(self) -> NDArray[np.int64] | slice:
        """Return the index of the part's entries in arrays of all entries."""
        return slice(None) if self.entry is None else self.entry

    @property
    def front_rows(self) -> NDArray[np.int64] | slice:
        """Return the index of the part's front entries in arrays of all front entries."""
        return slice(None) if self.entry is None else self.entry[: self.n_front]

    def rays(self, number: int) -> int:
        """Return a number of rays per texel times the factor, at least 1."""
        return number if self.factor == 1.0 else min(max(round(number * self.factor), 1), _MOST)

    def job(self, job: TraceJob) -> TraceJob:
        """Return the job of the part's entries alone."""
        if self.entry is None:
            return job
        surface = job.surface._replace(
            pixel=job.surface.pixel[self.entry],
            front=job.surface.front[self.entry],
            back=job.surface.back[self.entry],
        )
        return replace(
            job,
            surface=surface,
            valid_points=job.valid_points[self.entry],
            chart=None if job.chart is None else job.chart[self.entry],
            point_cache=None,
        )

    def sampling(self, sampling: EmitterSampling) -> EmitterSampling:
        """Return the sampling with the part's numbers of rays."""
        if self.factor == 1.0:
            return sampling
        return replace(sampling, n_light=self.rays(sampling.n_light), n_gather=self.rays(sampling.n_gather))


def sample_parts(scene: Scene, texels: TexelBuffer) -> list[SamplePart]:
    """Return the parts of the entries, one for each factor that occurs.

    Parameters
    ----------
    scene : Scene
        The scene, with the settings of its instances.
    texels : TexelBuffer
        All entries.

    Returns
    -------
    list of SamplePart
        Ascending by factor.
    """
    factor = np.array([instance.settings.samples for instance in scene.instances])
    distinct = np.unique(factor)
    if len(distinct) == 1:
        return [SamplePart(0, float(distinct[0]), None, texels.n_front)]
    own = factor[texels.instance]
    parts = []
    for number, value in enumerate(distinct.tolist()):
        entry = np.flatnonzero(own == value)
        if len(entry):
            parts.append(SamplePart(number, value, entry, int(np.searchsorted(entry, texels.n_front))))
    return parts
